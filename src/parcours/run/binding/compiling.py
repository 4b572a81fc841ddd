"""A binding and the message types of a system to compiled readers and writers, or to all that does not fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import BOOL, REAL, Type
from parcours.model.expression.typing import accepts
from parcours.model.finding import Finding
from parcours.model.structure import BASE_TYPES
from parcours.run.binding.binding_file import refusal
from parcours.run.binding.formulas import Formula
from parcours.run.binding.injecting import Writer, compile_injection
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.readings import Compiler, Reading, message_type
from parcours.run.binding.structure import Action, Binding, BoundChannel


@dataclass(frozen=True, slots=True)
class Compiled:
    """A binding whose formulas are known to make sense for the message types of the system.

    Attributes:
        fields: channel -> field of the model's message -> what reads it from a message of that channel.
        writers: channel -> what makes the tester's messages on it.
        conditions: transition -> its `when`; transitions without one are missing.
        inputs: `Component.variable` -> its reading.
        command: readings of speed [m/s] and yaw rate [rad/s].
        alarm: reading of imminent collision.
        calls: position of a step of `before_case` or `after_case` -> what makes its message.
    """

    binding: Binding
    types: MessageTypes
    fields: Mapping[str, Mapping[str, Reading]]
    writers: Mapping[str, Writer]
    conditions: Mapping[str, Reading]
    inputs: Mapping[str, Reading]
    command: tuple[Reading, Reading] | None = None
    alarm: Reading | None = None
    calls: Mapping[tuple[str, int], Writer] = field(default_factory=dict)


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
        self.compiler = Compiler(binding, types)
        self.found: list[Finding] = []
        self.unknown = {channel.name for channel in binding.channels if not self.is_known(channel)}

    def add(self, line: int, slug: str, rule: str, remedy: str = "") -> None:
        self.found.append(Finding(self.binding.source, line, "error", slug, rule, remedy))

    def is_known(self, channel: BoundChannel) -> bool:
        if self.types.fields(message_type(channel)) is not None:
            return True
        remedy = "install its package, or name the folder of its .msg and .srv files under 'interfaces'"
        rule = f"a type must be known here, but {channel.type} of channel {channel.name!r} is not"
        self.add(channel.line, "unknown-message-type", rule, remedy)
        return False

    def compiled(self) -> Compiled:
        binding = self.binding
        channels = [channel for channel in binding.channels if channel.name not in self.unknown]
        fields = {channel.name: self.fields(channel) for channel in channels}
        writers = {
            channel.name: self.writer(channel) for channel in channels if channel.inject or channel.role == "provide"
        }
        found = {
            e.transition: self.prefixed(e.when, f"'when' of {e.transition!r}", BOOL) for e in binding.events if e.when
        }
        conditions = {name: reading for name, reading in found.items() if reading}
        inputs = {name: reading for name, f in binding.inputs if (reading := self.input(name, f))}
        command, alarm = None, None
        if binding.system is not None:
            linear = self.prefixed(binding.system.command.linear, "'linear'", REAL)
            angular = self.prefixed(binding.system.command.angular, "'angular'", REAL)
            command = (linear, angular) if linear and angular else None
            if binding.system.alarm is not None:
                alarm = self.prefixed(binding.system.alarm[1], "'imminent_collision'", BOOL)
        calls = {
            (key, position): self.call(action)
            for key, actions in (("before_case", binding.before_case), ("after_case", binding.after_case))
            for position, action in enumerate(actions)
            if action.kind in ("call", "publish") and self.is_call_known(action)
        }
        return Compiled(binding, self.types, fields, writers, conditions, inputs, command, alarm, calls)

    def fields(self, channel: BoundChannel) -> dict[str, Reading]:
        readings: dict[str, Reading] = {}
        if not channel.fields:
            return readings
        message = self.binding.model.channel(channel.name).message
        declared = next(one for one in self.binding.model.messages if one.name == message)
        wanted = {one.name: Type(one.type, rank=len(one.shape)) for one in declared.fields}
        for name, formula in channel.fields:
            where = f"field {name!r} of channel {channel.name!r}"
            reading = self.tried(formula, where, lambda f, w: self.compiler.own(f, channel, w))
            if reading is not None and self.fits(wanted[name], reading, where):
                readings[name] = reading
        return readings

    def input(self, name: str, formula: Formula) -> Reading | None:
        component, _, variable = name.partition(".")
        declared = next(v for v in self.binding.model.component(component).variables if v.name == variable)
        return self.prefixed(formula, f"input {name!r}", Type(declared.type))

    def prefixed(self, formula: Formula, where: str, wanted: Type) -> Reading | None:
        if any(str(place.steps[0]) in self.unknown for place in formula.places):
            return None
        reading = self.tried(formula, where, self.compiler.prefixed)
        return reading if reading is not None and self.fits(wanted, reading, where) else None

    def tried(self, formula: Formula, where: str, make: Callable[[Formula, str], Reading]) -> Reading | None:
        try:
            return make(formula, where)
        except BadModel as error:
            self.add(formula.line, error.slug, f"{where}: {error.rule}", error.remedy)
            return None

    def fits(self, wanted: Type, reading: Reading, where: str) -> bool:
        """A message of ROS may stand for any message of the model, if both are lists of equal rank, or none."""
        given = reading.type
        is_message = wanted.name not in BASE_TYPES and given.name not in BASE_TYPES and wanted.rank == given.rank
        if is_message or accepts(wanted, given):
            return True
        rule = f"{where} must be of type {wanted}, but {str(reading.formula)!r} is {given}"
        self.add(reading.formula.line, "binding-field-type", rule, "correct the place, or the model")
        return False

    def writer(self, channel: BoundChannel) -> Writer:
        type_, where = message_type(channel), f"channel {channel.name!r}"
        if channel.inject is None:
            return Writer(type_, self.types, (), (), where)
        made, found = compile_injection(self.binding, channel.inject, type_, self.types, where)
        self.found += found
        return made

    def is_call_known(self, action: Action) -> bool:
        known = self.types.fields(_called(action)) is not None
        if not known:
            rule = f"a type must be known here, but {action.type} of {action.name} is not"
            self.add(action.line, "unknown-message-type", rule, "install its package, or name it under 'interfaces'")
        return known

    def call(self, action: Action) -> Writer:
        type_ = _called(action)
        if action.inject is None:
            return Writer(type_, self.types, (), (), action.name)
        made, found = compile_injection(self.binding, action.inject, type_, self.types, action.name)
        self.found += found
        return made


def _called(action: Action) -> str:
    return action.type + ("Request" if action.kind == "call" else "")
