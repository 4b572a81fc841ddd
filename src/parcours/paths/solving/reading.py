"""What the events of a symbolic walk read: tables of the model, values of variables, symbols for what is open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import z3

from parcours.model.configuration import Layout
from parcours.model.expression import Apply, Assignment, Expression, FieldAccess, Name, Type, names, type_of
from parcours.model.scope import is_local, variable_type
from parcours.model.structure import CLOCK, Cefsm, Component, Variable
from parcours.paths.solving.terms import Symbols, Translator, Value, constant, fits, rational, variable
from parcours.paths.timing.clocks import Setting
from parcours.paths.timing.events import TimedEvent
from parcours.paths.timing.time_constraints import Clockwork, is_timed


@dataclass(frozen=True, slots=True)
class IntegerBound:
    """An integer variable never leaves a number on one side."""

    variable: str
    operator: str
    number: int

    def of(self, value: Value) -> Value:
        """Return the condition on the variable's term."""
        return value <= self.number if self.operator == "<=" else value >= self.number

    def __str__(self) -> str:
        return f"always {self.variable} {self.operator} {self.number}"


class ModelTables:
    """The tables of one model."""

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

    def initial(self, declared: Variable, *, exact: bool = True) -> Value:
        """Return the value with which a local variable starts."""
        start = declared.initial
        if declared.type == "real" and isinstance(start, int | float):
            start = float(start)
        return constant(start, self.symbols, exact=exact)

    def within(self, value: Value, declared: Variable) -> Value:
        """Return the condition that a value lies in the domain of its variable, and in 64 bits."""
        domain = declared.domain
        if isinstance(domain, range):
            return z3.And(value >= domain[0], value <= domain[-1])
        if domain:
            return z3.Or([value == constant(each, self.symbols) for each in domain])
        return fits(value) if declared.type == "int" else z3.BoolVal(True)


def _assigned(component: Component) -> Iterator[tuple[str, list[tuple[str, Expression]]]]:
    found: dict[str, list[tuple[str, Expression]]] = {variable.name: [] for variable in component.variables}
    for machine in component.machines:
        for transition in machine.transitions:
            for action in transition.actions:
                if isinstance(action, Assignment) and action.target in found:
                    found[action.target].append((machine.name, action.value))
    yield from found.items()


def path_of(node: Expression) -> list[str]:
    """Return the names that a name, a field or the size of a list is made of, the variable first."""
    if isinstance(node, Apply):
        node = node.arguments[0]
    parts: list[str] = []
    while isinstance(node, FieldAccess):
        parts.append(node.name)
        node = node.of
    return [str(node), *reversed(parts)]


def domain_text(declared: Variable) -> str:
    """Return the domain of a variable for people."""
    domain = declared.domain
    if isinstance(domain, range):
        return f"{domain[0]} .. {domain[-1]}"
    return ", ".join(map(str, domain)) or "64 bits"


Slot = tuple[int, str, str]
"""A variable: the instance of its component, the component and the variable."""

Begin = Literal["initial", "anywhere"]
"""Where a walk begins: as the model does, or in any state with any values that its variables may ever have."""


@dataclass(slots=True)
class Snapshot:
    """What stands after an event: a copy for each, so that taking one back costs nothing.

    Attributes:
        values: the terms of variables; those not looked at yet are missing.
        messages: what the messages say that a later event takes, by event number and channel.
        clockwork: the clocks, where there are any.
        event: what happened last.
        opens: the symbols of what was open at it, with their types, as 'Component.term'.
        clocks: how the clocks that it read had been set.
        rounds: whether floating point may round something in it.
    """

    values: dict[Slot, Value]
    messages: dict[tuple[int, str], Mapping[str, Value]]
    clockwork: Clockwork | None = None
    event: TimedEvent | None = None
    opens: dict[str, tuple[Value, Type]] = field(default_factory=dict)
    clocks: dict[str, Setting] = field(default_factory=dict)
    rounds: bool = False

    def following(self, event: TimedEvent) -> Snapshot:
        """Return the level that an event starts from."""
        clockwork = None if self.clockwork is None else self.clockwork.copy()
        return Snapshot(dict(self.values), dict(self.messages), clockwork, event)


