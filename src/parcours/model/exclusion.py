"""Can two transitions of a state be enabled together? That a model says they cannot (`exclusive:`) is proved here."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from parcours.model.expression import Expression, Name
from parcours.model.expression.syntax import substitute
from parcours.model.finding import Finding
from parcours.model.scope import Scopes
from parcours.model.solutions import Answer, Budget, Question
from parcours.model.structure import Component, Machine, Transition

MAX_PAIRS = 500
"""Most pairs of transitions compared in one state, or said by one machine to exclude each other."""


def together(scopes: Scopes, component: Component, one: Transition, two: Transition, budget: Budget) -> Answer:
    """Return whether the guards of two transitions of a component can hold together, with values that show it."""
    types = {**scopes.types(component.name, two), **scopes.types(component.name, one)}
    guards = [one.guard] if one.guard is not None else []
    if two.guard is not None:
        name = beside(two, one)
        if name and two.event is not None:
            types[name] = scopes.types(component.name, two)[two.event.name]
        guards.append(renamed(two.guard, two, name))
    return Question(types, scopes.classes, scopes.domains(component.name)).witness(guards, budget)


def beside(two: Transition, one: Transition) -> str:
    """Return what the message of `two` is called beside `one`: as there if it is the same; empty if it has no name."""
    if two.event is None or not two.event.name:
        return ""
    if one.event is None or not one.event.name:
        return two.event.name
    if one.event.channel == two.event.channel:
        return one.event.name
    return two.event.name if two.event.name != one.event.name else f"{two.event.name} of {two.id}"


def renamed(guard: Expression, owner: Transition, name: str) -> Expression:
    """Return a guard with its message called by another name; as it is if the message has none."""
    if owner.event is None or not name or name == owner.event.name:
        return guard
    old = Name(owner.event.name)
    return substitute(guard, lambda part: Name(name) if part == old else None)


def pairs(machine: Machine) -> Iterator[tuple[Transition, Transition]]:
    """Yield the pairs of transitions that a machine says exclude each other, each once, unknown names left out."""
    place = {each.id: at for at, each in enumerate(machine.transitions)}
    groups = ([place[id] for id in group if id in place] for group in machine.exclusive)
    found = dict.fromkeys((min(pair), max(pair)) for group in groups for pair in combinations(set(group), 2))
    for one, two in sorted(found):
        yield machine.transitions[one], machine.transitions[two]


def excluded(component: Component) -> Iterator[tuple[Transition, Transition, Expression]]:
    """Yield (transition, one that it excludes, the guard of that as it reads the message of the former)."""
    for machine in component.machines:
        for pair in pairs(machine):
            for one, two in (pair, pair[::-1]):
                if two.guard is not None:
                    yield one, two, renamed(two.guard, two, beside(two, one))


def exclusion_findings(scopes: Scopes, component: Component, machine: Machine, origin: str,
                       budget: Budget) -> Iterator[Finding]:  # fmt: skip
    """Yield where transitions that supposedly exclude each other need not, and what cannot be decided.

    The guards of the machine must be well typed.
    """
    for one, two in pairs(machine):
        answer = together(scopes, component, one, two, budget)
        both = f"{one.id!r} and {two.id!r}"
        if answer.holds:
            example = f": when {answer}" if answer.values else ": neither has one that could fail"
            rule = f"{both} of {machine.name!r} must exclude each other, but their guards hold together{example}"
            remedy = "correct the guards, or take the pair out of `exclusive`"
            yield Finding(origin, two.line or one.line, "error", "not-exclusive", rule, remedy)
        elif answer.holds is None:
            rule = (
                f"could not decide whether {both} exclude each other, as {machine.name!r} says; traces are judged by it"
            )
            remedy = "compare each variable with constants only"
            yield Finding(origin, two.line or one.line, "warning", "undecided-exclusion", rule, remedy)
