"""Writes a model as YAML text, which reads back to an equal model."""

from __future__ import annotations

import re
from collections.abc import Iterable

from parcours.model.nodes import is_identifier
from parcours.model.schema import FORMAT
from parcours.model.structure import Cefsm, Channel, Field, Formula, Machine, Transition, Variable

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_/.-]*", re.ASCII)
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


def write_model(cefsm: Cefsm) -> str:
    """Return the model as text in the format `parcours: model/1`, without the lines and the file that it came from."""
    lines = [f"parcours: {FORMAT}", f"name: {_text(cefsm.name)}"]
    lines += _said(0, ("doc", cefsm.doc), ("serialisation", cefsm.serialisation))
    if cefsm.messages:
        lines += ["", "messages:"]
    for message in cefsm.messages:
        lines += [f"  {message.name}:", *_said(4, ("doc", message.doc)), "    fields:"]
        lines += [f"      {field.name}: {_field(field)}" for field in message.fields]
    if cefsm.channels:
        lines += ["", "channels:"]
    lines += [f"  {channel.name}: {_channel(channel)}" for channel in cefsm.channels]
    if cefsm.signals:
        lines += ["", "signals:"]
    lines += [f"  {signal.name}: {_channel(signal)}" for signal in cefsm.signals]
    lines += ["", "components:"]
    for component in cefsm.components:
        lines += [f"  {component.name}:", *_said(4, ("title", component.title))]
        if component.variables:
            lines.append("    variables:")
        lines += [f"      {variable.name}: {_variable(variable)}" for variable in component.variables]
        if component.invariants:
            lines.append(f"    invariants: {_formulas(component.invariants)}")
        lines.append("    machines:")
        for machine in component.machines:
            lines += _machine(machine)
    if cefsm.interactions:
        lines += ["", "interactions:"]
    lines += [f"  {_text(name)}: {_listed(path)}" for name, path in cefsm.interactions]
    return "\n".join(lines) + "\n"


def _machine(machine: Machine) -> list[str]:
    lines = [f"      {_text(machine.name)}:", f"        initial: {_text(machine.initial)}"]
    ends = [state for transition in machine.transitions for state in (transition.source, transition.target)]
    # States in the order of appearance need no list: that is how they are read.
    if machine.states != tuple(dict.fromkeys([machine.initial, *ends])):
        lines.append(f"        states: {_listed(map(_text, machine.states))}")
    if machine.final:
        lines.append(f"        final: {_listed(map(_text, machine.final))}")
    if machine.invariants:
        lines.append("        invariants:")
    lines += [f"          {_text(state)}: {_text(str(condition))}" for state, condition in machine.invariants]
    if machine.tags:
        lines.append("        tags:")
    for state in dict.fromkeys(state for state, _ in machine.tags):
        own = _listed(_text(tag) for owner, tag in machine.tags if owner == state)
        lines.append(f"          {_text(state)}: {own}")
    if machine.exclusive:
        lines.append(f"        exclusive: {_listed(_listed(map(_text, group)) for group in machine.exclusive)}")
    lines.append("        transitions:" if machine.transitions else "        transitions: {}")
    lines += [f"          {_text(transition.id)}: {_transition(transition)}" for transition in machine.transitions]
    return lines


# A value that is the default is None or empty here, and is not written.


def _field(field: Field) -> str:
    unit = _text(field.unit) if field.unit != "1" else ""
    shape = _listed(map(str, field.shape)) if field.shape else ""
    return _flow(("type", field.type), ("unit", unit), ("shape", shape), ("doc", field.doc and _text(field.doc)))


def _channel(channel: Channel) -> str:
    capacity = str(channel.capacity) if channel.capacity != 1 else ""
    ends = ("from", channel.sender), ("to", channel.receiver), ("message", channel.message)
    return _flow(*ends, ("topic", channel.topic and _text(channel.topic)), ("capacity", capacity),
                 ("ensures", _formulas(channel.ensures)))  # fmt: skip


def _variable(variable: Variable) -> str:
    role = variable.role if variable.role != "local" else ""
    initial = _constant(variable.initial) if variable.initial is not None else ""
    unit = _text(variable.unit) if variable.unit != "1" else ""
    domain = ("", "")
    if isinstance(variable.domain, range):
        domain = ("range", f"[{variable.domain[0]}, {variable.domain[-1]}]")
    elif variable.domain:
        domain = ("values", _listed(_text(str(value)) for value in variable.domain))
    return _flow(("type", variable.type), ("role", role), ("initial", initial), domain, ("unit", unit))


def _transition(transition: Transition) -> str:
    event = transition.event and transition.event.channel + (
        f"({transition.event.name})" if transition.event.name else ""
    )
    sends = [f"{send.channel}({', '.join(map(str, send.payload))})" for send in transition.sends]
    return _flow(
        ("from", _text(transition.source)),
        ("to", _text(transition.target)),
        ("event", event),
        ("guard", transition.guard and _text(str(transition.guard))),
        ("action", transition.actions and _text("; ".join(map(str, transition.actions)))),
        ("message", sends and _text("; ".join(sends))),
        ("duration", transition.duration and _listed(map(repr, transition.duration))),
        ("weight", repr(transition.weight) if transition.weight != 1 else ""),
        ("ensures", _formulas(transition.ensures)),
        ("tags", transition.tags and _listed(map(_text, transition.tags))),
    )


def _formulas(formulas: Iterable[Formula]) -> str:
    return _flow(*((_text(each.name), _text(str(each.condition))) for each in formulas)) if formulas else ""


def _said(indent: int, *pairs: tuple[str, str]) -> list[str]:
    return [f"{' ' * indent}{key}: {_text(value)}" for key, value in pairs if value]


def _listed(items: Iterable[str]) -> str:
    return f"[{', '.join(items)}]"


def _flow(*pairs: tuple[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in pairs if value) + "}"


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
