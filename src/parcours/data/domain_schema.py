"""Reads the parameters of a data file as domains."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping as Dict
from dataclasses import replace
from typing import get_args

from parcours.data.blocks import Block, point
from parcours.data.domains import Closed, Domain, Kind, split
from parcours.errors import BadDomain, ParcoursError, one_of
from parcours.model.documents import Mapping, Node, Scalar
from parcours.model.expression import Expression, Literal, Name, Unary, evaluate, parse_expression
from parcours.model.expression.syntax import substitute
from parcours.model.finding import Finding
from parcours.model.nodes import NodeReader, brief, is_label

_INTERVAL = re.compile(r"\s*([\[(])([^,]+),([^,]+)([\])])\s*")
_OPTIONAL = ("doc", "kind", "range", "blocks", "edges", "values", "closed", "invalid", "base", "step", "components")


class DomainReader(NodeReader):
    """Reads parameters; what it cannot understand it adds to `findings` and goes on."""

    def __init__(self, origin: str, constants: Dict[str, float]) -> None:
        super().__init__(origin)
        self.constants = dict(constants)

    def domains(self, name: str, node: Node, line: int) -> list[Domain]:
        """Return the domain of a parameter, one for each component of a vector, or none after adding findings."""
        one = self.domain(name, node, line)
        components = {key.text: value for key, value in node.items} if isinstance(node, Mapping) else {}
        if one is None or "components" not in components:
            return [one] if one else []
        parts = [
            self.identifier(item, f"a component of {name!r}")
            for item in self.listed(components["components"], f"parameter {name!r}: components")
        ]
        if len(set(parts)) < len(parts) or not parts:
            self.add(components["components"], "components", f"parameter {name!r} must have different components")
        return [replace(one, name=f"{name}.{part}") for part in parts]

    def domain(self, name: str, node: Node, line: int) -> Domain | None:
        """Return the domain of a parameter, or None after adding findings that say why there is none."""
        before, what = len(self.findings), f"parameter {name!r}"
        given = {key.text: value for key, value in node.items} if isinstance(node, Mapping) else {}
        kind = self.choice(given.get("kind"), f"{what}: kind", get_args(Kind), "real")
        required = () if kind == "enumeration" else ("unit",)
        record = self.record(node, what, required, (*_OPTIONAL, "unit"))
        unit = self.text(record.get("unit"), f"{what}: unit", "1")
        doc = self.text(record.get("doc"), f"{what}: doc")
        if name in self.constants:
            self.add(node, "duplicate-name", f"a name must be unique, but {name!r} is a constant already")
        ways = [key for key in ("blocks", "edges", "values") if key in record]
        if len(ways) != 1 or (kind == "enumeration") > (ways == ["values"]):
            rule = f"{what} must have values" if kind == "enumeration" else f"{what} must have either blocks or edges"
            self.add(node, "blocks-or-edges", rule + ", and one of blocks, edges and values only", "keep one of them")
        if "closed" in record and "edges" not in record:
            self.add(record["closed"], "closed", f"{what}: closed goes with edges; blocks have brackets")
        if len(self.findings) > before:
            return None
        stated = self.interval(record["range"], what) if "range" in record else None
        step = self.number(record["step"], f"{what}: step") if "step" in record else None
        if step is not None and step <= 0:
            self.add(record["step"], "step", f"{what}: a step must be positive, but is {step:g}")
        try:
            found = self.named(name, record, what) if kind == "enumeration" else self.measured(name, unit, kind, record)
            if len(self.findings) > before:
                return None
            found = replace(found, unit=unit, doc=doc, stated=stated, step=step)
            return replace(found, bases=self.bases(record.get("base"), found, what))
        except BadDomain as error:
            self.findings.append(
                Finding(self.origin, line, "error", error.slug, f"{error.where}: {error.rule}", error.remedy)
            )
            return None

    def measured(self, name: str, unit: str, kind: str, record: Dict[str, Node]) -> Domain:
        """Return a domain of numbers; `stated`, bases and the like are left to the caller."""
        what = f"parameter {name!r}"
        number: Kind = "integer" if kind == "integer" else "angle" if kind == "angle" else "real"
        if "edges" in record:
            edges = [self.number(item, what) for item in self.listed(record["edges"], f"{what}: edges")]
            closed = self.choice(record.get("closed"), f"{what}: closed", get_args(Closed), "right")
            blocks = split(name, unit, edges, closed="left" if closed == "left" else "right", kind=number).blocks
        elif "values" in record:
            found = sorted(self.number(item, what) for item in self.listed(record["values"], f"{what}: values"))
            blocks = tuple(point(value) for value in found)
        else:
            blocks = self.intervals(record["blocks"], f"{what}: blocks", kind == "angle")
        invalid = self.intervals(record["invalid"], f"{what}: invalid", False) if "invalid" in record else ()
        return Domain(name, unit, blocks, number, invalid=invalid)

    def named(self, name: str, record: Dict[str, Node], what: str) -> Domain:
        """Return an enumeration: from a list of values, or a mapping from blocks to their values."""
        words: list[str] = []
        blocks = self.word_blocks(record["values"], f"{what}: values", words)
        invalid = self.word_blocks(record["invalid"], f"{what}: invalid", words) if "invalid" in record else ()
        return Domain(name, "1", blocks, "enumeration", values=tuple(words), invalid=invalid)

    def word_blocks(self, node: Node, what: str, words: list[str]) -> tuple[Block, ...]:
        """Return the blocks that a list or mapping of values makes, and add the values to `words`."""
        blocks = []
        groups: list[tuple[str, tuple[Node, ...]]] = (
            [(key.text, self.items(value, what)) for key, value in node.items]
            if isinstance(node, Mapping)
            else [("", (item,)) for item in self.listed(node, what)]
        )
        for group, items in groups:
            first = len(words)
            words += [self.label(item, f"a value of {what}") for item in items]
            if len(words) > first:
                blocks.append(Block(first, len(words) - 1, name=group or words[first]))
        return tuple(blocks)

    def items(self, node: Node, what: str) -> tuple[Node, ...]:
        """Return the items of a list, or a single value as the only one."""
        return (node,) if isinstance(node, Scalar) else self.listed(node, what)

    def intervals(self, node: Node, what: str, is_angle: bool) -> tuple[Block, ...]:
        """Return the blocks of a list of intervals, or of a mapping from names to intervals."""
        if isinstance(node, Mapping):
            pairs = [(key.text, value) for key, value in node.items]
            for key, _ in node.items:
                if not is_label(key.text):
                    self.add(key, "name", f"a name of {what} must be one printable line, but is {brief(key.text)}")
        else:
            pairs = [("", item) for item in self.listed(node, what)]
        found = [(name, self.interval(item, what, is_angle)) for name, item in pairs]
        blocks = [replace(block, name=name) for name, block in found if block]
        for index in range(1, len(blocks) if is_angle else 0):
            if blocks[index].low < blocks[index - 1].low:  # the circle goes on beyond pi
                low, high = (end + 2.0 * math.pi for end in (blocks[index].low, blocks[index].high))
                blocks[index] = replace(blocks[index], low=low, high=high)
        return tuple(blocks)

    def bases(self, node: Node | None, domain: Domain, what: str) -> tuple[int, ...]:
        """Return the indices of the blocks that a list of their names, or one name, stands for."""
        if node is None:
            return (0,)
        known = domain.labels[: len(domain.blocks)]
        found = []
        for item in self.items(node, f"{what}: base"):
            label = self.text(item, f"{what}: base")
            if label in known:
                found.append(known.index(label))
            else:
                self.add(item, "block-base", f"{what}: a base must be one of its blocks, but {brief(label)} is none",
                         one_of(label, known))  # fmt: skip
        return tuple(dict.fromkeys(found)) or (0,)

    def choice(self, node: Node | None, what: str, known: tuple[str, ...], absent: str) -> str:
        """Return one of a few words."""
        given = self.text(node, what, absent)
        if given not in known:
            self.add(node, "choice", f"{what} must be {' or '.join(known)}, but is {brief(given)}")
        return given

    def number(self, node: Node | None, what: str) -> float:
        """Return the number that an expression over the constants stands for."""
        if isinstance(node, Scalar):
            return self.value(node.text, node, what)
        self.text(node, what)  # notes that it is none; a missing one was noted before
        return 0.0

    def value(self, text: str, node: Node, what: str) -> float:
        """Return the number that a text at a node stands for, or 0 after adding a finding."""
        try:
            found = evaluate(self.bound(parse_expression(text, what)), {}, what)
        except ParcoursError as error:
            self.add(node, error.slug, f"{error.where}: {error.rule}", error.remedy)
            return 0.0
        if isinstance(found, bool) or not isinstance(found, int | float):
            self.add(node, "number", f"{what}: a number must stand here, but {brief(text)} is none")
            return 0.0
        return float(found)

    def interval(self, node: Node, what: str, is_angle: bool = False) -> Block | None:
        """Return the block that a text such as `(1, 1.5]` or `2` stands for, or None after adding a finding.

        An angle may fall: (3, -3] goes on beyond pi.
        """
        text = self.text(node, what)
        if isinstance(node, Scalar) and text.strip() and text.strip()[0] not in "[(":
            value = self.value(text, node, what)
            return point(value) if math.isfinite(value) else None
        parts = _INTERVAL.fullmatch(text)
        if not parts:
            rule = f"{what}: a block must be written like (1, 1.5], but is {brief(text)}"
            self.add(node, "interval", rule, "square brackets hold their end, round ones do not")
            return None
        before = len(self.findings)
        low, high = self.value(parts[2].strip(), node, what), self.value(parts[3].strip(), node, what)
        if len(self.findings) > before:
            return None
        if is_angle and high < low:
            high += 2.0 * math.pi
        try:
            return Block(low, high, low_closed=parts[1] == "[", high_closed=parts[4] == "]")
        except BadDomain as error:
            self.add(node, error.slug, f"{what}: {error.where}: {error.rule}", error.remedy)
            return None

    def bound(self, tree: Expression) -> Expression:
        """Return the tree with the numbers of the constants in place of their names."""

        def number(node: Expression) -> Expression | None:
            if isinstance(node, Name) and node.id in self.constants:
                value = self.constants[node.id]
                return Unary("-", Literal(-value)) if value < 0 else Literal(value)
            return None

        return substitute(tree, number)
