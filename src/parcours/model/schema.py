"""Reads a tree of YAML nodes as a model: which keys stand where, with what kind of value (docs/model-format.md)."""

from __future__ import annotations

import collections.abc
from typing import Literal, cast

from parcours.errors import BadModel
from parcours.model.documents import Mapping, Node, Scalar
from parcours.model.expression import (
    Expression,
    Name,
    Unary,
    parse_actions,
    parse_calls,
    parse_expression,
    parse_formula,
)
from parcours.model.expression import (
    Literal as Constant,
)
from parcours.model.expression.evaluation import INTEGER_LIMIT, evaluate
from parcours.model.expression.syntax import Assignment, Call, substitute
from parcours.model.finding import Finding
from parcours.model.nodes import NodeReader, shown
from parcours.model.structure import (
    Cefsm,
    Channel,
    Component,
    Field,
    Formula,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
)

FORMAT = "model/1"
"""The number of the format that this version reads and writes."""

MAX_RANGE = 1_000_000
"""Most values that the `range` of an integer variable may have."""

MAX_CAPACITY = 1000
"""Most messages that a channel may hold."""


def read_schema(
    document: Node, origin: str, constants: collections.abc.Mapping[str, float] | None = None
) -> tuple[Cefsm, list[Finding]]:
    """Return the model that a document holds, with stand-ins where something is wrong, and all that is wrong."""
    reader = _SchemaReader(origin, constants or {})
    return reader.model(document), reader.findings


_ZERO: Expression = Constant(0.0)


