"""Reads an input model from a YAML file of format `data/1`: domains, their blocks, and constraints.

The file may be hostile: it is read as plain data of bounded size, numbers and rules through the guard language, and
all errors are reported together, each with its line. docs/test-data.md describes the format.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Dict
from dataclasses import replace
from pathlib import Path
from typing import get_args

from parcours.data.blocks import Block, point
from parcours.data.constraints import Constraint, Over
from parcours.data.domains import Closed, Domain, Kind, split
from parcours.data.inputs import Group, InputModel, constraint_of
from parcours.data.naming import SCOPES, Scope, copies, instances, numbered_name
from parcours.errors import BadDomain, BadRequest, ParcoursError, one_of
from parcours.model.conversion import text_of
from parcours.model.documents import MAX_BYTES, Mapping, Node, Scalar, read_document
from parcours.model.expression import Expression, Literal, Name, Unary, evaluate, parse_expression
from parcours.model.expression.syntax import substitute
from parcours.model.finding import Finding, complaint
from parcours.model.nodes import NodeReader, brief, is_label

FORMAT = "data/1"
"""The value of the key `parcours` in a file of this format."""

MAX_REPEAT = 100
"""How often a row may repeat its parameters."""

MAX_COLUMNS = 1000
"""Most columns of a row, and most constraints a file may stand for."""

MAX_STRENGTH = 6
"""Most inputs that a criterion combines, short of all."""

OVER_BLOCKS = "blocks"
"""The key of a rule that speaks of the blocks of a row, not of its values."""

_INTERVAL = re.compile(r"\s*([\[(])([^,]+),([^,]+)([\])])\s*")
_OPTIONAL = ("doc", "kind", "range", "blocks", "edges", "values", "closed", "invalid", "base", "step", "components")


def read_input_model(path: Path | str, constants: Dict[str, float] | None = None) -> InputModel:
    """Return the input model that a file describes.

    Args:
        path: a YAML file of format data/1, UTF-8, at most 1 MB.
        constants: values that replace those of the file's constants, by name, in the units the file gives.

    Raises:
        BadDomain: the file cannot be read or is no input model; the message lists all findings with their
            lines.
        BadRequest: a constant to be replaced is not in the file, or its new value is not finite.
    """
    text = text_of(Path(path), MAX_BYTES, "an input model", BadDomain)
    return parse_input_model(text, str(path), constants)


def parse_input_model(text: str, origin: str, constants: Dict[str, float] | None = None) -> InputModel:
    """Return the input model that a text describes.

    Args:
        text: YAML of format data/1.
        origin: the file's name, for messages and as the model's source.
        constants: values that replace those of the text's constants, by name, in the units the text gives.

    Raises:
        BadDomain: the text is no input model; the message lists all findings with their lines.
        BadRequest: a constant to be replaced is not in the text, or its new value is not finite.

    >>> model = parse_input_model('''
    ... parcours: data/1
    ... name: two_discs
    ... repeat: 2
    ... parameters:
    ...   x: {unit: m, blocks: ["[0, 1]", "(1, 2]"]}
    ... constraints:
    ...   apart: {pairs: "abs(a.x - b.x) >= 0.2"}
    ... ''', "here")
    >>> model.names, [str(constraint) for constraint in model.constraints]
    (('x1', 'x2'), ['apart(1, 2): abs(x1 - x2) >= 0.2'])
    """
    root, findings = read_document(text, origin, "an input model")
    if root is None or findings:
        raise _complaint(findings)
    return input_model_of(root, origin, constants)


def input_model_of(root: Node, origin: str, constants: Dict[str, float] | None = None) -> InputModel:
    """Return the input model that a document describes, which may be part of another one. Raises as `parse_...`."""
    reader = _Reader(origin, constants or {})
    model = reader.model(root)
    if reader.findings:
        raise _complaint(reader.findings)
    return model


def _complaint(findings: list[Finding]) -> ParcoursError:
    return complaint(tuple(sorted(findings)), "an input model", BadDomain)


class _Reader(NodeReader):
    """One reading of one file; what it cannot understand it adds to `findings` and goes on."""

    def __init__(self, origin: str, replaced: Dict[str, float]) -> None:
        super().__init__(origin)
        self.constants = {"pi": math.pi}
        self.replaced = replaced

    def model(self, root: Node) -> InputModel:
        optional = ("doc", "repeat", "constants", "constraints", "groups")
        top = self.record(root, "an input model", ("parcours", "name", "parameters"), optional)
        form = self.text(top.get("parcours"), "parcours", FORMAT)
        if form != FORMAT:
            self.add(top["parcours"], "format", f"the format must be {FORMAT}, but is {brief(form)}")
        replicas = self.integer(top["repeat"], "repeat", 1, MAX_REPEAT) if "repeat" in top else 0
        self.read_constants(top.get("constants"))
        once = [
            domain
            for name, node, line in self.entries(top.get("parameters"), "parameters")
            for domain in self.domains(name, node, line)
        ]
        if not once and not self.findings:
            self.add(top["parameters"], "parameters-none", "an input model must have a parameter, but has none")
        if len(once) * max(replicas, 1) > MAX_COLUMNS:
            n = len(once) * replicas or len(once)
            rule = f"a row has at most {MAX_COLUMNS} columns, but this one would have {n}"
            self.add(top["parameters"], "columns", rule, "repeat it less often")
            once = []
        domains = once
        if replicas:
            numbers = range(1, replicas + 1)
            domains = [replace(domain, name=numbered_name(domain.name, i)) for i in numbers for domain in once]
        for double, n in Counter(domain.name for domain in domains).items():
            if n > 1:
                rule = f"a name must be unique, but {n} parameters become {double!r} when numbered"
                self.add(top["parameters"], "duplicate-name", rule, "rename one")
        return InputModel(
            self.text(top.get("name"), "name"),
            tuple(domains),
            tuple(self.constraints(top.get("constraints"), [domain.name for domain in once], domains, replicas)),
            self.origin,
            self.text(top.get("doc"), "doc"),
            max(replicas, 1),
            tuple(self.groups(top.get("groups"), [domain.name for domain in once], domains, replicas)),
        )

    def read_constants(self, node: Node | None) -> None:
        for name, entry, line in self.entries(node, "constants"):
            what = f"constant {name!r}"
            record = self.record(entry, what, ("value", "unit"), ("doc",))
            if name in self.constants:
                self.findings.append(Finding(self.origin, line, "error", "duplicate-name", "pi is given already"))
                continue
            value = self.number(record.get("value"), what)
            self.constants[name] = self.replaced.get(name, value)
            self.text(record.get("unit"), f"{what}: unit")
            self.text(record.get("doc"), f"{what}: doc")
        for name, value in self.replaced.items():
            own = sorted(self.constants.keys() - {"pi"})
            if name not in own:
                rule = f"only constants of {self.origin} can be replaced"
                raise BadRequest(f"constant {name!r}", rule, one_of(name, own), slug="unknown-constant")
            if not math.isfinite(value):
                raise BadRequest(f"constant {name!r}", f"it must be finite, but {value} given", slug="constant")

    def groups(
        self, node: Node | None, once: Sequence[str], domains: Sequence[Domain], replicas: int
    ) -> Iterator[Group]:
        for entry in self.listed(node, "groups"):
            record = self.record(entry, "a group", ("of", "strength"), ("doc",))
            self.text(record.get("doc"), "a group: doc")
            if "strength" not in record:
                continue
            strength = self.integer(record["strength"], "the strength of a group", 1, MAX_STRENGTH)
            named = [(item, self.text(item, "a group: of")) for item in self.listed(record.get("of"), "a group: of")]
            names = [name for _, name in named]
            is_repeated = bool(replicas) and all(name in once for name in names)
            known = [*once] if is_repeated else [domain.name for domain in domains]
            for item, name in named:
                if name not in known or names.count(name) > 1:
                    rule = f"a group must name each input once, but {brief(name)} is unknown or named twice"
                    self.add(item, "group", rule, one_of(name, known[:20]))
            if len(names) < strength:
                self.add(entry, "group", f"a group must have {strength} inputs or more, but has {len(names)}")
            for i in range(1, replicas + 1) if is_repeated else (0,):
                yield Group(tuple(numbered_name(name, i) if i else name for name in names), strength)

    def constraints(
        self, node: Node | None, once: list[str], domains: list[Domain], replicas: int
    ) -> Iterator[Constraint]:
        left = MAX_COLUMNS
        for name, entry, _ in self.entries(node, "constraints"):
            where = f"constraint {name!r}"
            record = self.record(entry, where, (), (*SCOPES, OVER_BLOCKS, "doc"))
            doc = self.text(record.get("doc"), f"{where}: doc")
            keys = [key for key in (*SCOPES, OVER_BLOCKS) if key in record]
            if len(keys) != 1 or (keys[0] in ("each", "pairs") and not replicas):
                said = f"{where} must have exactly one of row, blocks, and where parameters repeat, each and pairs"
                self.add(entry, "constraint-scope", said, "keep one")
                continue
            (key,) = keys
            scope: Scope = "each" if key == "each" else "pairs" if key == "pairs" else "row"
            left -= len(copies(scope, replicas))
            if left < 0:
                self.add(entry, "columns", f"a file stands for at most {MAX_COLUMNS} constraints, but has more")
                return
            rule = self.parsed(record[key], where, parse_expression, None)
            if rule is None:
                continue
            for full_name, instance in instances(name, scope, self.bound(rule), once, replicas):
                try:
                    over: Over = "blocks" if key == OVER_BLOCKS else "values"
                    yield constraint_of(full_name, instance, domains, over=over, doc=doc)
                except ParcoursError as error:
                    self.add(record[key], error.slug, f"{error.where}: {error.rule}", error.remedy)
                    break

    def domains(self, name: str, node: Node, line: int) -> list[Domain]:
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
            if len(self.findings) == before:  # else it follows from a number that could not be read
                self.findings.append(
                    Finding(self.origin, line, "error", error.slug, f"{error.where}: {error.rule}", error.remedy)
                )
            return None

    def measured(self, name: str, unit: str, kind: str, record: Dict[str, Node]) -> Domain:
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
        words: list[str] = []
        blocks = self.word_blocks(record["values"], f"{what}: values", words)
        invalid = self.word_blocks(record["invalid"], f"{what}: invalid", words) if "invalid" in record else ()
        return Domain(name, "1", blocks, "enumeration", values=tuple(words), invalid=invalid)

    def word_blocks(self, node: Node, what: str, words: list[str]) -> tuple[Block, ...]:
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
        return (node,) if isinstance(node, Scalar) else self.listed(node, what)

    def intervals(self, node: Node, what: str, is_angle: bool) -> tuple[Block, ...]:
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
        if node is None:
            return (0,)
        known = domain.labels[: len(domain.blocks)]
        found = []
        for item in self.items(node, f"{what}: base"):
            label = self.text(item, f"{what}: base")
            if label in known:
                found.append(known.index(label))
            else:
                self.add(item, "block-base", f"{what}: a base must be one of its blocks, but {brief(label)} is not one",
                         one_of(label, known))  # fmt: skip
        return tuple(dict.fromkeys(found)) or (0,)

    def choice(self, node: Node | None, what: str, known: tuple[str, ...], absent: str) -> str:
        given = self.text(node, what, absent)
        if given not in known:
            self.add(node, "choice", f"{what} must be {' or '.join(known)}, but is {brief(given)}")
        return given

    def number(self, node: Node | None, what: str) -> float:
        if isinstance(node, Scalar):
            return self.value(node.text, node, what)
        self.text(node, what)  # notes that it is not one; a missing one was noted before
        return 0.0

    def value(self, text: str, node: Node, what: str) -> float:
        try:
            found = evaluate(self.bound(parse_expression(text, what)), {}, what)
        except ParcoursError as error:
            self.add(node, error.slug, f"{error.where}: {error.rule}", error.remedy)
            return 0.0
        if isinstance(found, bool) or not isinstance(found, int | float):
            self.add(node, "number", f"{what}: a number must stand here, but {brief(text)} is not one")
            return 0.0
        return float(found)

    def interval(self, node: Node, what: str, is_angle: bool = False) -> Block | None:
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

        def number(node: Expression) -> Expression | None:
            if isinstance(node, Name) and node.id in self.constants:
                value = self.constants[node.id]
                return Unary("-", Literal(-value)) if value < 0 else Literal(value)
            return None

        return substitute(tree, number)
