"""Writes a model as a state diagram of PlantUML or Mermaid: components are composite states, machines are regions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from parcours.model.conversion import Writing
from parcours.model.drawing import predicate
from parcours.model.structure import Cefsm, Machine
from parcours_formats.losses import ASPECTS, Losses, unsaid


@dataclass(frozen=True, slots=True)
class Diagram:
    """A language of state diagrams: its first and last lines, and how it writes the code of a sign that is markup."""

    head: str
    tail: str
    indent: str
    markup: re.Pattern[str]
    code: str

    def write(self, cefsm: Cefsm) -> Writing:
        """Return a model as a diagram, in which predicates stand as the paper writes them."""
        losses = Losses()
        if "{}" not in self.head:
            losses.add(f"model {cefsm.name!r}", 0, "its name is not drawn")
        losses += unsaid(cefsm, ASPECTS - {"variables", "durations", "tags", "weights", "texts"})
        for component in cefsm.components:
            said = ", ".join(repr(machine.name) for machine in component.machines)
            losses.add(f"component {component.name!r}", component.line, f"its machines {said} are not named")
        for channel in cefsm.channels:
            what = f"its ends, {channel.sender!r} and {channel.receiver!r}, and its class are not drawn"
            losses.add(f"channel {channel.name!r}", channel.line, what)
        body = "".join(f"{self.indent}{line}\n" for line in self._states(cefsm))
        return Writing(f"{self.head.format(self._plain(cefsm.name))}\n{body}{self.tail}", tuple(losses))

    def _states(self, cefsm: Cefsm) -> Iterator[str]:
        for number, component in enumerate(cefsm.components):
            yield f'state "{self._plain(component.name)}" as c{number} {{'
            for at, machine in enumerate(component.machines):
                if at:
                    yield "  --"
                yield from (f"  {line}" for line in self._region(machine, f"c{number}_m{at}_s"))
            yield "}"

    def _region(self, machine: Machine, prefix: str) -> Iterator[str]:
        ids = {state: f"{prefix}{number}" for number, state in enumerate(machine.states)}
        for state, id in ids.items():
            yield f'state "{self._plain(state)}" as {id}'
        yield f"[*] --> {ids[machine.initial]}"
        for each in machine.transitions:
            yield f"{ids[each.source]} --> {ids[each.target]} : {self._plain(f'{each.id} {predicate(each)}')}"
        for state in machine.final:
            yield f"{ids[state]} --> [*]"

    def _plain(self, text: str) -> str:
        return self.markup.sub(lambda match: "".join(self.code.format(ord(sign)) for sign in match[0]), text)


plantuml = Diagram(
    "@startuml\ntitle {}",
    "@enduml\n",
    "",
    re.compile(r"""["\\~%<>&`]|//+|--+|\*\*+|__+|\[\[+|\]\]+|''+|==+|\.\.+"""),
    "<U+{:04X}>",
)
"""The format `plantuml`."""

mermaid = Diagram("stateDiagram-v2", "", "  ", re.compile(r"""["\\#;:%<>&\[\]{}`~*_]|--+"""), "#{};")
"""The format `mermaid`.

>>> from parcours.model import Component, Transition
>>> light = Machine("light", "off", ("off", "on"), (Transition("switch", "off", "on"),), final=("on",))
>>> print(mermaid.write(Cefsm("lamp", (Component("Lamp", (light,)),))).text, end="")
stateDiagram-v2
  state "Lamp" as c0 {
    state "off" as c0_m0_s0
    state "on" as c0_m0_s1
    [*] --> c0_m0_s0
    c0_m0_s0 --> c0_m0_s1 : switch (-/-/-/-)
    c0_m0_s1 --> [*]
  }
"""