class _SchemaReader(NodeReader):
    # Each method takes a name and its node and returns the element, with stand-ins where findings were made, so
    # that one pass finds them all.

    def __init__(self, origin: str, constants: collections.abc.Mapping[str, float]) -> None:
        super().__init__(origin)
        self.given = constants
        self.constants: dict[str, Expression] = {}

    def model(self, node: Node) -> Cefsm:
        if (chart := _sismic(node)) is not None:
            rule = "a model has the key 'parcours', but 'statechart' makes this a sismic statechart, which is not read"
            self.add(chart, "sismic-statechart", rule, "write it as SCXML, or in the format of docs/model-format.md")
            return Cefsm("", ())
        optional = ("doc", "constants", "messages", "channels", "signals", "interactions", "serialisation")
        items = self.record(node, "a model", ("parcours", "name", "components"), optional)
        version = self.text(items.get("parcours"), "'parcours'", FORMAT)
        if version != FORMAT:
            rule = f"'parcours' must be {FORMAT!r}, but is {version[:40]!r}"
            self.add(items["parcours"], "format", rule, f"this version reads {FORMAT} only")
        for name, value, _ in self.entries(items.get("constants"), "constants"):
            read = self.parsed(value, f"constant {name!r}", _constant, _ZERO)
            self.constants[name] = _constant(repr(self.given[name]), name) if name in self.given else read
        components = self.entries(items.get("components"), "components")
        channels = self.entries(items.get("channels"), "channels")
        signals = self.entries(items.get("signals"), "signals")
        messages = self.entries(items.get("messages"), "messages")
        interactions = tuple(self.entries(items.get("interactions"), "interactions", self.label))
        return Cefsm(
            name=self.label(items.get("name"), "the name of the model"),
            components=tuple(self.component(*entry) for entry in components),
            channels=tuple(self.channel(*entry) for entry in channels),
            messages=tuple(self.message(*entry) for entry in messages),
            source=self.origin,
            doc=self.text(items.get("doc"), "'doc'"),
            serialisation=self.text(items.get("serialisation"), "'serialisation'"),
            interactions=tuple((name, self.interaction(name, path)) for name, path, _ in interactions),
            interaction_lines=tuple(line for _, _, line in interactions),
            signals=tuple(self.signal(*entry) for entry in signals),
        )

    def interaction(self, name: str, node: Node) -> tuple[str, ...]:
        what = f"interaction {name!r}"
        return tuple(self.identifier(part, f"a component of {what}") for part in self.listed(node, what))

    def message(self, name: str, node: Node, line: int) -> MessageClass:
        items = self.record(node, f"message {name!r}", ("fields",), ("doc",))
        fields = self.entries(items.get("fields"), f"fields of {name!r}")
        return MessageClass(
            name,
            tuple(self.field(name, field, value) for field, value, _ in fields),
            self.text(items.get("doc"), f"'doc' of {name!r}"),
            line,
        )

    def field(self, owner: str, name: str, node: Node) -> Field:
        what = f"field '{owner}.{name}'"
        items = self.record(node, what, ("type",), ("unit", "shape", "doc"))
        return Field(
            name,
            self.identifier(items.get("type"), f"'type' of {what}"),
            self.text(items.get("unit"), f"'unit' of {what}", "1"),
            tuple(self.length(part, what) for part in self.listed(items.get("shape"), f"'shape' of {what}")),
            self.text(items.get("doc"), f"'doc' of {what}"),
        )

    def length(self, node: Node, what: str) -> int | str:
        if isinstance(node, Scalar) and node.text[:1].isdigit():
            return self.integer(node, f"a length of {what}", 1, 10**9)
        return self.identifier(node, f"a length of {what}")

    def signal(self, name: str, node: Node, line: int) -> Channel:
        return self.channel(name, node, line, ("ensures",), "signal")

    def channel(
        self, name: str, node: Node, line: int, optional: tuple[str, ...] = ("topic", "capacity", "ensures"),
        kind: str = "channel",
    ) -> Channel:  # fmt: skip
        what = f"{kind} {name!r}"
        items = self.record(node, what, ("from", "to", "message"), optional)
        sender, receiver, message = (
            self.identifier(items.get(key), f"{key!r} of {what}") for key in ("from", "to", "message")
        )
        capacity = 1
        if "capacity" in items:
            capacity = self.integer(items["capacity"], f"'capacity' of {what}", 0, MAX_CAPACITY)
        topic = self.text(items.get("topic"), f"'topic' of {what}")
        return Channel(name, sender, receiver, message, topic, capacity, self.formulas(items, "ensures", what), line)

    def formulas(self, items: dict[str, Node], key: str, what: str) -> tuple[Formula, ...]:
        found = []
        for name, node, line in self.entries(items.get(key), f"{key!r} of {what}", self.label):
            condition = self.parsed(node, f"{name!r} of {what}", parse_formula, None)
            if condition is not None and isinstance(node, Scalar):
                found.append(Formula(name, self.known(condition), " ".join(node.text.split()), line))
        return tuple(found)

    def known(self, expression: Expression) -> Expression:
        """Return an expression with the values of constants in it."""
        if not self.constants:
            return expression
        return substitute(expression, lambda node: self.constants.get(node.id) if isinstance(node, Name) else None)

    def component(self, name: str, node: Node, line: int) -> Component:
        what = f"component {name!r}"
        items = self.record(node, what, ("machines",), ("title", "variables", "invariants"))
        variables = self.entries(items.get("variables"), f"variables of {name!r}")
        machines = self.entries(items.get("machines"), f"machines of {name!r}", self.label)
        return Component(
            name,
            tuple(self.machine(*entry) for entry in machines),
            tuple(self.variable(name, *entry) for entry in variables),
            self.text(items.get("title"), f"'title' of {what}"),
            self.formulas(items, "invariants", what),
            line,
        )

    def variable(self, owner: str, name: str, node: Node, line: int) -> Variable:
        what = f"variable '{owner}.{name}'"
        items = self.record(node, what, ("type",), ("initial", "role", "values", "range", "unit"))
        type_ = self.identifier(items.get("type"), f"'type' of {what}")
        role = self.text(items.get("role"), f"'role' of {what}", "local")
        if role not in ("local", "input"):
            self.add(items.get("role"), "value", f"'role' of {what} must be local or input, but is {role[:40]!r}")
        initial = None
        if "initial" in items and type_:
            initial = self.constant(items["initial"], type_, what)
        unit = self.text(items.get("unit"), f"'unit' of {what}", "1")
        known_role = cast(Literal["local", "input"], role)
        return Variable(name, type_, initial, known_role, self.domain(items, type_, what), unit, line)

    def domain(self, items: dict[str, Node], type_: str, what: str) -> tuple[object, ...] | range:
        for key, owner in (("values", "enum"), ("range", "int")):
            if key in items and type_ != owner:
                rule = f"{key!r} belongs to {owner} variables, but {what} is of type {type_!r}"
                self.add(items[key], "value", rule, "delete it")
        if type_ == "enum" and "values" in items:
            values = self.listed(items["values"], f"'values' of {what}")
            return tuple(self.label(value, f"a value of {what}") for value in values)
        if type_ != "int" or "range" not in items:
            return ()
        ends = self.listed(items["range"], f"'range' of {what}")
        low, high = 0, 0
        if len(ends) == 2:
            low, high = (
                self.integer(end, f"an end of the range of {what}", -INTEGER_LIMIT, INTEGER_LIMIT) for end in ends
            )
        if len(ends) != 2 or not 0 <= high - low < MAX_RANGE:
            rule = f"'range' of {what} must be [lowest, highest] with at most {MAX_RANGE} integers, but is not"
            self.add(items["range"], "value", rule, "leave it out for an unbounded integer")
            return ()
        return range(low, high + 1)

    def machine(self, name: str, node: Node, line: int) -> Machine:
        what = f"machine {name!r}"
        items = self.record(
            node, what, ("initial", "transitions"), ("states", "final", "invariants", "tags", "exclusive")
        )
        initial = self.label(items.get("initial"), f"'initial' of {what}")
        entries = self.entries(items.get("transitions"), f"transitions of {name!r}", self.label)
        transitions = tuple(self.transition(*entry) for entry in entries)
        if "states" in items:
            listed = self.listed(items["states"], f"'states' of {what}")
            states = tuple(self.label(state, f"a state of {what}") for state in listed)
        else:
            ends = [state for transition in transitions for state in (transition.source, transition.target)]
            states = tuple(dict.fromkeys([initial, *ends]))
        final = self.listed(items.get("final"), f"'final' of {what}")
        invariants = self.entries(items.get("invariants"), f"invariants of {name!r}", self.label)
        tagged = self.entries(items.get("tags"), f"tags of {name!r}", self.label)
        read = ((state, self.condition(condition, state)) for state, condition, _ in invariants)
        groups = self.listed(items.get("exclusive"), f"'exclusive' of {what}")
        return Machine(
            name,
            initial,
            states,
            transitions,
            final=tuple(self.label(state, f"a final state of {what}") for state in final),
            invariants=tuple((state, condition) for state, condition in read if condition is not None),
            line=line,
            tags=tuple((state, tag) for state, each, _ in tagged for tag in self.tags(each, f"state {state!r}")),
            exclusive=tuple(self.group(each, what) for each in groups),
        )

    def group(self, node: Node, what: str) -> tuple[str, ...]:
        what = f"a group of 'exclusive' of {what}"
        return tuple(self.label(each, f"a transition of {what}") for each in self.listed(node, what))

    def tags(self, node: Node | None, what: str) -> tuple[str, ...]:
        return tuple(self.label(each, f"a tag of {what}") for each in self.listed(node, f"'tags' of {what}"))

    def condition(self, node: Node, state: str) -> Expression | None:
        return self.parsed(node, f"invariant of {state!r}", self.expression, None)

    def expression(self, text: str, where: str) -> Expression:
        return self.known(parse_expression(text, where))

    def actions(self, text: str, where: str) -> tuple[Assignment | Call, ...]:
        return tuple(
            Assignment(each.target, self.known(each.value)) if isinstance(each, Assignment)
            else Call(each.name, tuple(map(self.known, each.arguments)))
            for each in parse_actions(text, where)
        )  # fmt: skip

    def sends(self, text: str, where: str) -> tuple[Send, ...]:
        return tuple(Send(call.name, tuple(map(self.known, call.arguments))) for call in parse_calls(text, where))

    def transition(self, id: str, node: Node, line: int) -> Transition:
        what = f"transition {id!r}"
        optional = ("event", "guard", "action", "message", "duration", "weight", "ensures", "tags")
        items = self.record(node, what, ("from", "to"), optional)
        return Transition(
            id,
            self.label(items.get("from"), f"'from' of {what}"),
            self.label(items.get("to"), f"'to' of {what}"),
            self.parsed(items.get("event"), f"event of {id!r}", _event, None),
            self.parsed(items.get("guard"), f"guard of {id!r}", self.expression, None),
            self.parsed(items.get("action"), f"action of {id!r}", self.actions, ()),
            self.parsed(items.get("message"), f"message of {id!r}", self.sends, ()),
            self.duration(items.get("duration"), what),
            self.number(items["weight"], f"'weight' of {what}") if "weight" in items else 1.0,
            self.formulas(items, "ensures", what),
            line,
            self.tags(items.get("tags"), what),
        )

    def duration(self, node: Node | None, what: str) -> tuple[float, float] | None:
        ends = self.listed(node, f"'duration' of {what}")
        if node is None:
            return None
        if len(ends) != 2:
            self.add(node, "duration", f"'duration' of {what} must be [least, most] in seconds, but is {shown(node)}")
            return None
        least, most = (self.number(end, f"an end of the duration of {what}") for end in ends)
        return least, most


def _sismic(node: Node) -> Scalar | None:
    # The key that tells a statechart of sismic, or None: that is YAML too, but another language.
    keys = [key for key, _ in node.items] if isinstance(node, Mapping) else []
    ours = any(key.text == "parcours" for key in keys)
    return None if ours else next((key for key in keys if key.text == "statechart"), None)


def _event(text: str, where: str) -> Receive:
    calls = parse_calls(text, where)
    binders = [argument.id for argument in calls[0].arguments if isinstance(argument, Name)]
    if len(calls) > 1 or len(binders) != len(calls[0].arguments) or len(binders) > 1:
        rule = f"an event is channel or channel(name), but this is {text[:60]!r}"
        raise BadModel(where, rule, "receive one message a transition", slug="event")
    return Receive(calls[0].name, binders[0] if binders else "")


def _constant(text: str, where: str) -> Expression:
    value = evaluate(parse_expression(text, where), {}, where)
    if isinstance(value, int | float) and not isinstance(value, bool) and value < 0:
        return Unary("-", Constant(-value))
    return Constant(value)  # type: ignore[arg-type]  # the language has no other values
