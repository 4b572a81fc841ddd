"""Reads single YAML nodes: a value of the kind that is wanted there, or a finding and a stand-in of that kind."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import TypeVar

from parcours.errors import BadModel
from parcours.model.documents import Mapping, Node, Scalar, Sequence
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.parsing import RESERVED
from parcours.model.finding import MAX_LABEL, Finding, advice
from parcours.model.structure import BASE_TYPES

_T = TypeVar("_T")

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_INT = re.compile(r"[-+]?[0-9]{1,19}", re.ASCII)
_REAL = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)


def is_identifier(name: str) -> bool:
    """Return whether guards and actions can say the name.

    >>> is_identifier("ob_data"), is_identifier("2nd"), is_identifier("not")
    (True, False, False)
    """
    return bool(_IDENTIFIER.fullmatch(name)) and name not in RESERVED and len(name) <= MAX_LABEL


def is_label(name: str) -> bool:
    """Return whether the name may be that of a state, a transition or a machine: one printable line, trimmed."""
    return 0 < len(name) <= MAX_LABEL and name.isprintable() and name == name.strip()


class NodeReader:
    """Reads nodes of one document; `findings` grows as it goes.

    A node that is None is one whose key is missing, which was reported where the key was looked for.
    """

    def __init__(self, origin: str) -> None:
        self.origin = origin
        self.findings: list[Finding] = []

    def add(self, node: Node | None, slug: str, rule: str, remedy: str = "") -> None:
        """Note that something is wrong at the node's line."""
        line = node.line if node is not None else 0
        self.findings.append(Finding(self.origin, line, "error", slug, rule, remedy))

    def record(
        self, node: Node | None, what: str, required: tuple[str, ...], optional: tuple[str, ...]
    ) -> dict[str, Node]:
        """Return the values of a mapping whose keys are fixed."""
        items: dict[str, Node] = {}
        if node is None:
            return items
        if not isinstance(node, Mapping):
            self.add(node, "kind", f"{what} must be a mapping, but is {shown(node)}", _keys(required))
            return items
        for key, value in node.items:
            if key.text in required or key.text in optional:
                items[key.text] = value
            else:
                rule = f"{what} has no key {brief(key.text)}"
                self.add(key, "unknown-key", rule, advice(key.text, [*required, *optional], self.findings))
        for name in required:
            if name not in items:
                self.add(node, "missing-key", f"{what} must have the key {name!r}, but has not", "add it")
        return items

    def entries(
        self, node: Node | None, what: str, name: Callable[[Node, str], str] | None = None
    ) -> Iterator[tuple[str, Node, int]]:
        """Yield name, value and line of each entry of a mapping from names of the user's choice."""
        if node is None or (isinstance(node, Scalar) and node.plain and node.text in ("", "~", "null")):
            return
        if not isinstance(node, Mapping):
            self.add(node, "kind", f"{what} must be a mapping, but is {shown(node)}", "write name: {...}")
            return
        for key, value in node.items:
            before = len(self.findings)  # an entry with a bad name is left out, so that nothing refers to it
            text = (name or self.identifier)(key, f"a name among the {what}")
            if len(self.findings) == before:
                yield text, value, key.line

    def listed(self, node: Node | None, what: str) -> tuple[Node, ...]:
        """Return the items of a list."""
        if node is None:
            return ()
        if not isinstance(node, Sequence):
            self.add(node, "kind", f"{what} must be a list, but is {shown(node)}", "write [a, b]")
            return ()
        return node.items

    def text(self, node: Node | None, what: str, absent: str = "") -> str:
        """Return the text of a scalar."""
        if node is None:
            return absent
        if not isinstance(node, Scalar):
            self.add(node, "kind", f"{what} must be a text, but is {shown(node)}")
            return absent
        return node.text

    def identifier(self, node: Node | None, what: str) -> str:
        """Return a name that guards and actions can say."""
        rule = "letters, digits and _, not starting with a digit, and no word of the guard language"
        return self._name(node, what, is_identifier, rule)

    def label(self, node: Node | None, what: str) -> str:
        """Return a name that is only shown: one printable line."""
        return self._name(node, what, is_label, f"1 to {MAX_LABEL} printable characters in one line")

    def integer(self, node: Node, what: str, low: int, high: int) -> int:
        """Return a whole number between bounds (inclusive)."""
        if isinstance(node, Scalar) and _INT.fullmatch(node.text) and low <= int(node.text) <= high:
            return int(node.text)
        self.add(node, "value", f"{what} must be an integer from {low} to {high}, but is {shown(node)}")
        return max(low, 0)

    def number(self, node: Node, what: str) -> float:
        """Return a number that is not negative, `inf` among them."""
        text = node.text if isinstance(node, Scalar) else ""
        if text in ("inf", ".inf"):
            return math.inf
        # Only digits of a bounded length are converted: a long one would cost quadratic time.
        if len(text) <= 400 and _REAL.fullmatch(text) and 0 <= float(text) < math.inf:
            return float(text)
        self.add(node, "value", f"{what} must be a number, 0 or more, or inf, but is {shown(node)}")
        return 0.0

    def constant(self, node: Node, type_: str, what: str) -> object:
        """Return the value of a base type that a scalar writes, or None."""
        if type_ not in BASE_TYPES:
            rule = f"only {', '.join(BASE_TYPES)} have an initial value, but {what} is of type {brief(type_)}"
            self.add(node, "initial", rule, "delete it")
            return None
        text = node.text if isinstance(node, Scalar) else None
        if text is not None:
            if type_ in ("enum", "text"):
                return text
            if type_ == "bool" and text in ("true", "false"):
                return text == "true"
            if type_ == "int" and _INT.fullmatch(text) and abs(int(text)) <= INTEGER_LIMIT:
                return int(text)
            if type_ == "real" and len(text) <= 400 and _REAL.fullmatch(text) and math.isfinite(float(text)):
                return float(text)
        self.add(node, "initial", f"the initial value of {what} must be of type {type_}, but is {shown(node)}")
        return None

    def parsed(self, node: Node | None, what: str, parse: Callable[[str, str], _T], absent: _T) -> _T:
        """Return what a parser of the guard language makes of a scalar."""
        if node is None:
            return absent
        if not isinstance(node, Scalar):
            self.add(node, "kind", f"{what} must be a text, but is {shown(node)}")
            return absent
        try:
            return parse(node.text, what)
        except BadModel as error:
            self.add(node, error.slug, f"{what}: {error.rule}", error.remedy)
            return absent

    def _name(self, node: Node | None, what: str, good: Callable[[str], bool], rule: str) -> str:
        if node is None:
            return ""
        if not isinstance(node, Scalar) or not good(node.text):
            self.add(node, "name", f"{what} must be {rule}, but is {shown(node)}")
            return ""
        return node.text


def shown(node: Node) -> str:
    """Return a node in a few words."""
    if isinstance(node, Scalar):
        return brief(node.text)
    return "a list" if isinstance(node, Sequence) else "a mapping"


def brief(text: str) -> str:
    """Return a text in quotes, cut when it is long."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _keys(required: tuple[str, ...]) -> str:
    return f"write {{{', '.join(f'{name}: ...' for name in required)}}}" if required else ""
