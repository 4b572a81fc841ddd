"""The integer variables of a component -> bounds that they never leave, whatever happens.

Bounds are guessed: a variable stays above, or below, its initial value or one of the constants in the component.
Guesses that some transition breaks, while all the others hold, are given up until none is broken (Flanagan &
Leino, Houdini, an annotation assistant for ESC/Java, FME 2001). What is left holds at the start and after each
transition of any machine: always.
"""

from __future__ import annotations

import time

import z3

from parcours.model.expression import Assignment, Expression, Literal
from parcours.model.expression.syntax import walk
from parcours.model.scope import is_local
from parcours.model.structure import Component
from parcours.paths.solving.ground import Bound, Ground
from parcours.paths.solving.terms import NoTerm
from parcours.paths.solving.walk import Walk
from parcours.paths.timing.events import Event

MAX_CONSTANTS = 12
"""Most constants that are guessed as bounds, the smallest in size."""

CHECK_SECONDS = 0.5
"""Longest time for one question to the solver [s]; what is not known by then is given up."""


def bounds_of(ground: Ground, component: Component, deadline: float) -> frozenset[Bound]:
    """Return bounds on the integer variables of a component; none if the time is up before they are sure.

    Args:
        ground: the tables of the model.
        component: the component.
        deadline: when to stop, on `time.monotonic`.
    """
    alive = _guesses(component)
    guessed = {bound.variable for bound in alive}
    setters = [
        (machine.name, transition)
        for machine in component.machines
        for transition in machine.transitions
        if any(isinstance(each, Assignment) and each.target in guessed for each in transition.actions)
    ]
    before: set[Bound] | None = None
    while alive != before:
        before = set(alive)
        for machine, transition in setters:
            if time.monotonic() > deadline:
                return frozenset()
            alive = _kept(ground, Event(1, 0, component.name, machine, transition), alive)
    return frozenset(alive)


def _guesses(component: Component) -> set[Bound]:
    numbers = {0}
    for expression in _expressions(component):
        numbers |= {node.value for node in walk(expression) if isinstance(node, Literal) and type(node.value) is int}
    found = set()
    for variable in component.variables:
        if variable.type == "int" and is_local(variable) and isinstance(variable.initial, int):
            for number in sorted({*numbers, variable.initial}, key=abs)[:MAX_CONSTANTS]:
                found |= {Bound(variable.name, "<=", number)} if variable.initial <= number else set()
                found |= {Bound(variable.name, ">=", number)} if variable.initial >= number else set()
    return found


def _expressions(component: Component) -> list[Expression]:
    found = [each.guard for each in component.transitions() if each.guard is not None]
    return found + [
        action.value for each in component.transitions() for action in each.actions if isinstance(action, Assignment)
    ]


def _kept(ground: Ground, event: Event, alive: set[Bound]) -> set[Bound]:
    """Return the bounds that still hold after an event before which all of them did."""
    steps = Walk(ground, [event.place], begin="anywhere", bounds=frozenset(alive))
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
        and (steps.rounds or steps.check(CHECK_SECONDS, z3.Not(bound.of(values[bound.variable]))) is not False)
    }
    return alive - broken
