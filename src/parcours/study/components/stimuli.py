"""Chooses what the tester gives in a case: the environment's messages, and values of input variables.

The case is followed with symbols in the place of what is open: each field of a message that the environment sends, each
input variable at each event. What the references send each other follows from the model's payloads, so a guard anywhere
becomes a condition on what the tester chooses. Together these conditions are solved; what the guards leave open takes
the value of the test input of the same name, or a default:

    call(it) --p1--> request(it) --c1 [it.floor != floor]-->      becomes      m0__floor != 0

A case whose conditions contradict each other cannot be run by any component that keeps to the model: it is infeasible.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias, Union, cast

from parcours.abtc import Event, Reception
from parcours.errors import BadModel, BadRequest
from parcours.model.expression import (
    Apply,
    Assignment,
    Binary,
    Expression,
    FieldAccess,
    Literal,
    Name,
    Unary,
    evaluate,
)  # fmt: skip
from parcours.model.scope import Scopes, is_local, variable_type
from parcours.model.structure import BASE_TYPES, Cefsm, Send, Transition
from parcours.study.components.conditions import Conditions, solved
from parcours.study.components.messages import ModelMessages, Plain

# Channel or transition -> field or input variable -> formula over test inputs and parameters
Formulas = Mapping[str, Mapping[str, Expression]]

Symbolic: TypeAlias = Union[Expression, "Record"]
Record: TypeAlias = dict[str, Symbolic]  # A message: what is known of its fields


@dataclass(frozen=True, slots=True)
class Stimulus:
    """What one event is given: the environment's message, if it receives one, and input variables to set before it."""

    message: Plain = None
    inputs: Mapping[str, object] = field(default_factory=dict)
    stray: Plain = None  # a message that comes before, on the same channel, and that the model does not let it take


@dataclass(frozen=True, slots=True)
class Stimuli:
    """The stimuli of a case by the position of the event; or why no values can make it run."""

    of: Mapping[int, Stimulus]
    infeasible: str = ""


class _Unknown(Exception):
    """An expression reads something of which the model says nothing."""


