"""Turns names of foreign files into names that a model may have: valid, unique, and as similar as possible."""

from __future__ import annotations

import re
from collections.abc import Iterable

from parcours.model.expression.parsing import RESERVED
from parcours.model.finding import MAX_LABEL
from parcours.model.structure import ENVIRONMENT

_FOREIGN = re.compile(r"[^A-Za-z0-9_]+")


class UniqueNames:
    """Hands out names of one kind, each once; a second bearer of a name gets a number behind it.

    >>> names = UniqueNames()
    >>> [names.label(wanted) for wanted in ("v_Login", "v_Login", "two\\nlines", "")]
    ['v_Login', 'v_Login_2', 'two lines', 'unnamed']
    >>> [UniqueNames().identifier(wanted) for wanted in ("PUT !3", "not", "7th")]
    ['PUT_3', 'not_', '_7th']
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._next: dict[str, int] = {}

    def label(self, wanted: str) -> str:
        """Return a name for a state, a transition or a machine."""
        return self._once(as_label(wanted))

    def identifier(self, wanted: str) -> str:
        """Return a name that guards can say."""
        return self._once(as_identifier(wanted))

    def _once(self, name: str) -> str:
        # The number last given is kept: a million bearers of one name cost a million steps, not their square.
        given = name
        while given in self._taken:
            number = self._next[name] = self._next.get(name, 1) + 1
            given = f"{name[: MAX_LABEL - 9]}_{number}"
        self._taken.add(given)
        return given


def as_label(wanted: str) -> str:
    """Return the nearest printable line: blanks joined, other signs left out, cut at the longest name.

    >>> as_label("  a\\t b\\u2028 ")
    'a b'
    """
    if not (0 < len(wanted) <= MAX_LABEL and wanted.isprintable() and wanted[0] != " " != wanted[-1]):
        joined = " ".join(wanted[: 4 * MAX_LABEL].split())
        wanted = "".join(filter(str.isprintable, joined))[:MAX_LABEL].strip() or "unnamed"
    return wanted


def as_identifier(wanted: str) -> str:
    """Return the nearest name that guards can say; what is no letter or digit becomes `_`.

    >>> as_identifier("ACK+PSH(V,V,1)")
    'ACK_PSH_V_V_1'
    """
    name = _FOREIGN.sub("_", wanted[:MAX_LABEL])
    if name != wanted:
        name = name.strip("_")
    if not name or name[0].isdigit():
        name = f"_{name}"[:MAX_LABEL] if name else "unnamed"
    return f"{name}_" if name in RESERVED or name == ENVIRONMENT else name


def joint_name(component: str, machine: str, *, alone: bool) -> str:
    """Return one name for a machine of a component, for formats that have one level only; `part_names` inverts it.

    >>> joint_name("Lamp", "light", alone=True), joint_name("my_lamp", "my lamp", alone=True)
    ('Lamp/light', 'my lamp')
    """
    return machine if alone and "/" not in machine and as_identifier(machine) == component else f"{component}/{machine}"


def part_names(joint: str) -> tuple[str, str]:
    """Return component and machine of a joint name.

    >>> part_names("Lamp/light"), part_names("my lamp")
    (('Lamp', 'light'), ('my_lamp', 'my lamp'))
    """
    component, _, machine = joint.partition("/")
    return as_identifier(component), as_label(machine or component)


def stem(origin: str) -> str:
    """Return what to call a model that its file does not name.

    >>> stem("models/tea machine.aut")
    'tea machine'
    """
    name = origin.replace("\\", "/").rpartition("/")[2]
    return as_label(name.rpartition(".")[0] or name)
