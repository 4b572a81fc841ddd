"""A model to PlantUML's state diagrams: a composite state for each component, a region for each of its machines."""

from __future__ import annotations

import re

from parcours.model.conversion import Writing
from parcours.model.structure import Cefsm
from parcours_formats.diagram import states, undrawn

_MARKUP = re.compile(r"""["\\~%<>&`]|//+|--+|\*\*+|__+|\[\[+|\]\]+|''+|==+|\.\.+""")


def write(cefsm: Cefsm) -> Writing:
    """Return a model as text for PlantUML.

    Args:
        cefsm: a model without errors.

    Example:
    >>> from parcours.model import Component, Machine, Transition
    >>> light = Machine("light", "off", ("off", "on"), (Transition("switch", "off", "on"),), final=("on",))
    >>> print(write(Cefsm("lamp", (Component("Lamp", (light,)),))).text)
    @startuml
    title lamp
    state "Lamp" as c0 {
      state "off" as c0_m0_s0
      state "on" as c0_m0_s1
      [*] --> c0_m0_s0
      c0_m0_s0 --> c0_m0_s1 : switch (-/-/-/-)
      c0_m0_s1 --> [*]
    }
    @enduml
    <BLANKLINE>
    """
    lines = ["@startuml", f"title {_plain(cefsm.name)}", *states(cefsm, _plain), "@enduml", ""]
    return Writing("\n".join(lines), undrawn(cefsm))


def _plain(text: str) -> str:
    """Return a text in which nothing is markup.

    >>> _plain('a "b" //c//')
    'a <U+0022>b<U+0022> <U+002F><U+002F>c<U+002F><U+002F>'
    """
    return _MARKUP.sub(lambda match: "".join(f"<U+{ord(sign):04X}>" for sign in match[0]), text)