class Chooser:
    """Chooses the stimuli of a model's cases."""

    def __init__(
        self, cefsm: Cefsm, messages: ModelMessages, supply: Formulas, inputs: Formulas,
        limits: Mapping[str, tuple[float, float]],
    ) -> None:  # fmt: skip
        self._messages, self._supply, self._inputs, self._limits = messages, supply, inputs, limits
        self._scopes = Scopes(cefsm)
        self._variables = {component.name: component.variables for component in cefsm.components}
        self._transitions = {
            transition.id: (transition, [other for other in machine.transitions if _is_rival(other, transition)])
            for component in cefsm.components
            for machine in component.machines
            for transition in machine.transitions
        }

    def stimuli(
        self, events: Sequence[Event], values: Mapping[str, object], again: Mapping[int, int] | None = None
    ) -> Stimuli:
        """Return the stimuli of a case.

        Args:
            again: event -> one before it whose message is to come once more before its own, as a stray, if the model
                lets the component tell the two apart.
        """
        refused: dict[int, list[Expression]] = {}
        conditions = Conditions()
        scopes: dict[int, Record] = {}
        posted: dict[tuple[int, str], list[Record]] = {}
        received: dict[int, Record] = {}
        for event in events:
            scope = scopes.setdefault(event.reference, self._initial(event.component))
            transition, rivals = self._transitions[event.transition]
            now = {**scope, **self._open_inputs(event, values, conditions)}
            if event.receives is not None:
                message = self._received(event, values, posted, conditions)
                received[event.position] = message
                if transition.event is not None and transition.event.name:
                    now[transition.event.name] = message
            self._demand(event, transition, rivals, now, conditions)
            if again and event.position in again:
                stray = received[again[event.position]]
                refused[event.position] = self._refusing((transition, *rivals), now, stray)
                conditions.apart += refused[event.position]
            self._act(transition, scope, now)
            for send in transition.sends:
                posted.setdefault((event.position, send.channel), []).append(self._posted(send, now))
        found, infeasible = solved(conditions)
        of = {event.position: self._stimulus(event, received, found, conditions) for event in events}
        chosen = {**conditions.wanted, **found}
        for position, guards in refused.items():
            if guards and all(_holds(guard, chosen) for guard in guards):
                told = self._filled(events[position].receives, received[(again or {})[position]], chosen)
                of[position] = replace(of[position], stray=told)
        return Stimuli(of, infeasible)

    def _refusing(self, transitions: Sequence[Transition], now: Record, stray: Record) -> list[Expression]:
        """Return the conditions under which none of the transitions takes a stray message; none if one always may."""
        refusing: list[Expression] = []
        for transition in transitions:
            bound = dict(now)
            if transition.event is not None and transition.event.name:
                bound[transition.event.name] = stray
            if transition.guard is None:
                return []
            try:
                refusing.append(Unary("!", _substituted(transition.guard, bound)))
            except _Unknown:
                return []
        return refusing

    def _initial(self, component: str) -> Record:
        return {
            variable.name: _literal(variable.initial)
            for variable in self._variables[component]
            if is_local(variable) and variable.initial is not None
        }

    def _open_inputs(self, event: Event, values: Mapping[str, object], conditions: Conditions) -> Record:
        """Return a symbol for each input variable, or the value that a formula gives it."""
        given: Record = {}
        formulas = self._inputs.get(event.transition, {})
        for variable in self._variables[event.component]:
            if variable.role != "input":
                continue
            symbol = f"i{event.position}__{variable.name}"
            conditions.types[symbol] = variable_type(variable)
            if variable.domain:
                conditions.domains[symbol] = variable.domain
            given[variable.name] = Name(symbol)
            if variable.name in formulas:
                where = f"inputs of {event.transition}, {variable.name}"
                value = _given(variable.type, formulas[variable.name], values, where)
                conditions.hard.append((_same(symbol, value), where))
            elif variable.name in values:
                conditions.wanted[symbol] = _as(variable.type, values[variable.name])
        return given

    def _received(
        self, event: Event, values: Mapping[str, object], posted: Mapping[tuple[int, str], list[Record]],
        conditions: Conditions,
    ) -> Record:  # fmt: skip
        """Return what is known of the message that an event takes up."""
        assert event.receives is not None
        channel, source = event.receives.channel, event.receives.event
        if source is not None:
            queue = posted.get((source, channel), [])
            return queue.pop(0) if queue else {}
        declared = self._messages.class_of(channel)
        if declared is None:
            return {}
        message = self._open_message(declared.name, f"m{event.position}", values, conditions)
        for name, formula in self._supply.get(channel, {}).items():
            where = f"supply of {channel}, {name}"
            kind = next((one.type for one in declared.fields if one.name == name), "")
            symbol = f"m{event.position}__{name}"
            value = _given(kind, formula, values, where)
            if isinstance(value, bool | int | float | str) and symbol in conditions.types:
                conditions.hard.append((_same(symbol, value), where))
        return message

    def _open_message(self, name: str, prefix: str, values: Mapping[str, object], conditions: Conditions) -> Record:
        message: Record = {}
        for part, type_ in self._scopes.classes[name].items():
            symbol = f"{prefix}__{part}"
            if type_.name not in BASE_TYPES and not type_.rank:
                message[part] = self._open_message(type_.name, symbol, {}, conditions)
                continue
            conditions.types[symbol] = type_
            message[part] = Name(symbol)
            if part in values and not type_.rank:
                conditions.wanted[symbol] = _as(type_.name, values[part])
                if part in self._limits and type_.name in ("int", "real"):
                    low, high = (_literal(_as(type_.name, end)) for end in self._limits[part])
                    conditions.limits += [Binary(">=", Name(symbol), low), Binary("<=", Name(symbol), high)]
        return message

    def _demand(
        self, event: Event, transition: Transition, rivals: Sequence[Transition], now: Record, conditions: Conditions
    ) -> None:
        """Note that the guard must hold, and preferably no rival's."""
        if transition.guard is not None:
            where = f"event {event.position}, {event.component}#{event.reference}: {transition.id} [{transition.guard}]"
            with contextlib.suppress(_Unknown):  # of what it reads then, only the component knows
                conditions.hard.append((_substituted(transition.guard, now), where))
        for rival in rivals:
            bound = dict(now)
            if rival.event is not None and rival.event.name and transition.event is not None:
                bound[rival.event.name] = now.get(transition.event.name, {})
            if rival.guard is not None:
                with contextlib.suppress(_Unknown):
                    conditions.soft.append(Unary("!", _substituted(rival.guard, bound)))

    def _act(self, transition: Transition, scope: Record, now: Record) -> None:
        """Carry out the assignments; what cannot be followed is unknown from here on."""
        for action in transition.actions:
            if isinstance(action, Assignment):
                try:
                    scope[action.target] = now[action.target] = _resolved(action.value, now)
                except _Unknown:
                    scope.pop(action.target, None)
                    now.pop(action.target, None)

    def _posted(self, send: Send, now: Record) -> Record:
        """Return what the model says of a message that is sent."""
        declared = self._messages.class_of(send.channel)
        if declared is None:
            return {}
        if len(send.payload) == 1:
            with contextlib.suppress(_Unknown):
                whole = _resolved(send.payload[0], now)
                if isinstance(whole, dict):
                    return dict(whole)
        said: Record = {}
        if len(send.payload) == len(declared.fields):
            for one, value in zip(declared.fields, send.payload, strict=True):
                with contextlib.suppress(_Unknown):
                    said[one.name] = _resolved(value, now)
        return said

    def _stimulus(
        self, event: Event, received: Mapping[int, Record], found: Mapping[str, object], conditions: Conditions
    ) -> Stimulus:
        values = {**conditions.wanted, **found}
        prefix = f"i{event.position}__"
        inputs = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
        if event.receives is None or event.receives.event is not None:
            return Stimulus(None, inputs)
        return Stimulus(self._filled(event.receives, received[event.position], values), inputs)

    def _filled(self, receives: Reception | None, record: Record, values: Mapping[str, object]) -> Plain:
        """Return the message of which this is known."""
        assert receives is not None
        message = self._messages.default(receives.channel)
        if isinstance(message, dict):
            _fill(message, record, values)
        return self._messages.checked(receives.channel, message)


