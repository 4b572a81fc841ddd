"""Writes a model as YAML text, which reads back to an equal model."""

from __future__ import annotations

import re
from collections.abc import Iterable

from parcours.model.nodes import is_identifier
from parcours.model.schema import FORMAT
from parcours.model.structure import Cefsm, Channel, Component, Field, Machine, Transition, Variable

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_/.-]*", re.ASCII)
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


def write_model(cefsm: Cefsm) -> str:
    """Return the model as text in the format `parcours: model/1`.

    Lines and the name of the file that it came from are not written.
    """
    lines = [f"parcours: {FORMAT}", f"name: {_text(cefsm.name)}"]
    if cefsm.doc:
        lines.append(f"doc: {_text(cefsm.doc)}")
    if cefsm.serialisation:
        lines.append(f"serialisation: {_text(cefsm.serialisation)}")
    if cefsm.messages:
        lines += ["", "messages:"]
    for message in cefsm.messages:
        lines.append(f"  {message.name}:")
        if message.doc:
            lines.append(f"    doc: {_text(message.doc)}")
        lines.append("    fields:")
        lines += [f"      {field.name}: {_field(field)}" for field in message.fields]
    if cefsm.channels:
        lines += ["", "channels:"]
    lines += [f"  {channel.name}: {_channel(channel)}" for channel in cefsm.channels]
    lines += ["", "components:"]
    for component in cefsm.components:
        lines += _component(component)
    if cefsm.interactions:
        lines += ["", "interactions:"]
    lines += [f"  {_text(name)}: [{', '.join(path)}]" for name, path in cefsm.interactions]
    return "\n".join(lines) + "\n"


def _component(component: Component) -> list[str]:
    lines = [f"  {component.name}:"]
    if component.title:
        lines.append(f"    title: {_text(component.title)}")
    if component.variables:
        lines.append("    variables:")
    lines += [f"      {variable.name}: {_variable(variable)}" for variable in component.variables]
    lines.append("    machines:")
    for machine in component.machines:
        lines += _machine(machine)
    return lines


def _machine(machine: Machine) -> list[str]:
    lines = [f"      {_text(machine.name)}:", f"        initial: {_text(machine.initial)}"]
    ends = [state for transition in machine.transitions for state in (transition.source, transition.target)]
    if machine.states != tuple(dict.fromkeys([machine.initial, *ends])):
        lines.append(f"        states: [{', '.join(map(_text, machine.states))}]")
    if machine.final:
        lines.append(f"        final: [{', '.join(map(_text, machine.final))}]")
    if machine.invariants:
        lines.append("        invariants:")
    lines += [f"          {_text(state)}: {_text(str(condition))}" for state, condition in machine.invariants]
    empty = "" if machine.transitions else " {}"
    lines.append(f"        transitions:{empty}")
    lines += [f"          {_text(transition.id)}: {_transition(transition)}" for transition in machine.transitions]
    return lines


def _field(field: Field) -> str:
    pairs = [("type", field.type)]
    if field.unit != "1":
        pairs.append(("unit", _text(field.unit)))
    if field.shape:
        pairs.append(("shape", f"[{', '.join(map(str, field.shape))}]"))
    if field.doc:
        pairs.append(("doc", _text(field.doc)))
    return _flow(pairs)


def _channel(channel: Channel) -> str:
    pairs = [("from", channel.sender), ("to", channel.receiver), ("message", channel.message)]
    if channel.topic:
        pairs.append(("topic", _text(channel.topic)))
    if channel.capacity != 1:
        pairs.append(("capacity", str(channel.capacity)))
    return _flow(pairs)


def _variable(variable: Variable) -> str:
    pairs = [("type", variable.type)]
    if variable.role != "local":
        pairs.append(("role", variable.role))
    if variable.initial is not None:
        pairs.append(("initial", _constant(variable.initial)))
    if isinstance(variable.domain, range):
        pairs.append(("range", f"[{variable.domain[0]}, {variable.domain[-1]}]"))
    elif variable.domain:
        pairs.append(("values", f"[{', '.join(_text(str(value)) for value in variable.domain)}]"))
    if variable.unit != "1":
        pairs.append(("unit", _text(variable.unit)))
    return _flow(pairs)


def _transition(transition: Transition) -> str:
    pairs = [("from", _text(transition.source)), ("to", _text(transition.target))]
    if transition.event is not None:
        binder = f"({transition.event.name})" if transition.event.name else ""
        pairs.append(("event", transition.event.channel + binder))
    if transition.guard is not None:
        pairs.append(("guard", _text(str(transition.guard))))
    if transition.actions:
        pairs.append(("action", _text("; ".join(map(str, transition.actions)))))
    if transition.sends:
        said = [f"{send.channel}({', '.join(map(str, send.payload))})" for send in transition.sends]
        pairs.append(("message", _text("; ".join(said))))
    if transition.duration is not None:
        pairs.append(("duration", f"[{', '.join(map(repr, transition.duration))}]"))
    if transition.weight != 1:
        pairs.append(("weight", repr(transition.weight)))
    return _flow(pairs)


def _flow(pairs: Iterable[tuple[str, str]]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"


def _constant(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return _text(value) if isinstance(value, str) else repr(value)


def _text(text: str) -> str:
    # Bare where every YAML reader takes it for a word, in double quotes otherwise.
    if (is_identifier(text) and text.lower() not in _WORDS) or (_PLAIN.fullmatch(text) and "/" in text):
        return text
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