@dataclass(slots=True)
class WalkReading:
    """How one walk reads.

    Attributes:
        ground: the tables of the model.
        begin: where the walk begins.
        exact: how reals are taken, as `parcours.paths.solving.terms` explains.
        unsteady: variables that others may set at any time.
        bounds: what is known of variables that do not begin as the model says, or are unsteady.
        add: takes a fact.
        demand: takes a condition and what demands it.
    """

    ground: ModelTables
    begin: Begin
    exact: bool
    unsteady: frozenset[str]
    bounds: frozenset[IntegerBound]
    add: Callable[[Value], None]
    demand: Callable[[Value, str], None]
    _count: int = 0

    def fresh(self) -> str:
        """Return a name that no symbol of the walk has."""
        self._count += 1
        return f"v{self._count}"

    def translator(self, event: TimedEvent, level: Snapshot) -> Translator:
        """Return what translates the expressions of an event, as it is reached."""
        scopes, transition = self.ground.layout.scopes, event.transition
        types = scopes.types(event.component, transition)
        message = transition.event.name if transition.event is not None else ""
        taken = level.messages.get((event.send, transition.event.channel), {}) if transition.event is not None else {}

        def lookup(node: Expression, type_: Type) -> Value:
            name, *fields = path_of(node)
            if name in level.clocks:
                return self.clock(event, name, event.number, level.clocks[name])
            if name == message and isinstance(node, FieldAccess) and len(fields) == 1 and fields[0] in taken:
                return taken[fields[0]]
            declared = self.ground.variables[event.component].get(name)
            if name == message or not isinstance(node, Name):
                declared = None
            if declared is not None and is_local(declared) and name not in self.unsteady:
                slot = (event.instance, event.component, declared.name)
                if slot not in level.values:
                    level.values[slot] = self._first(event, declared)
                return level.values[slot]
            return self._open(event, node, type_, declared, level)

        def types_of(node: Expression) -> Type:
            return type_of(node, types, scopes.classes)

        return Translator(types_of, lookup, self.ground.symbols, level.clocks, self.fresh, exact=self.exact)

    def clock(self, event: TimedEvent, name: str, now: int, setting: Setting) -> Value:
        """Return what a clock of the event's component reads at the time of event `now`."""
        if name in self.unsteady:
            reading = z3.Real(f"clock:{now}:{name}")
            self.add(reading >= 0)
            return reading
        since, value = setting
        if since == 0 and self.begin != "initial":
            before = z3.Real(f"clock:{name}")
            self.add(before >= 0)
            return time_of(now) + before
        return time_of(now) - time_of(since) + rational(value)

    def _first(self, event: TimedEvent, declared: Variable) -> Value:
        start = self.ground.initial(declared, exact=self.exact)
        if self.begin == "initial":
            return start
        # Anywhere: a variable that only constants are assigned to has one of them, or its initial value.
        type_ = variable_type(declared)
        symbol = variable(f"{event.component}.{declared.name}", type_)
        self._bound(symbol, declared.name)
        values = [value for _, value in self.ground.assigned[event.component][declared.name]]
        if any(names(value) for value in values):
            self.demand(self.ground.within(symbol, declared), f"range of {declared.name!r}: {domain_text(declared)}")
            return symbol
        scopes = self.ground.layout.scopes
        reader = Translator(
            lambda node: type_of(node, {}, scopes.classes), lambda node, type_: symbol,
            self.ground.symbols, {}, self.fresh, exact=self.exact,
        )  # fmt: skip
        terms = [start, *(reader.stored(reader.term(value).value, type_) for value in values)]
        for side in reader.sides:
            self.add(side)
        shown = declared.initial if not isinstance(declared.initial, bool) else str(declared.initial).lower()
        texts = dict.fromkeys(map(str, [repr(shown) if declared.type in ("text", "enum") else shown, *values]))
        self.demand(z3.Or([symbol == term for term in terms]), f"{declared.name!r} is only ever {', '.join(texts)}")
        return symbol

    def _bound(self, symbol: Value, name: str) -> None:
        for bound in sorted(self.bounds, key=str):
            if bound.variable == name:
                self.demand(bound.of(symbol), str(bound))

    def _open(
        self, event: TimedEvent, node: Expression, type_: Type, declared: Variable | None, level: Snapshot
    ) -> Value:
        inner = ".".join(path_of(node))
        sized = isinstance(node, Apply)
        term = f"{event.component}.size({inner})" if sized else f"{event.component}.{inner}"
        if term not in level.opens:
            symbol = variable(f"{event.number}:{event.instance}:{term}", type_)
            level.opens[term] = (symbol, type_)
            if sized:
                self.add(symbol >= 0)
            if declared is not None:
                self.add(self.ground.within(symbol, declared))
                self._bound(symbol, declared.name)
            elif type_.name == "int":
                self.add(fits(symbol))
        return level.opens[term][0]


def time_of(event: int) -> Value:
    """Return the time of an event; the start is at 0 s."""
    return z3.Real(f"t{event}") if event else z3.RealVal(0)
