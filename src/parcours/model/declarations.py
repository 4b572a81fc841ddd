"""Checks what a model declares: variables with their types and domains; and time: clocks, durations, invariants."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from parcours.errors import BadModel
from parcours.model.expression import BOOL, Assignment, Expression, Literal, names, type_of
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.finding import Finding, advice
from parcours.model.scope import Scopes
from parcours.model.structure import BASE_TYPES, CLOCK, Cefsm, Component, Machine, Transition, Variable


def temporal_findings(cefsm: Cefsm, origin: str) -> Iterator[Finding]:
    """Yield the errors in what a model says about time."""
    check = _Check(cefsm, origin)
    for component in cefsm.components:
        yield from check.clocks(component)
        for machine in component.machines:
            yield from check.machine(component, machine)
            for transition in machine.transitions:
                yield from check.transition(component, transition)


class _Check:
    def __init__(self, cefsm: Cefsm, origin: str) -> None:
        self.origin, self.scopes = origin, Scopes(cefsm)

    def error(self, line: int, slug: str, rule: str, remedy: str = "") -> Finding:
        return Finding(self.origin, line, "error", slug, rule, remedy)

    def clocks(self, component: Component) -> Iterator[Finding]:
        for clock in component.variables:
            what = f"clock '{component.name}.{clock.name}'"
            if clock.type == CLOCK and (clock.role != "local" or clock.initial is not None or clock.domain):
                rule = f"{what} starts at 0 s and goes by itself, but has a role, an initial value or a domain"
                yield self.error(clock.line, "clock", rule, "declare it as {type: clock}")

    def machine(self, component: Component, machine: Machine) -> Iterator[Finding]:
        for state in dict.fromkeys([*machine.final, *(state for state, _ in (*machine.invariants, *machine.tags))]):
            if state not in machine.states:
                rule = f"{state!r} must be a state of {machine.name!r}, but is not among its states"
                yield self.error(machine.line, "unknown-state", rule, advice(state, machine.states, ()))
        for state, condition in machine.invariants:
            yield from self.invariant(component, machine, state, condition)

    def invariant(self, component: Component, machine: Machine, state: str, condition: Expression) -> Iterator[Finding]:
        where = f"invariant of {state!r}"
        clocks = {variable.name for variable in component.variables if variable.type == CLOCK}
        if foreign := sorted(names(condition) - clocks):
            rule = f"{where}: an invariant reads clocks and constants only, but this one reads {', '.join(foreign)}"
            yield self.error(machine.line, "invariant", rule, "say it in the guards of the transitions that enter")
            return
        try:
            given = type_of(condition, self.scopes.types(component.name), self.scopes.classes, where)
        except BadModel as error:
            yield self.error(machine.line, error.slug, f"{where}: {error.rule}", error.remedy)
            return
        if given != BOOL:
            yield self.error(machine.line, "type", f'{where}: it must be bool, but "{condition}" is {given}')

    def transition(self, component: Component, transition: Transition) -> Iterator[Finding]:
        if transition.duration is not None:
            least, most = transition.duration
            if not 0 <= least <= most or math.isinf(least):
                rule = f"the duration of {transition.id!r} must be [least, most] with 0 <= least <= most"
                yield self.error(transition.line, "duration", f"{rule}, but is [{least}, {most}] s")
        if not 0 <= transition.weight < math.inf:
            rule = f"the weight of {transition.id!r} must be 0 or more, but is {transition.weight}"
            yield self.error(transition.line, "value", rule)
        clocks = {variable.name for variable in component.variables if variable.type == CLOCK}
        for action in transition.actions:
            if isinstance(action, Assignment) and action.target in clocks:
                if not _is_instant(action.value):
                    rule = f"a clock is set to a number of 0 or more, but {transition.id!r} does {str(action)!r}"
                    yield self.error(transition.line, "clock", rule, f"write {action.target} := 0")
                continue
            said = (action.value,) if isinstance(action, Assignment) else action.arguments
            yield from self.unread(transition, clocks, said)
        for send in transition.sends:
            yield from self.unread(transition, clocks, send.payload)

    def unread(self, transition: Transition, clocks: set[str], said: tuple[Expression, ...]) -> Iterator[Finding]:
        for clock in sorted(clocks & {name for value in said for name in names(value)}):
            rule = f"only guards and invariants read a clock, but an action or message of {transition.id!r} reads"
            yield self.error(transition.line, "clock", f"{rule} {clock!r}", "compare it in a guard")


def _is_instant(value: Expression) -> bool:
    number = value.value if isinstance(value, Literal) else None
    return isinstance(number, int | float) and not isinstance(number, bool) and 0 <= number < math.inf


def variable_findings(owner: str, variable: Variable, classes: Sequence[str], origin: str) -> Iterator[Finding]:
    """Yield the errors in the declaration of a variable."""

    def error(slug: str, rule: str, remedy: str = "") -> Finding:
        return Finding(origin, variable.line, "error", slug, f"{what} {rule}", remedy)

    what = f"variable '{owner}.{variable.name}'"
    known = [*BASE_TYPES, CLOCK, *classes]
    if variable.type == CLOCK:
        return
    if variable.type not in known:
        rule = f"must have a base type or a message class, but is {variable.type!r}"
        yield error("unknown-message", rule, advice(variable.type, known, ()))
    elif variable.type not in BASE_TYPES:
        if variable.initial is not None:
            rule = f"is a message, which has no initial value, but has {variable.initial!r}"
            yield error("initial", rule, "delete it")
    elif variable.type == "enum" and len(set(variable.domain)) != max(len(variable.domain), 1):
        yield error("value", f"must list one or more different 'values', but has {list(variable.domain)!r}")
    elif variable.initial is None:
        if variable.role == "local":
            yield error("initial", "must have an initial value, but has none", "add it")
    elif not _fits(variable):
        allowed = f"one of {list(variable.domain)}" if variable.type == "enum" else f"of type {variable.type}"
        if isinstance(variable.domain, range):
            allowed = f"an integer from {variable.domain[0]} to {variable.domain[-1]}"
        yield error("initial", f"must have an initial value that is {allowed}, but has {variable.initial!r}")


def _fits(variable: Variable) -> bool:
    value = variable.initial
    if variable.domain and value not in variable.domain:
        return False
    kinds: dict[str, tuple[type, ...]] = {"bool": (bool,), "int": (int,), "real": (int, float)}
    right = isinstance(value, kinds.get(variable.type, (str,)))
    if isinstance(value, bool):
        return right and variable.type == "bool"
    return right and (not isinstance(value, int | float) or abs(value) <= _LARGEST[variable.type])


_LARGEST = {"int": float(INTEGER_LIMIT), "real": 1.7976931348623157e308}
