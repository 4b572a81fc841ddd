"""A model to Mermaid's stateDiagram-v2: a composite state for each component, a region for each of its machines."""

from __future__ import annotations

import re

from parcours.model.conversion import Loss, Writing
from parcours.model.structure import Cefsm
from parcours_formats.diagram import states, undrawn

_MARKUP = re.compile(r"""["\\#;:%<>&\[\]{}`~*_]|--+""")


def write(cefsm: Cefsm) -> Writing:
    """Return a model as text for Mermaid.

    Args:
        cefsm: a model without errors.

    Example:
    >>> from parcours.model import Component, Machine, Transition
    >>> light = Machine("light", "off", ("off", "on"), (Transition("switch", "off", "on"),), final=("on",))
    >>> print(write(Cefsm("lamp", (Component("Lamp", (light,)),))).text)
    stateDiagram-v2
      state "Lamp" as c0 {
        state "off" as c0_m0_s0
        state "on" as c0_m0_s1
        [*] --> c0_m0_s0
        c0_m0_s0 --> c0_m0_s1 : switch (-/-/-/-)
        c0_m0_s1 --> [*]
      }
    <BLANKLINE>
    """
    lines = ["stateDiagram-v2", *(f"  {line}" for line in states(cefsm, _plain)), ""]
    return Writing("\n".join(lines), (Loss(f"model {cefsm.name!r}", 0, "its name is not drawn"), *undrawn(cefsm)))


def _plain(text: str) -> str:
    """Return a text in which nothing is markup.

    >>> _plain('a "b"; c')
    'a #34;b#34;#59; c'
    """
    return _MARKUP.sub(lambda match: "".join(f"#{ord(sign)};" for sign in match[0]), text)
