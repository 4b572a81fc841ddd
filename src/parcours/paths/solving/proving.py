"""Proofs that no run can meet a requirement, by a search backwards from it, and bounds that variables never leave.

The transitions of the requirement are taken from anywhere: any values the variables may ever have, whatever other
machines do. If that is impossible, what conflicts is the proof. Otherwise every transition that can come before is
put in front, again and again; one that neither sets nor tests what the rest reads is passed over. If all ways back
come to a conflict, the requirement is infeasible. What was passed over only allows more, so a proof stays one.
Where time counts, it is left out at first, so that clocks read anything: that too only allows more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import z3

from parcours.model.expression import Assignment, Literal, names
from parcours.model.expression.syntax import walk
from parcours.model.scope import is_local
from parcours.model.structure import Component, Machine, Transition
from parcours.paths.criteria.requirement import START, CoverageRequirement
from parcours.paths.solving.reading import Begin, IntegerBound, ModelTables
from parcours.paths.solving.terms import NoTerm
from parcours.paths.solving.verdicts import Work
from parcours.paths.solving.walk import SymbolicWalk
from parcours.paths.timing.events import TimedEvent

MAX_CONSTANTS = 12
"""Most constants that are guessed as bounds, the smallest in size."""

BOUND_WORK = 500
"""Most work for one question about a bound; what is not known by then is given up."""

CHECK_WORK = 1000
"""Most work for one question to the solver."""

Slice = tuple[str, ...]
"""Transitions in order, between which others may have been passed over."""


class Prover:
    """Searches backwards from a requirement for a conflict on every way to it."""

    def __init__(
        self,
        ground: ModelTables,
        component: Component,
        machine: Machine,
        seed: int,
        bounds: frozenset[IntegerBound],
        work: Work,
    ) -> None:
        self._work = work
        self._bounds, self._unsteady = bounds, ground.unsteady(component.name, machine.name)
        self._ground, self._component, self._machine, self._seed = ground, component, machine, seed
        self._transitions = {transition.id: transition for transition in machine.transitions}
        self._clocks = ground.clocks[component.name]
        self._entering: dict[str, list[Transition]] = {}
        for transition in machine.transitions:
            self._entering.setdefault(transition.target, []).append(transition)

    def proof(self, need: CoverageRequirement, until: float, ways: int) -> tuple[str, ...] | None:
        """Return what conflicts on every way to a requirement, or None if no proof was found."""
        if self._ground.timed:
            now = self._work.spent
            found = self._proof(need, now + max(0.0, until - now) / 2, ways, timed=False)
            if found is not None:
                return found
        return self._proof(need, until, ways, timed=self._ground.timed)

    def _proof(self, need: CoverageRequirement, until: float, ways: int, *, timed: bool) -> tuple[str, ...] | None:
        ahead: list[tuple[str, Slice]]
        if need.kind == "state":
            if need.steps[0] == self._machine.initial:
                return None
            ahead = [(transition.source, (transition.id,)) for transition in self._entering.get(need.steps[0], ())]
        elif need.steps[0] == START:
            conflict = self._conflict(need.steps[1:], "initial", timed=timed)
            return None if conflict is None else (*self._starts(need.steps[1:]), *conflict)
        else:
            ahead = [(self._transitions[need.steps[0]].source, need.steps)]
        seen, reasons = set(ahead), dict[str, None]()
        for state, slice_ in ahead:
            if len(seen) > ways or self._work.spent > until:
                return None
            conflict = self._conflict(slice_, "anywhere", timed=timed)
            if conflict is None and state == self._machine.initial:
                conflict = self._conflict(slice_, "initial", timed=timed)
                if conflict is None:
                    return None  # a run may begin so, as far as this shows
                reasons |= dict.fromkeys(self._starts(slice_))
                reasons |= dict.fromkeys(conflict)
                conflict = None
            if conflict is not None:
                reasons |= dict.fromkeys(conflict)
                continue
            for before in self._before(state, slice_, timed=timed):
                if before not in seen:
                    seen.add(before)
                    ahead.append(before)
        return tuple(reasons)

    def _before(self, state: str, slice_: Slice, *, timed: bool) -> Iterator[tuple[str, Slice]]:
        read = self._read(slice_) - (frozenset() if timed else self._clocks)
        for transition in self._entering.get(state, ()):
            sets = {action.target for action in transition.actions if isinstance(action, Assignment)}
            tests = names(transition.guard) if transition.guard is not None else frozenset[str]()
            # A test is put in front only once: a loop of tests would otherwise never end.
            tells = not sets.isdisjoint(read) or (transition.id not in slice_ and not tests.isdisjoint(read))
            # Time passes on every transition, so none is passed over where it counts.
            yield transition.source, slice_ if not tells and not timed else (transition.id, *slice_)

    def _conflict(self, ids: Slice, begin: Begin, *, timed: bool) -> tuple[str, ...] | None:
        """Return what makes the transitions impossible, in real and in rounded arithmetic; None if nothing does."""
        unsteady = self._unsteady if timed else self._unsteady | self._clocks
        for exact in (True, False):
            place = (0, self._component.name, self._machine.name)
            steps = SymbolicWalk(
                self._ground, [place], exact=exact, explain=True, begin=begin,
                unsteady=unsteady, bounds=self._bounds, timed=timed, seed=self._seed, work=self._work,
            )  # fmt: skip
            try:
                for number, id in enumerate(ids, start=1):
                    steps.push(TimedEvent(number, *place, self._transitions[id]))
            except NoTerm:
                return None
            if steps.check(CHECK_WORK) is not False:
                return None
            if not steps.rounds:
                break
        return steps.core()

    def _read(self, slice_: Sequence[str]) -> frozenset[str]:
        found: set[str] = set()
        for id in slice_:
            transition = self._transitions[id]
            found |= names(transition.guard) if transition.guard is not None else set()
            for action in transition.actions:
                if isinstance(action, Assignment):
                    found |= names(action.value)
        return frozenset(found)

    def _starts(self, slice_: Slice) -> Iterator[str]:
        read = self._read(slice_)
        for variable in self._component.variables:
            if variable.name in read and variable.initial is not None:
                shown = str(variable.initial).lower() if isinstance(variable.initial, bool) else variable.initial
                yield f"{variable.name!r} starts at {shown}"


def bounds_of(ground: ModelTables, component: Component, work: Work, until: float) -> frozenset[IntegerBound]:
    """Return bounds that the integer variables of a component never leave; none if the work ends before they are sure.

    Bounds are guessed: a variable stays above, or below, its initial value or one of the constants in the component.
    Guesses that some transition breaks, while all the others hold, are given up until none is broken (Flanagan &
    Leino, Houdini, an annotation assistant for ESC/Java, FME 2001). What is left holds at the start and after each
    transition of any machine: always.
    """
    alive = _guesses(component)
    guessed = {bound.variable for bound in alive}
    setters = [
        (machine.name, transition)
        for machine in component.machines
        for transition in machine.transitions
        if any(isinstance(each, Assignment) and each.target in guessed for each in transition.actions)
    ]
    before: set[IntegerBound] | None = None
    while alive != before:
        before = set(alive)
        for machine, transition in setters:
            if work.spent > until:
                return frozenset()
            alive = _kept(ground, TimedEvent(1, 0, component.name, machine, transition), alive, work)
    return frozenset(alive)


def _guesses(component: Component) -> set[IntegerBound]:
    numbers = {0}
    said = [each.guard for each in component.transitions() if each.guard is not None]
    actions = (action for each in component.transitions() for action in each.actions)
    for expression in (*said, *(action.value for action in actions if isinstance(action, Assignment))):
        numbers |= {node.value for node in walk(expression) if isinstance(node, Literal) and type(node.value) is int}
    found = set()
    for variable in component.variables:
        if variable.type == "int" and is_local(variable) and isinstance(variable.initial, int):
            for number in sorted({*numbers, variable.initial}, key=abs)[:MAX_CONSTANTS]:
                found |= {IntegerBound(variable.name, "<=", number)} if variable.initial <= number else set()
                found |= {IntegerBound(variable.name, ">=", number)} if variable.initial >= number else set()
    return found


def _kept(ground: ModelTables, event: TimedEvent, alive: set[IntegerBound], work: Work) -> set[IntegerBound]:
    """Return the bounds that still hold after an event before which all of them did."""
    steps = SymbolicWalk(ground, [event.place], begin="anywhere", bounds=frozenset(alive), work=work)
    try:
        steps.push(event)
    except NoTerm:
        sets = {action.target for action in event.transition.actions if isinstance(action, Assignment)}
        return {bound for bound in alive if bound.variable not in sets}
    values = steps.values(event)
    broken = {
        bound
        for bound in alive
        if bound.variable in values
        and (steps.rounds or steps.check(BOUND_WORK, z3.Not(bound.of(values[bound.variable]))) is not False)
    }
    return alive - broken