def _is_rival(other: Transition, transition: Transition) -> bool:
    """Return whether another transition of the same machine could be taken on the same occasion."""
    if other is transition or other.source != transition.source:
        return False
    return (other.event and other.event.channel) == (transition.event and transition.event.channel)


def _substituted(node: Expression, scope: Record) -> Expression:
    """Return the expression with what the names stand for in their place. Raises _Unknown."""
    found = _resolved(node, scope)
    if isinstance(found, dict):
        raise _Unknown
    return found


def _resolved(node: Expression, scope: Record) -> Symbolic:
    match node:
        case Literal():
            return node
        case Name(name):
            if name not in scope:
                raise _Unknown
            return scope[name]
        case FieldAccess(of, name):
            owner = _resolved(of, scope)
            if not isinstance(owner, dict) or name not in owner:
                raise _Unknown
            return owner[name]
        case Unary(operator, operand):
            return Unary(operator, _substituted(operand, scope))
        case Binary(operator, left, right):
            return Binary(operator, _substituted(left, scope), _substituted(right, scope))
        case Apply(function, arguments):
            return Apply(function, tuple(_substituted(one, scope) for one in arguments))
        case _:
            raise _Unknown


def _fill(message: dict[str, Plain], record: Record, values: Mapping[str, object]) -> None:
    """Put the values of its symbols into a message."""
    for name, symbol in record.items():
        if isinstance(symbol, dict):
            inner = message[name]
            assert isinstance(inner, dict)
            _fill(inner, symbol, values)
        elif isinstance(symbol, Name):
            size = values.get(f"size({symbol.id})")
            if isinstance(size, int) and 0 <= size <= 10_000:
                held = message[name]
                message[name] = [held[0] if isinstance(held, list) and held else 0] * size
            if symbol.id in values:
                message[name] = cast(Plain, values[symbol.id])
        else:
            with contextlib.suppress(BadModel, KeyError):
                message[name] = cast(Plain, evaluate(symbol, values))


def _holds(condition: Expression, values: Mapping[str, object]) -> bool:
    try:
        return evaluate(condition, values) is True
    except (BadModel, KeyError):
        return False


def _same(symbol: str, value: object) -> Expression:
    return Binary("==", Name(symbol), _literal(value))


def _literal(value: object) -> Expression:
    if isinstance(value, int | float) and not isinstance(value, bool) and value < 0:
        return Unary("-", Literal(-value))
    return Literal(cast("bool | int | float | str", value))


def _given(kind: str, formula: Expression, values: Mapping[str, object], where: str) -> object:
    """Return the value of a formula as a field or variable holds it. Raises BadRequest if it cannot."""
    try:
        value = evaluate(formula, values)
    except (BadModel, KeyError) as error:
        rule = error.rule if isinstance(error, BadModel) else f"there is no {error}"
        raise BadRequest(where, f"the formula must have a value, but: {rule}", slug="study-formula") from error
    made = _as(kind, value)
    types: dict[str, tuple[type, ...]]
    types = {"bool": (bool,), "int": (int,), "real": (int, float), "enum": (str,), "text": (str,)}
    if not isinstance(made, types.get(kind, object)) or (isinstance(made, bool) and kind in ("int", "real")):
        raise BadRequest(where, f"the formula must give {kind}, but gives {value!r}", slug="study-formula")
    return made


def _as(kind: str, value: object) -> object:
    """Return a test input, which is a number, as a value of the kind of its field, where the two agree."""
    if kind == "bool" and isinstance(value, int | float):
        return bool(value)
    if kind == "int" and isinstance(value, float) and value == int(value):
        return int(value)
    return float(value) if kind == "real" and isinstance(value, int) and not isinstance(value, bool) else value
