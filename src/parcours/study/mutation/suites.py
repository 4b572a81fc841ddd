"""The suites of a study that are compared on the same mutants: criteria, data oracles off, random tests.

A random test is a random walk through each machine, combined as any paths are, with values of random blocks: no
requirement was looked at. There are `_MANY` times as many walks as the `edge` criterion has
paths, of which those count that meet.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from parcours.abtc import AbstractCase, abstract_cases
from parcours.data import CRITERIA
from parcours.errors import BadRequest, require_known
from parcours.hashing import hashed
from parcours.model.structure import Cefsm, Machine, Transition
from parcours.paths import internal_paths
from parcours.paths.internal import InternalPath

if TYPE_CHECKING:
    from parcours.study.protocol import Study

RANDOM = "random"
_LONGEST = 12  # transitions of a random walk
_WALKS = 200  # tries until one has ended
_MANY = 4


@dataclasses.dataclass(frozen=True, slots=True)
class Suite:
    """How the cases of a study are selected, and whether data are judged."""

    paths: str = ""  # criterion of internal paths, or random; the study's if empty
    combine: str = ""  # criterion by which blocks are combined; the study's if empty
    data: bool = True  # whether formulas, references and relations judge
    mixed: bool = False  # whether its abstract cases come in a random order, so that the first are a fair sample

    @property
    def name(self) -> str:
        """Its name, which a folder can have."""
        parts = (self.paths.replace(" ", "-"), self.combine, "" if self.data else "no-data")
        return "+".join(part for part in parts if part) or "study"


WHOLE = Suite()
"""As the study is."""

COMPARED = (
    Suite("edge", "each_choice"), Suite("edge", "each_choice", data=False), Suite("edge-pair", "each_choice"),
    Suite("prime", "each_choice"), Suite("edge", "pairwise"), Suite(RANDOM, RANDOM),
)  # fmt: skip
"""What `parcours mutate STUDY --compare` compares; the last are the random tests."""


def with_suite(study: Study, suite: Suite, seed: int = 0) -> Study:
    """Return a study whose cases are selected and judged otherwise.

    Raises BadRequest: it is no component study, a criterion is unknown, or random walks make no case.
    """
    from parcours.study.components.study import ComponentStudy

    if suite == WHOLE:
        return study
    if not isinstance(study, ComponentStudy):
        rule = f"criteria are for component studies, but {study.name} is another"
        raise BadRequest("--paths, --combine", rule, slug="option-study")
    require_known(suite.combine or study.criterion, list(CRITERIA), "criterion", slug="unknown-criterion")
    is_random = suite.paths == RANDOM
    if not is_random:
        internal_paths(study.model, suite.paths or study.paths)
    model = study.model if suite.data else _without_formulas(study.model)
    made = dataclasses.replace(
        study, model=model, paths=study.paths if is_random else suite.paths or study.paths,
        criterion=suite.combine or study.criterion, relations=study.relations if suite.data else (),
        oracles=tuple(one for one in study.oracles if suite.data or not getattr(one, "of_data", False)),
    )  # fmt: skip
    if is_random:
        made.__dict__["abstracts"] = random_cases(study.model, seed, study.policy)
    elif suite.mixed:
        made.__dict__["abstracts"] = _mixed(made.abstracts, seed)
    return made


def _without_formulas(model: Cefsm) -> Cefsm:
    components = tuple(
        dataclasses.replace(
            component, invariants=(),
            machines=tuple(
                dataclasses.replace(
                    machine, transitions=tuple(dataclasses.replace(one, ensures=()) for one in machine.transitions)
                )
                for machine in component.machines
            ),
        )
        for component in model.components
    )  # fmt: skip
    channels, signals = (
        tuple(dataclasses.replace(channel, ensures=()) for channel in carriers)
        for carriers in (model.channels, model.signals)
    )
    return dataclasses.replace(model, components=components, channels=channels, signals=signals)


def random_cases(model: Cefsm, seed: int, policy: str = "") -> dict[str, AbstractCase]:
    """Return abstract cases of random walks by id, in a random order. Raises BadRequest if the walks never meet."""
    paths = {name: tuple(_walks(model, name, len(found), seed)) for name, found in internal_paths(model).items()}
    cases = {case.id: case for case in abstract_cases(model, policy or None, paths=paths)}
    if not cases:
        rule = "walks must meet in some case, but with this seed none do"
        raise BadRequest("random tests", rule, "take another seed", slug="random-cases")
    return _mixed(cases, seed)


def _mixed(cases: Mapping[str, AbstractCase], seed: int) -> dict[str, AbstractCase]:
    lots = {id: hashlib.sha256(f"{seed} {id}".encode()).digest() for id in cases}
    drawn: dict[str, list[str]] = {}  # an interaction as often as any other, whatever its number of cases
    for id in sorted(cases, key=lots.__getitem__):
        drawn.setdefault(cases[id].interaction.name, []).append(id)
    rounds = itertools.chain.from_iterable(itertools.zip_longest(*drawn.values()))
    return {id: cases[id] for id in rounds if id is not None}


def _walks(model: Cefsm, name: str, n: int, seed: int) -> Iterator[InternalPath]:
    component = model.component(name)
    place = [one.name for one in model.components].index(name) + 1
    for k in range(_MANY * max(n, len(component.machines))):
        machine = component.machines[k % len(component.machines)]
        words = (hashed(f"{seed} {name} {machine.name} {k} {i}".encode(), 1)[0] for i in itertools.count())
        yield InternalPath(f"tp{place}r{k + 1}", name, machine.name, random_walk(machine, words))


def random_walk(machine: Machine, words: Iterator[int]) -> tuple[Transition, ...]:
    """Return a walk from the initial state to where a test may end; empty if none of many comes there.

    Args:
        words: what chance says, whole numbers of 0 or more.
    """
    leaving: dict[str, list[Transition]] = {}
    for one in machine.transitions:
        leaving.setdefault(one.source, []).append(one)
    ends = set(machine.final) or {machine.initial}
    for _ in range(_WALKS):
        walk: list[Transition] = []
        state = machine.initial
        while len(walk) < _LONGEST and leaving.get(state):
            walk.append(leaving[state][next(words) % len(leaving[state])])
            state = walk[-1].target
            if (state in ends or state not in leaving) and next(words) % 2:
                return tuple(walk)
    return ()
