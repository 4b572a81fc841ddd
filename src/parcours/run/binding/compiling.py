"""Compiles a binding for the message types of a system, or says all that does not fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from parcours.errors import BadModel, HostFailure
from parcours.model.documents import Mapping as Tree
from parcours.model.documents import Node, Scalar
from parcours.model.documents import Sequence as Listed
from parcours.model.expression import BOOL, INT, REAL, TEXT, Type
from parcours.model.expression.typing import accepts
from parcours.model.finding import Finding
from parcours.model.nodes import shown
from parcours.model.structure import BASE_TYPES
from parcours.run.binding.access import Access, compile_place
from parcours.run.binding.binding_file import refusal
from parcours.run.binding.formulas import PlacedFormula
from parcours.run.binding.message_formulas import MessageWriter, Reading, message_type
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.places import EVERY, Place, path_text
from parcours.run.binding.quantities import plain
from parcours.run.binding.structure import Action, Binding, BoundChannel, Constant, Injection
from parcours.run.binding.worlds import ASKED, LISTS

_TYPE_OF = {bool: BOOL, int: INT, float: REAL, str: TEXT}
_SAID = {name: Type(item, rank=1) for name, item in LISTS.items()}


@dataclass(frozen=True, slots=True)
class Compiled:
    """A binding whose formulas are known to make sense for the message types of the system.

    Attributes:
        fields: channel -> field of the model's message -> what reads it from a message of that channel.
        writers: channel -> what makes the tester's messages on it.
        command: readings of speed [m/s] and yaw rate [rad/s].
        alarm: reading of imminent collision.
        calls: position of a step of `before_case` or `after_case` -> what makes its message.
    """

    binding: Binding
    types: MessageTypes
    fields: Mapping[str, Mapping[str, Reading]]
    writers: Mapping[str, MessageWriter]
    command: tuple[Reading, Reading] | None = None
    alarm: Reading | None = None
    calls: Mapping[tuple[str, int], MessageWriter] = field(default_factory=dict)


def compile_binding(binding: Binding, types: MessageTypes) -> Compiled:
    """Return a binding compiled for the message types of a system.

    Args:
        binding: a checked binding.
        types: what is known of the system's message types.

    Raises:
        BadRequest: a type is not known, a place is not in its type, or a formula has another type than is needed; the
            message lists all findings with their lines.
    """
    work = _Work(binding, types)
    made = work.compiled()
    if work.found:
        raise refusal(tuple(sorted(work.found)))
    return made


class _Work:
    def __init__(self, binding: Binding, types: MessageTypes) -> None:
        self.binding, self.types = binding, types
        self.constants = dict(binding.constants)
        self.bound = {channel.name: channel for channel in binding.channels}
        self.found: list[Finding] = []
        self.unknown = {
            channel.name
            for channel in binding.channels
            if not self.is_known(message_type(channel), channel.type, f"channel {channel.name!r}", channel.line)
        }

    def add(self, line: int, slug: str, rule: str, remedy: str = "") -> None:
        self.found.append(Finding(self.binding.source, line, "error", slug, rule, remedy))

    def is_known(self, type_: str, said: str, of: str, line: int) -> bool:
        if self.types.fields(type_) is not None:
            return True
        remedy = "install its package, or name the folder of its definition under 'interfaces'"
        self.add(line, "unknown-message-type", f"a type must be known here, but {said} of {of} is not", remedy)
        return False

    def compiled(self) -> Compiled:
        binding = self.binding
        channels = [channel for channel in binding.channels if channel.name not in self.unknown]
        fields = {channel.name: self.fields(channel) for channel in channels}
        writers = {
            channel.name: self.writer(
                channel.inject, message_type(channel), f"channel {channel.name!r}",
                f"{channel.type}Request" if channel.part == "response" else "",
            )
            for channel in channels
            if channel.inject or channel.role == "provide"
        }  # fmt: skip
        command, alarm = None, None
        if binding.system is not None:
            linear = self.prefixed(binding.system.command.linear, "'linear'", REAL)
            angular = self.prefixed(binding.system.command.angular, "'angular'", REAL)
            command = (linear, angular) if linear and angular else None
            if binding.system.alarm is not None:
                alarm = self.prefixed(binding.system.alarm[1], "'imminent_collision'", BOOL)
        calls = {
            (key, position): self.writer(action.inject, _called(action), action.name)
            for key, actions in (("before_case", binding.before_case), ("after_case", binding.after_case))
            for position, action in enumerate(actions)
            if action.kind in ("call", "publish")
            and self.is_known(_called(action), action.type, action.name, action.line)
        }
        return Compiled(binding, self.types, fields, writers, command, alarm, calls)

    def fields(self, channel: BoundChannel) -> dict[str, Reading]:
        readings: dict[str, Reading] = {}
        if not channel.fields:
            return readings
        message = self.binding.model.channel(channel.name).message
        declared = next(one for one in self.binding.model.messages if one.name == message)
        wanted = {one.name: Type(one.type, rank=len(one.shape)) for one in declared.fields}
        for name, formula in channel.fields:
            where = f"field {name!r} of channel {channel.name!r}"
            owners = {place: (channel, place) for place in formula.places}
            reading = self.reading(formula, owners, where, wanted[name])
            if reading is not None:
                readings[name] = reading
        return readings

    def prefixed(self, formula: PlacedFormula, where: str, wanted: Type) -> Reading | None:
        """Return the reading of a formula whose places start with the name of a channel."""
        if any(str(place.steps[0]) in self.unknown for place in formula.places):
            return None
        owners = {
            place: (self.bound[str(place.steps[0])], place.within())
            for place in formula.places
            if path_text(place.steps) not in self.constants
        }
        return self.reading(formula, owners, where, wanted)

    def reading(
        self, formula: PlacedFormula, owners: Mapping[Place, tuple[BoundChannel, Place]], where: str, wanted: Type
    ) -> Reading | None:
        """Return the reading of a formula, given the channel of each place and the place in its message."""
        try:
            reading = self.tried(formula, owners, where)
        except BadModel as error:
            self.add(formula.line, error.slug, f"{where}: {error.rule}", error.remedy)
            return None
        given = reading.type
        # A message of ROS may stand for any message of the model, if both are lists of equal rank, or neither is.
        is_message = wanted.name not in BASE_TYPES and given.name not in BASE_TYPES and wanted.rank == given.rank
        if is_message or accepts(wanted, given):
            return reading
        rule = f"{where} must be of type {wanted}, but {str(formula)!r} is {given}"
        self.add(formula.line, "binding-field-type", rule, "correct the place, or the model")
        return None

    def tried(self, formula: PlacedFormula, owners: Mapping[Place, tuple[BoundChannel, Place]], where: str) -> Reading:
        types: dict[Place, Type] = {}
        sources: list[tuple[Place, str, Access]] = []
        constants: dict[Place, Constant] = {}
        for place in formula.places:
            if not place.lens and path_text(place.steps) in self.constants:
                constants[place] = self.constants[path_text(place.steps)]
                types[place] = _TYPE_OF[type(constants[place])]
                continue
            channel, inner = owners[place]
            if not inner.steps:
                rule = f"a name must go on to a field, but {place} is a whole message"
                raise BadModel(where, rule, f"write {place}.something", slug="binding-field")
            access = compile_place(inner, message_type(channel), self.types, where)
            sources.append((place, channel.name, access))
            types[place] = access.type
        given = types[formula.places[0]] if formula.place else formula.type(types, where)
        return Reading(formula, given, tuple(sources), constants, where)

    def writer(self, injection: Injection | None, type_: str, where: str, request: str = "") -> MessageWriter:
        """Return what makes the tester's messages of a known type; a response may speak of its request."""
        if injection is None:
            return MessageWriter(type_, self.types, where)
        asked, each = self.asked(injection, request, where) if request else ({}, None)
        base: list[tuple[Access, object]] = []
        trial = self.types.create(type_)
        for steps, node in _leaves(injection.base, ()):
            access = self.place(Place(steps), type_, where, node.line)
            if access is None:
                continue
            value = node.text if isinstance(node, Scalar) and access.type.name == "text" else plain(node)
            try:
                access.write(trial, value)
            except HostFailure:
                rule = f"a value must fit its field, but {access.place} is {access.slot} and this is {shown(node)}"
                self.add(node.line, "message-value", rule)
            base.append((access, value))
        pairs = ((self.place(place, type_, where, formula.line), formula) for place, formula in injection.set)
        seen = {
            name: Type(access.type.name, rank=access.type.rank - access.place.is_each) for name, access in asked.items()
        }
        fit = tuple(
            (access, formula) for access, formula in pairs if access and self.fits(access, formula, where, seen)
        )
        return MessageWriter(type_, self.types, where, tuple(base), fit, tuple(asked.items()), each)

    def asked(self, injection: Injection, request: str, where: str) -> tuple[dict[str, Access], Access | None]:
        """Return where in a request the names lie that speak of it, and the list that is counted."""
        found: dict[str, Access] = {}
        each = None if injection.each is None else self.place(injection.each, request, where, injection.line)
        listed = () if injection.each is None else injection.each.steps
        for _, formula in injection.set:
            for place in formula.places:
                if place.steps[0] not in ASKED or str(place) == "item.index":
                    continue
                if place.steps[0] == "item" and not listed:
                    rule = f"{where}: an item must be of a list, but {str(place)!r} stands without 'for each'"
                    self.add(formula.line, "binding-inject", rule, "add e.g. for each: reqs")
                    continue
                front = (*listed, EVERY) if place.steps[0] == "item" else ()
                access = self.place(Place((*front, *place.steps[1:]), place.lens), request, where, formula.line)
                if access is not None:
                    found[str(place)] = access
        return found, each

    def place(self, place: Place, type_: str, where: str, line: int) -> Access | None:
        try:
            return compile_place(place, type_, self.types, where)
        except BadModel as error:
            self.add(line, error.slug, error.rule, error.remedy)
            return None

    def fits(self, access: Access, formula: PlacedFormula, where: str, seen: Mapping[str, Type]) -> bool:
        """Whether the value of a formula over constants, numbers and what is seen can be put at a place."""
        known, place = self.constants, access.place
        types = {
            p: _TYPE_OF[type(known[str(p)])] if str(p) in known else seen.get(str(p), _SAID.get(str(p), REAL))
            for p in formula.places
        }
        try:
            given = formula.type(types, f"{str(place)!r} of {where}")
        except BadModel as error:
            self.add(formula.line, error.slug, error.rule, error.remedy)
            return False
        wanted = Type(access.type.name, rank=access.type.rank - place.is_each)
        if accepts(wanted, given) or {wanted, given} == {INT, REAL}:
            return True
        rule = f"a formula must fit its field, but {place} is {access.slot} and {str(formula)!r} is {given}"
        self.add(formula.line, "binding-field-type", rule)
        return False


def _leaves(node: Node | None, steps: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Node]]:
    """Yield the leaves of a tree of plain data, each with its place; a list of scalars is one leaf."""
    if isinstance(node, Tree):
        for key, value in node.items:
            yield from _leaves(value, (*steps, key.text))
    elif isinstance(node, Listed) and any(not isinstance(item, Scalar) for item in node.items):
        for index, item in enumerate(node.items):
            yield from _leaves(item, (*steps, index))
    elif node is not None:
        yield steps, node


def _called(action: Action) -> str:
    return action.type + ("Request" if action.kind == "call" else "")
