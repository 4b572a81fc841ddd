"""Finds out where test data lands: a block of an input counts if it changes a message that a component receives.

Each case is executed, and again with one value put in another block, all else equal; what components received is
compared:

    motion 0.20  path 4  odometry 1.1       received  a b c d
    motion 0.40    .       .                          a B c d      the block of motion lands
      .            .     odometry 2.5                 a b c d      that of odometry does not
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from parcours.data import Domain, InputModel, count
from parcours.data.inputs import extent
from parcours.data.measuring import allowed
from parcours.errors import BadRequest, ParcoursError
from parcours.run.port import ENVIRONMENT
from parcours.study.components.executing import Execute, Exercise, in_process
from parcours.study.components.isolation import Done, run_apart, watched
from parcours.study.parameters import Settings
from parcours.study.protocol import Progress
from parcours.suite import Case, Plan

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

FURTHER = 12  # more rows of an abstract case that are tried for a block that its own rows leave without effect
GLANCE = 400  # executions after which a glance at where data lands ends
_MORE = 1  # other values that are tried in the place of one, beside one of every other block

Spot = tuple[int, int]  # the column of an input, and one of its blocks


@dataclass(frozen=True, slots=True)
class Landed:
    """Where the data of one abstract case lands: blocks that its cases hold, those that land, and further cases."""

    held: frozenset[Spot] = frozenset()
    landed: frozenset[Spot] = frozenset()
    further: tuple[str, ...] = ()  # ids of cases beyond the plan in which blocks land that land in none of its cases
    n_runs: int = 0
    why: str = ""  # why it could not be found out; empty if it could

    @property
    def felt(self) -> tuple[int, ...]:
        """The columns of the inputs of which any block lands."""
        return tuple(sorted({column for column, _ in self.landed}))


@dataclass(frozen=True, slots=True)
class Landing:
    """Where the test data of a study lands, abstract case by abstract case."""

    inputs: InputModel
    criterion: str
    of: Mapping[str, Landed]

    @property
    def spots(self) -> tuple[Spot, ...]:
        """All blocks that valid values lie in."""
        return tuple((column, block) for column, size in enumerate(self.inputs.sizes) for block in range(size))

    def abstracts(self, spot: Spot) -> tuple[str, ...]:
        """Return the abstract cases in which a block lands."""
        return tuple(id for id, one in self.of.items() if spot in one.landed)

    def name(self, spot: Spot) -> str:
        """Return a block in words: `motion = [0.25, 0.5]`."""
        return self.inputs.in_words([spot])

    @property
    def unreached(self) -> tuple[str, ...]:
        """The blocks that land in no case, by name."""
        return tuple(self.name(spot) for spot in self.spots if not self.abstracts(spot))

    @property
    def n_pairs(self) -> int:
        """How many pairs of an abstract case and a block land."""
        return sum(len(one.landed) for one in self.of.values())

    @property
    def further(self) -> tuple[str, ...]:
        """The ids of the cases by which the suite is extended."""
        return tuple(id for one in self.of.values() for id in one.further)

    @property
    def undecided(self) -> Mapping[str, str]:
        """The abstract cases of which it could not be found out, and why."""
        return {id: one.why for id, one in self.of.items() if one.why}

    @property
    def groups(self) -> Mapping[tuple[str, ...], tuple[str, ...]]:
        """The abstract cases by the inputs that they feel; an input that they do not feel need not be combined."""
        found: dict[tuple[str, ...], tuple[str, ...]] = {}
        for id, one in self.of.items():
            names = tuple(self.inputs.names[column] for column in one.felt)
            found[names] = (*found.get(names, ()), id)
        return found

    def rows(self, names: Sequence[str]) -> int:
        """Return how many rows the criterion needs over these inputs alone: none waits on one that is not felt."""
        sizes = [size for name, size in zip(self.inputs.names, self.inputs.sizes, strict=True) if name in names]
        return count(self.criterion, sizes) if sizes else 1


def landing_of(study: ComponentStudy, plan: Plan, settings: Settings, progress: Progress) -> Landing:
    """Return where the data of a plan's cases lands.

    Everything is executed in simulated time: for each abstract case and block until the block lands, at most once for
    each of its rows, `FURTHER` more, with a value of every other block.

    Raises BadRequest: the study has no test inputs, or the study's components are not made by it.
    """
    if not plan.inputs.domains:
        raise BadRequest(study.name, "where data lands is asked of a study with test inputs, but it has none",
                         "add a domains.yaml", slug="no-inputs")  # fmt: skip
    found: dict[str, Landed] = {}
    for id, landed in _all(study, plan, settings):
        found[id] = landed
        progress("abstract cases", len(found), len(plan.abstracts))
    return Landing(plan.inputs, plan.criterion, {id: found[id] for id in plan.abstracts})


@dataclass(frozen=True, slots=True)
class Glance:
    """Which blocks reached a component in any case, as far as a few executions tell."""

    blocks: int  # of valid values
    unreached: tuple[str, ...]  # those that were not seen to change a message, by name
    n_runs: int
    is_whole: bool  # whether every case of the plan was looked at for them


def glance(study: ComponentStudy, plan: Plan, settings: Settings) -> Glance:
    """Return which blocks reach no component, in at most some `GLANCE` executions in simulated time.

    What `landing_of` finds out abstract case by abstract case, for all of them together.
    """
    inputs = plan.inputs
    left = {(column, block) for column, size in enumerate(inputs.sizes) for block in range(size)}
    blocks, runs, is_whole = len(left), 0, True
    with contextlib.closing(_all(study, plan, settings, left)) as found:
        for id, landed in found:
            left -= landed.landed
            runs += landed.n_runs
            is_whole &= not landed.why
            if not left or runs >= GLANCE:
                is_whole &= not left or id == plan.abstracts[-1]
                break
    names = tuple(inputs.in_words([spot]) for spot in sorted(left))
    return Glance(blocks, names, runs, is_whole)


def _all(
    study: ComponentStudy, plan: Plan, settings: Settings, only: set[Spot] | None = None
) -> Generator[tuple[str, Landed], None, None]:
    """Yield where the data of each abstract case lands; `only`: of these blocks, which may become fewer meanwhile."""
    exercise = study.exercise(settings)
    if study.trusted:
        for id in plan.abstracts:
            yield id, _Search(study, exercise, in_process(exercise), plan, id, only).landed()
        return

    def work(id: str) -> Landed:
        execute = in_process(exercise, watch=watched(study.patience), checked=study.messages.checked)
        return _Search(study, exercise, execute, plan, id, only).landed()

    for id, answer in run_apart(plan.abstracts, work, study.patience):
        yield id, answer.result if isinstance(answer, Done) else Landed(why=answer)


class _Search:
    """Executes the cases of one abstract case with one value after the other replaced."""

    def __init__(
        self, study: ComponentStudy, exercise: Exercise, execute: Execute, plan: Plan, abstract: str,
        only: set[Spot] | None = None,
    ) -> None:  # fmt: skip
        self._only = only
        self._codec, self._exercise, self._execute = study.nodes().codec, exercise, execute
        self._inputs = plan.inputs
        place, n = plan.abstracts.index(abstract), len(plan.abstracts)
        self._rows = range(place, len(plan), n)
        last = max((*self._rows, place)) + FURTHER * n
        self._more = range(last - (FURTHER - 1) * n if self._rows else place, last + 1, n)
        self._plan = replace(plan, n_cases=last + 1)  # rows beyond the plan have values, too
        self._n_runs = 0

    def landed(self) -> Landed:
        held: set[Spot] = set()
        landed: set[Spot] = set()
        further: list[str] = []
        for number in self._rows:
            case = self._plan.case(number)
            held |= set(self._spots(case))
            landed |= self._landing(case, landed if self._only is None else landed | (held - self._only))
        if self._only is not None:
            return Landed(frozenset(held), frozenset(landed), (), self._n_runs)
        everything = {(column, block) for column, size in enumerate(self._inputs.sizes) for block in range(size)}
        for number in self._more:
            felt = {column for column, _ in landed}
            if not any(column in felt for column, _ in everything - landed):
                break
            case = self._plan.case(number)
            if more := self._landing(case, landed | {spot for spot in everything if spot[0] not in felt}):
                landed |= more
                further.append(case.id)
        return Landed(frozenset(held), frozenset(landed), tuple(further), self._n_runs)

    def _spots(self, case: Case) -> Iterator[Spot]:
        for column, block in enumerate(self._inputs.blocks_of(np.array([case.values]))[0].tolist()):
            if 0 <= block < self._inputs.sizes[column]:
                yield column, block

    def _landing(self, case: Case, known: set[Spot]) -> set[Spot]:
        """Return the blocks of a case that land, but for those of which it is known already."""
        asked = [spot for spot in self._spots(case) if spot not in known]
        if not asked or self._exercise.contradiction(case):
            return set()
        before = self._received(case)
        return {spot for spot in asked if any(self._received(other) != before for other in self._others(case, spot))}

    def _others(self, case: Case, spot: Spot) -> Iterator[Case]:
        """Yield the case with other values of one input: of other blocks if it has any, else of the same one."""
        column, own = spot
        domain = self._inputs.domains[column]
        blocks = [block for block in range(len(domain.blocks)) if block != own] or [own]
        tries = 0
        for value in (_value(domain, block, place) for place in (0.5, 0.0, 1.0) for block in blocks):
            values = (*case.values[:column], value, *case.values[column + 1 :])
            other = replace(case, values=values)
            if value == case.values[column] or not allowed(self._inputs, np.array([values])).all():
                continue
            if self._exercise.contradiction(other):
                continue
            yield other
            tries += 1
            if tries == len(blocks) + _MORE:
                return

    def _received(self, case: Case) -> bytes:
        """Return a digest of what components receive, input variables and messages in the place of prompts included."""
        self._n_runs += 1
        trace = self._execute(case).trace
        tester, digest = self._exercise.tester(case), hashlib.sha256()
        given = [
            (event.channel, event.payload)
            for event in trace.events
            if event.kind == "receive" and event.component != ENVIRONMENT
        ]
        for event in self._exercise.events(case):
            given += tester.settling(event)
            given += [one for one in [tester.given(event)] if one is not None]
        for channel, payload in given:
            digest.update(self._bytes(channel, payload))
        return digest.digest()

    def _bytes(self, channel: str, payload: object) -> bytes:
        try:
            return channel.encode() + self._codec.encode(channel, payload)
        except (ParcoursError, TypeError, ValueError):  # a component may send anything
            return f"{channel} {payload!r}".encode()


def _value(domain: Domain, block: int, place: float) -> float:
    """Return the value of a block [unit] at a place from its low end, 0, to its high end, 1."""
    low, high = extent(domain, domain.blocks[block])
    value = low + place * (high - low)
    return float(math.floor(value)) if domain.kind in ("integer", "enumeration") else value
