"""A model -> the tables that every symbolic walk through it reads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import z3

from parcours.model.configuration import Layout
from parcours.model.expression import Apply, Assignment, Expression, Field
from parcours.model.structure import CLOCK, Cefsm, Component, Variable
from parcours.paths.solving.terms import Symbols, Value, constant, fits
from parcours.paths.timing.clockwork import is_timed


@dataclass(frozen=True, slots=True)
class Bound:
    """An integer variable never leaves a number on one side.

    >>> print(Bound("n", ">=", 0))
    always n >= 0
    """

    variable: str
    operator: str
    number: int

    def of(self, value: Value) -> Value:
        """Return the condition on the variable's term."""
        return value <= self.number if self.operator == "<=" else value >= self.number

    def __str__(self) -> str:
        return f"always {self.variable} {self.operator} {self.number}"


class Ground:
    """The tables of one model.

    Attributes:
        cefsm: the model.
        layout: what its messages say.
        symbols: the numbers of texts.
        variables: for each component its variables by name.
        assigned: for each component and variable what is assigned to it, with the machine that does so.
        clocks: for each component the names of its clocks.
        timed: whether the model says anything about time.
    """

    def __init__(self, cefsm: Cefsm) -> None:
        self.cefsm, self.symbols, self.layout = cefsm, Symbols(), Layout(cefsm)
        self.variables = {
            component.name: {variable.name: variable for variable in component.variables}
            for component in cefsm.components
        }
        self.assigned = {component.name: dict(_assigned(component)) for component in cefsm.components}
        self.clocks = {
            name: frozenset(each.name for each in found.values() if each.type == CLOCK)
            for name, found in self.variables.items()
        }
        self.timed = any(is_timed(component) for component in cefsm.components)

    def unsteady(self, component: str, machine: str) -> frozenset[str]:
        """Return the variables that other machines of the component may set while this one waits."""
        found = self.assigned[component].items()
        return frozenset(name for name, values in found if any(owner != machine for owner, _ in values))

    def initial(self, variable: Variable, *, exact: bool = True) -> Value:
        """Return the value with which a local variable starts."""
        start = variable.initial
        if variable.type == "real" and isinstance(start, int | float):
            start = float(start)
        return constant(start, self.symbols, exact=exact)

    def within(self, value: Value, variable: Variable) -> Value:
        """Return the condition that a value lies in the domain of its variable, and in 64 bits."""
        domain = variable.domain
        if isinstance(domain, range):
            return z3.And(value >= domain[0], value <= domain[-1])
        if domain:
            return z3.Or([value == constant(each, self.symbols) for each in domain])
        return fits(value) if variable.type == "int" else z3.BoolVal(True)


def _assigned(component: Component) -> Iterator[tuple[str, list[tuple[str, Expression]]]]:
    found: dict[str, list[tuple[str, Expression]]] = {variable.name: [] for variable in component.variables}
    for machine in component.machines:
        for transition in machine.transitions:
            for action in transition.actions:
                if isinstance(action, Assignment) and action.target in found:
                    found[action.target].append((machine.name, action.value))
    yield from found.items()


def path_of(node: Expression) -> list[str]:
    """Return the names that a name, a field or the size of a list is made of, the variable first.

    >>> from parcours.model.expression import parse_expression
    >>> path_of(parse_expression("size(ob.path)"))
    ['ob', 'path']
    """
    if isinstance(node, Apply):
        node = node.arguments[0]
    parts: list[str] = []
    while isinstance(node, Field):
        parts.append(node.name)
        node = node.of
    return [str(node), *reversed(parts)]


def domain_text(variable: Variable) -> str:
    """Return the domain of a variable for people."""
    domain = variable.domain
    if isinstance(domain, range):
        return f"{domain[0]} .. {domain[-1]}"
    return ", ".join(map(str, domain)) or "64 bits"
