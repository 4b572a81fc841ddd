"""Reads nodes of YAML as durations, frequencies, numbers or plain values."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, TypeAlias

from parcours.model.documents import Mapping, Node, Scalar, Sequence
from parcours.model.nodes import NodeReader, shown
from parcours.run.binding.structure import Constant, Value

_DURATION = re.compile(r"(?P<number>[0-9]{1,12}(?:\.[0-9]{0,12})?)\s*(?P<unit>s|ms|us|Hz|min)?", re.ASCII)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, None: 1.0}
_INT = re.compile(r"[-+]?[0-9]{1,19}", re.ASCII)
_REAL = re.compile(r"[-+]?(?:[0-9]{1,300}\.?[0-9]{0,300}|\.[0-9]{1,300})(?:[eE][-+]?[0-9]{1,3})?", re.ASCII)


Reads: TypeAlias = Callable[[Node, str], object]
"""Makes a value of a node; the text is what it is called in messages."""

Table: TypeAlias = dict[str, tuple[Reads, object]]
"""The keys of a mapping: how the value is read, and what it is where the key is missing."""


class QuantityReader(NodeReader):
    """Reads nodes whose values are quantities or plain data; `findings` grows as it goes."""

    def section(
        self, node: Node | None, what: str, table: Table, required: tuple[str, ...] = (), *, is_top: bool = False
    ) -> dict[str, Any]:
        """Return a value for each key of a table, from a mapping that has no other keys.

        In messages a value is called `'key' of WHAT`, at the top of a document only `'key'`.
        """
        items = self.record(node, what, required, tuple(key for key in table if key not in required))
        tail = "" if is_top else f" of {what}"
        # Every key is read even after a finding: a user is shown all that is wrong at once.
        return {
            key: read(items[key], f"{key!r}{tail}") if key in items else absent for key, (read, absent) in table.items()
        }

    def duration(self, node: Node | None, what: str, absent: float = 1.0) -> float:
        """Return a time above 0 [s] from a text such as `0.5`, `20 ms` or `50 Hz` (its period)."""
        if node is None:
            return absent
        match = _DURATION.fullmatch(node.text.strip()) if isinstance(node, Scalar) else None
        number = float(match["number"]) if match else 0.0
        if match is None or number <= 0.0:
            rule = f"{what} must be a time above 0, such as 0.5 s, 20 ms or 50 Hz, but is {shown(node)}"
            self.add(node, "value", rule)
            return absent
        return 1.0 / number if match["unit"] == "Hz" else number * _SECONDS[match["unit"]]

    def boolean(self, node: Node | None, what: str, absent: bool = False) -> bool:
        """Return true or false."""
        if node is None:
            return absent
        if not isinstance(node, Scalar) or node.text not in ("true", "false"):
            self.add(node, "value", f"{what} must be true or false, but is {shown(node)}")
            return absent
        return node.text == "true"

    def one_of(self, node: Node | None, what: str, known: tuple[str, ...], absent: str) -> str:
        """Return one word of a few."""
        text = self.text(node, what, absent)
        if text not in known:
            self.add(node, "value", f"{what} must be {' or '.join(known)}, but is {text[:40]!r}")
            return absent
        return text

    def choice(self, *known: str) -> Reads:
        """Return what reads one word of a few."""
        return lambda node, what: self.one_of(node, what, known, known[0])

    def words(self, node: Node | None, what: str) -> tuple[str, ...]:
        """Return the texts of a list."""
        return tuple(self.text(item, f"an item of {what}") for item in self.listed(node, what))


def constant(node: Scalar) -> Constant:
    """Return what a scalar means as plain data: true or false, an integer, a number, or its text.

    >>> [constant(Scalar(text, True, 1)) for text in ("true", "3", "-0.5", "map")], constant(Scalar("3", False, 1))
    ([True, 3, -0.5, 'map'], '3')
    """
    text = node.text
    if not node.plain:
        return text
    if text in ("true", "false"):
        return text == "true"
    if _INT.fullmatch(text):
        return int(text)
    if _REAL.fullmatch(text) and math.isfinite(float(text)):
        return float(text)
    return text


def plain(node: Node) -> Value:
    """Return a tree as plain data: scalars, tuples for lists, tuples of pairs for mappings.

    >>> plain(Sequence((Scalar("1", True, 1), Scalar("x", True, 1)), 1))
    (1, 'x')
    """
    if isinstance(node, Scalar):
        return constant(node)
    if isinstance(node, Sequence):
        return tuple(plain(item) for item in node.items)
    if isinstance(node, Mapping):
        return tuple((key.text, plain(value)) for key, value in node.items)
    raise AssertionError(node)
