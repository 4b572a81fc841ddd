"""Selects the abstract cases of a model that some values can make run, and says why the others cannot.

Internal paths know no guards. One tour through all of a machine may take its transitions in an order that the messages
of the others never allow, so that every case made of it contradicts itself:

    Receiver, one tour:    r3 r1 r2      r3 wants the wrong bit, but the first frame has the right one: infeasible
    Receiver, short runs:  r1 r2   r1 r2 r3   r3 ...      the second of these can be run, and takes r3

So what is left untaken is tried with short runs, from the initial state back to where a test may end; of the cases that
can be run, those are added that take something new.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from parcours.abtc import AbstractCase, abstract_cases, require_cases, serialise
from parcours.errors import BadModel, BadRequest
from parcours.model.structure import Cefsm, Machine, Transition
from parcours.paths import internal_paths
from parcours.paths.internal import InternalPath
from parcours.study.components.stimuli import Chooser

# Of a machine: most short runs, most transitions in one, and how often a run takes a transition at most
_RUNS, _LONGEST, _TWICE = 12, 8, 2

_TRIED = 3_000  # most cases of short runs that are looked at
_QUEUED = 20_000  # most beginnings of short runs that are followed in one machine

Taken = tuple[str, int, str]  # what a case may be the first to take: interaction path, visit, transition


@dataclass(frozen=True, slots=True)
class Selection:
    """The abstract cases of a study by id, those that cannot be run, with why, and what only those would take."""

    cases: Mapping[str, AbstractCase]
    infeasible: Mapping[str, str]
    untaken: frozenset[tuple[str, str]] = frozenset()  # component and transition


def select_cases(model: Cefsm, criterion: str, policy: str, chooser: Chooser) -> Selection:
    """Return the abstract cases of a model that can run: by a criterion, and by short runs for what that leaves out."""
    paths = internal_paths(model, criterion)
    listed = {case.id: case for case in abstract_cases(model, policy or None, paths=paths)}
    if not listed:
        require_cases(model, model.source, paths)
    reasons = {id: chooser.stimuli(serialise(case), {}).infeasible for id, case in listed.items()}
    cases = {id: case for id, case in listed.items() if not reasons[id]}
    infeasible = {id: why for id, why in reasons.items() if why}
    if infeasible:
        cases |= _short(model, policy, chooser, cases, listed)
    if not cases:
        id, why = next(iter(infeasible.items()))
        rule = f"no values can make any of its {len(infeasible)} abstract cases run; {id}: {why}"
        remedy = "look at the guards that are named: what the others send must be able to meet them"
        raise BadModel(model.source or model.name, rule, remedy, slug="no-feasible-cases")
    return Selection(cases, infeasible, _untaken([listed[id] for id in infeasible], cases.values()))


def _untaken(infeasible: Sequence[AbstractCase], cases: Iterable[AbstractCase]) -> frozenset[tuple[str, str]]:
    """Return component and id of each transition that infeasible cases would take, and no other."""
    if not infeasible:
        return frozenset()
    wanted, taken = (
        {
            (path.component, each.id)
            for case in some
            for _, path in case.combination.references
            for each in path.transitions
        }
        for some in (infeasible, cases)
    )
    return frozenset(wanted - taken)


def _short(
    model: Cefsm, policy: str, chooser: Chooser, cases: Mapping[str, AbstractCase], listed: Mapping[str, AbstractCase]
) -> dict[str, AbstractCase]:
    """Return cases of short runs, of which each takes something that no case before it takes."""
    left = {each for case in listed.values() for each in _taken(case)}
    left -= {each for case in cases.values() for each in _taken(case)}
    paths = {
        component.name: tuple(
            InternalPath(f"tp{c}x{k}", component.name, machine.name, run)
            for k, (machine, run) in enumerate(
                ((machine, run) for machine in component.machines for run in short_runs(machine)), start=1
            )
        )
        for c, component in enumerate(model.components, start=1)
    }
    if not left or not all(paths.values()):
        return {}
    found: dict[str, AbstractCase] = {}
    try:
        candidates = list(islice(abstract_cases(model, policy or None, paths=paths), _TRIED))
    except BadRequest:  # too many combinations to look at
        return {}
    for case in sorted(candidates, key=lambda case: sum(1 for _ in _taken(case))):
        new = left & set(_taken(case))
        if new and not chooser.stimuli(serialise(case), {}).infeasible:
            found[case.id] = case
            left -= new
    return found


def _taken(case: AbstractCase) -> Iterator[Taken]:
    for visit, path in case.combination.references:
        for transition in path.transitions:
            yield case.interaction.name, visit, transition.id


def short_runs(machine: Machine) -> list[tuple[Transition, ...]]:
    """Return the shortest runs of a machine from its initial state to where a test may end, together through all of it.

    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "off"), Transition("t3", "off", "off")))
    >>> [" ".join(t.id for t in run) for run in short_runs(lamp)][:4]
    ['t3', 't1 t2', 't3 t3', 't1 t2 t3']
    """
    leaving: dict[str, list[Transition]] = {}
    for transition in machine.transitions:
        leaving.setdefault(transition.source, []).append(transition)
    ends = set(machine.final) or {machine.initial} | {state for state in machine.states if state not in leaving}
    runs: list[tuple[Transition, ...]] = []
    queue: list[tuple[Transition, ...]] = [()]
    followed = 0
    while queue and len(runs) < _RUNS and followed < _QUEUED:
        run = queue.pop(0)
        followed += 1
        state = run[-1].target if run else machine.initial
        if run and state in ends:
            runs.append(run)
        if len(run) < _LONGEST:
            queue += [(*run, one) for one in leaving.get(state, []) if run.count(one) < _TWICE]
    return runs
