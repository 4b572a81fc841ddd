"""What the model says about the times of events: order, durations, guards, invariants.

Time starts at 0 s with every machine in its initial state and every clock at 0. A `duration` runs from the event
by which the machine entered the source state. A receive of a rendezvous happens when its send does. An invariant
holds from entering a state until leaving it; as it bounds clocks that grow together, it is enough to look at the
events where they are set or the state is left.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import inf

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Expression, evaluate, names
from parcours.model.structure import CLOCK, Cefsm, Component, Transition
from parcours.paths.timing.clocks import ClockConstraint, NoBound, Setting, decimal
from parcours.paths.timing.events import Place, TimedEvent
from parcours.paths.timing.network import TimeLimit

Facts = tuple[list[TimeLimit], list[ClockConstraint]]
"""Bounds on the times of events, and conditions over clocks at them."""


def is_timed(component: Component) -> bool:
    """Return whether a component says anything about time."""
    return (
        any(variable.type == CLOCK for variable in component.variables)
        or any(machine.invariants for machine in component.machines)
        or any(transition.duration is not None for transition in component.transitions())
    )


class Clockwork:
    """The clocks of a model while events happen."""

    def __init__(self, cefsm: Cefsm, places: Sequence[Place], stands: Mapping[Place, str] | None = None) -> None:
        components = {component.name: component for component in cefsm.components}
        self._initial: dict[str, dict[str, Setting]] = {
            name: {each.name: (0, Fraction(0)) for each in component.variables if each.type == CLOCK}
            for name, component in components.items()
        }
        self._clocks = {place[:2]: dict(self._initial[place[1]]) for place in places}
        self._entered = dict.fromkeys(places, 0)
        self._invariants: dict[Place, dict[str, list[Expression]]] = {}
        self._stands: dict[Place, str] = {}
        for place in places:
            machine = next(each for each in components[place[1]].machines if each.name == place[2])
            self._stands[place] = (stands or {}).get(place, machine.initial)
            self._invariants[place] = {}
            for state, condition in machine.invariants:
                self._invariants[place].setdefault(state, []).append(condition)

    def copy(self) -> Clockwork:
        """Return a clockwork that goes on from here by itself."""
        twin = object.__new__(Clockwork)
        twin._initial, twin._invariants = self._initial, self._invariants
        twin._clocks = {key: dict(clocks) for key, clocks in self._clocks.items()}
        twin._entered, twin._stands = dict(self._entered), dict(self._stands)
        return twin

    def clocks(self, event: TimedEvent) -> dict[str, Setting]:
        """Return how the clocks that an event reads were last set."""
        return self._clocks[event.instance, event.component]

    def begin(self) -> Facts:
        """Return what holds at the start."""
        return [], [found for place in self._stands for found in self._watch(place, 0)]

    def advance(self, event: TimedEvent) -> Facts:
        """Let an event happen, and return what it says about its time and earlier ones.

        Raises NoBound: a clock is set to something else than a number, 0 or more.
        """
        transition, now, place = event.transition, event.number, event.place
        before = self._entered[place]
        limits = [TimeLimit(now, now - 1, Fraction(0), why=f"{event} comes after step {now - 1}")] if now > 1 else []
        if transition.duration is not None:
            least, most = transition.duration
            if least == inf:
                raise NoBound(f"{event} never ends")
            limits.append(TimeLimit(now, before, -decimal(least), why=f"{event} takes at least {least:g} s"))
            if most < inf:
                limits.append(TimeLimit(before, now, decimal(most), why=f"{event} takes at most {most:g} s"))
        if event.meets:
            limits.append(TimeLimit(event.send, now, Fraction(0), why=f"{event} meets step {event.send}"))
        conditions: list[ClockConstraint] = []
        clocks = self._clocks[event.instance, event.component]
        if transition.guard is not None and not names(transition.guard).isdisjoint(clocks):
            why = f"guard of {event}: {transition.guard}{set_when(transition.guard, clocks)}"
            conditions.append(ClockConstraint(transition.guard, now, dict(clocks), why, now))
        settings = dict(settings_of(transition, clocks))
        moved = [each for each in self._stands if each[:2] == place[:2]]
        conditions += (found for each in moved for found in self._watch(each, now, settings if each != place else None))
        clocks.update({name: (now, value) for name, value in settings.items()})
        self._stands[place], self._entered[place] = transition.target, now
        conditions += (found for each in moved for found in self._watch(each, now, settings if each != place else None))
        return limits, conditions

    def finish(self, now: int) -> Facts:
        """Return what holds at the last event for the machines that stand still by then."""
        return [], [found for place in self._stands for found in self._watch(place, now)]

    def _watch(self, place: Place, now: int, settings: dict[str, Fraction] | None = None) -> Iterator[ClockConstraint]:
        # The invariants of the state where a machine stands; only those that read the clocks being set, if given.
        for condition in self._invariants[place].get(self._stands[place], ()):
            if settings is None or not names(condition).isdisjoint(settings):
                clocks = dict(self._clocks[place[:2]])
                why = f"invariant of {self._stands[place]!r}: {condition}{set_when(condition, clocks)}"
                yield ClockConstraint(condition, now, clocks, why)


def set_when(condition: Expression, clocks: Mapping[str, Setting]) -> str:
    """Return where the clocks that a condition reads were set, for people; empty if at the start."""
    said = [f"{name} set in step {clocks[name][0]}" for name in sorted(names(condition)) if clocks.get(name, (0,))[0]]
    return f" ({', '.join(said)})" if said else ""


def settings_of(transition: Transition, clocks: Mapping[str, Setting]) -> Iterator[tuple[str, Fraction]]:
    """Yield the clocks that a transition sets, and to what [s]. Raises NoBound: that is no number, 0 or more."""
    for action in transition.actions:
        if isinstance(action, Assignment) and action.target in clocks:
            try:
                value = evaluate(action.value, {})
            except BadModel:
                value = None
            if not isinstance(value, int | float) or isinstance(value, bool) or value < 0:
                raise NoBound(f"action of {transition.id!r}: {action} sets a clock to what is no number, 0 or more")
            yield action.target, decimal(value)
