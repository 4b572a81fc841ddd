"""Builds dataclasses from nodes of YAML by their type hints; numbers are expressions that may name inputs.

A mapping becomes a dataclass whose fields are its keys, a list a tuple. Where several dataclasses are possible, the
field that all of them have as a `Literal` says which (`kind: car`). What a dataclass refuses is reported with its line.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, Literal, Union, get_args, get_origin

from parcours.errors import ParcoursError, one_of
from parcours.model.documents import Mapping as MappingNode
from parcours.model.documents import Node, Scalar, Sequence
from parcours.model.expression import evaluate, parse_expression
from parcours.model.finding import advice
from parcours.model.nodes import NodeReader, brief, shown
from parcours_navigation.worlds.units import fault_of, unit_of

UNITS = {"s": 1.0, "s2": 1.0, "pi": 3.141592653589793}
"""Names that every number may use, so that `1.3 m/s`, `90 deg/s` and `1 m/s2` can be written."""

_TEXTS = ("kind", "motion", "ends", "at_walls", "tracks", "protocol")
"""Keys of plain data whose values are texts."""

_REMEDIES = {
    "kind": "see docs/worlds.md for an example",
    "value": "give as many",
    "number": "write a number, with a unit or without",
    "format": "write parcours: world/1",
    "case-id": "rename it",
}
"""What to do where a finding does not say."""

_NOTHING = ("none", "null", "~")


class Builder(NodeReader):
    """One reading of a document; `findings` grows as it goes.

    Args:
        values: what the names in numbers stand for, beside UNITS.
        units: in which they are.
    """

    def __init__(self, origin: str, values: Mapping[str, float], units: Mapping[str, str] | None = None) -> None:
        super().__init__(origin)
        self.units = units or {}
        self.values = {**UNITS, **values}

    def add(self, node: Node | None, slug: str, rule: str, remedy: str = "") -> None:
        """Note that something is wrong at the node's line."""
        super().add(node, slug, rule, remedy or _REMEDIES.get(slug, ""))

    def build(self, hint: Any, node: Node, what: str) -> Any:
        """Return the value of a type that a node describes; after a finding it means nothing."""
        if hint is float or hint is int:
            return self.quantity(node, what, whole=hint is int)
        if hint is bool:
            return self._one_of(node, what, ("true", "false")) == "true"
        if hint is str:
            return self.text(node, what)
        origin, arguments = get_origin(hint), get_args(hint)
        if origin is Literal:
            return self._one_of(node, what, arguments)
        if origin in (Union, types.UnionType):
            return self._either(arguments, node, what)
        if origin is tuple:
            return self._tuple(arguments, node, what)
        if origin is dict:
            return self._one_plain(node, what)
        return self.made(hint, node, what)

    def quantity(self, node: Node, what: str, *, whole: bool = False, holder: str = "") -> float | int:
        """Return what an expression comes to, in SI units; `holder` is the kind of what has it."""
        if not isinstance(node, Scalar):
            self.add(node, "kind", f"{what} must be a number, but is {shown(node)}")
            return 0
        text = node.text.strip()
        if text in ("inf", ".inf") and not whole:
            return float("inf")
        share = text.endswith("%")
        try:
            number = parse_expression(f"({text[:-1]}) / 100" if share else text, what)
            found = evaluate(number, self.values, what)
        except ParcoursError as error:
            known = [name for name in self.values if name not in UNITS]
            named = one_of(text, known) if known else "numbers may name inputs under `data`"
            remedy = error.remedy or (named if text.isidentifier() else "write a number, as 0.5, 22 cm, 90 deg or 5 %")
            self.add(node, error.slug, f"{what}: {error.rule}", remedy)
            return 0
        if isinstance(found, bool) or not isinstance(found, int | float):
            self.add(node, "number", f"{what}: a number must stand here, but {brief(text)} is not one")
            return 0
        if not math.isfinite(found):
            self.add(node, "number", f"{what}: a finite number must stand here, but {brief(text)} is {found:g}")
            return 0
        unit = unit_of(what, holder)
        if fault := fault_of(number, unit, self.units) or (share and unit not in ("1", "") and f"it must be in {unit}"):
            self.add(node, "world-unit", f"{what}: {fault}: {brief(text)}", "give it in that unit, or without one")
        if whole and found != round(found):
            self.add(node, "number", f"{what}: a whole number must stand here, but {brief(text)} is {found:g}")
        return round(found) if whole else float(found)

    def plain(self, node: Node, what: str, holder: str = "") -> Any:
        """Return a tree as plain data: mappings, lists, numbers where a scalar is an expression, truth, else texts."""
        if isinstance(node, MappingNode):
            kinds = [value.text for key, value in node.items if key.text == "motion" and isinstance(value, Scalar)]
            return {
                key.text: value.text
                if key.text in _TEXTS and isinstance(value, Scalar)
                else self.plain(value, f"{what}, {key.text}", *kinds)
                for key, value in node.items
            }
        if isinstance(node, Sequence):
            return [self.plain(item, what, holder) for item in node.items]
        text = node.text.strip()
        if not node.plain or (text.replace("-", "").replace("_", "").isalpha() and text not in self.values):
            return {"true": True, "false": False, "inf": float("inf")}.get(text, text) if node.plain else node.text
        return self.quantity(node, what, holder=holder)

    def _one_plain(self, node: Node, what: str) -> dict[str, Any]:
        if isinstance(node, MappingNode):
            return dict(self.plain(node, what))
        self.add(node, "kind", f"{what} must be a mapping, but is {shown(node)}", "write {key: value, ...}")
        return {}

    def made(self, cls: Any, node: Node, what: str) -> Any:
        """Return the dataclass that a mapping describes, or None after a finding."""
        hints, fields = hints_of(cls), {one.name: one for one in dataclasses.fields(cls) if one.init}
        required = tuple(name for name, one in fields.items() if _is_required(one))
        before = len(self.findings)
        items = self.record(node, what, required, tuple(name for name in fields if name not in required))
        given = {name: self.build(hints[name], one, f"{what}, {name}") for name, one in items.items()}
        if len(self.findings) > before:
            return None
        try:
            return cls(**given)
        except ParcoursError as error:
            at = error.where.rpartition(", ")[2]
            self.add(items.get(at, node), error.slug, f"{error.where}: {error.rule}", error.remedy)
            return None

    def _one_of(self, node: Node, what: str, known: tuple[str, ...]) -> str:
        text = self.text(node, what)
        if text not in known:
            self.add(node, "choice", f"{what} must be {' or '.join(known)}, but is {brief(text)}",
                     advice(text, known, self.findings))  # fmt: skip
            return known[0]
        return text

    def _either(self, kinds: tuple[Any, ...], node: Node, what: str) -> Any:
        if type(None) in kinds:
            if isinstance(node, Scalar) and node.plain and node.text in _NOTHING:
                return None
            kinds = tuple(kind for kind in kinds if kind is not type(None))
        if len(kinds) == 1:
            return self.build(kinds[0], node, what)
        if not all(dataclasses.is_dataclass(kind) for kind in kinds):  # a single value, or a list of them
            listed = [kind for kind in kinds if get_origin(kind) is tuple]
            plain = [kind for kind in kinds if get_origin(kind) is not tuple]
            chosen = listed if isinstance(node, Sequence) or not plain else plain
            return self.build(chosen[0], node, what)
        field, by_name = _tags(kinds)
        if not isinstance(node, MappingNode):
            self.add(node, "kind", f"{what} must be a mapping, but is {shown(node)}", f"write {{{field}: ...}}")
            return None
        tag = next((value for key, value in node.items if key.text == field), None)
        if tag is None:
            self.add(node, "missing-key", f"{what} must have the key {field!r}, but has not",
                     f"one of {', '.join(by_name)}")  # fmt: skip
            return None
        return self.made(by_name[self._one_of(tag, f"{what}, {field}", tuple(by_name))], node, what)

    def _tuple(self, arguments: tuple[Any, ...], node: Node, what: str) -> tuple[Any, ...]:
        items = self.listed(node, what)
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return tuple(self.build(arguments[0], item, f"{what} {k}") for k, item in enumerate(items, 1))
        if len(items) != len(arguments):
            if isinstance(node, Sequence):
                self.add(node, "value", f"{what} must have {len(arguments)} items, but has {len(items)}")
            return ()
        pairs = enumerate(zip(arguments, items, strict=True))
        return tuple(self.build(hint, item, f"{what}[{k}]") for k, (hint, item) in pairs)


@functools.cache
def hints_of(cls: Any) -> dict[str, Any]:
    """Return the types of a dataclass's fields."""
    return typing.get_type_hints(cls)


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


@functools.cache
def _tags(kinds: tuple[Any, ...]) -> tuple[str, dict[str, Any]]:
    """Return the field that tells dataclasses apart, and which of them has which of its words."""
    for name, hint in hints_of(kinds[0]).items():
        if get_origin(hint) is Literal:
            return name, {word: kind for kind in kinds for word in get_args(hints_of(kind)[name])}
    raise TypeError(f"{kinds} have no field that tells them apart")
