"""The nodes of a data file become an input model, or findings about everything that keeps them from it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import get_args

from parcours.data.constraints import Constraint, substitute
from parcours.data.domains import Block, Closed, Domain, InputModel, Kind, split
from parcours.data.replicas import SCOPES, instances, n_instances, numbered
from parcours.errors import BadDomain, BadRequest, ParcoursError, one_of
from parcours.model.documents import Node, Scalar
from parcours.model.expression import (
    BOOL,
    INT,
    REAL,
    Expression,
    Literal,
    Name,
    Unary,
    evaluate,
    parse_expression,
    type_of,
)
from parcours.model.finding import Finding
from parcours.model.nodes import NodeReader, brief

FORMAT = "data/1"
"""The value of the key `parcours` in a file of this format."""

MAX_REPEAT = 100
"""How often a row may repeat its parameters."""

MAX_COLUMNS = 1000
"""Most columns of a row, and most constraints a file may stand for."""

_INTERVAL = re.compile(r"\s*([\[(])([^,]+),([^,]+)([\])])\s*")


class InputModelReader(NodeReader):
    """One reading of one file; what it cannot understand it adds to `findings` and goes on."""

    def __init__(self, origin: str, replaced: Mapping[str, float]) -> None:
        super().__init__(origin)
        self.replaced = replaced
        self.constants: dict[str, float] = {"pi": math.pi}

    def model(self, root: Node) -> InputModel:
        """Return the input model; it is fit for use only if no finding was added."""
        top = self.record(
            root,
            "an input model",
            ("parcours", "name", "parameters"),
            ("doc", "repeat", "constants", "constraints"),
        )
        form = self.text(top.get("parcours"), "parcours", FORMAT)
        if form != FORMAT:
            self.add(top["parcours"], "format", f"the format must be {FORMAT}, but is {brief(form)}")
        replicas = self.integer(top["repeat"], "repeat", 1, MAX_REPEAT) if "repeat" in top else 0
        self.read_constants(top.get("constants"))
        once = [
            domain
            for name, node, line in self.entries(top.get("parameters"), "parameters")
            if (domain := self.domain(name, node, line))
        ]
        if not once and not self.findings:
            self.add(top["parameters"], "parameters-none", "an input model must have a parameter, but has none")
        if len(once) * max(replicas, 1) > MAX_COLUMNS:
            self.add(
                top["parameters"],
                "columns",
                f"a row has at most {MAX_COLUMNS} columns, but this one would have {len(once) * replicas or len(once)}",
                "repeat it less often",
            )
            once = []
        domains = [numbered(domain, i) for i in range(1, replicas + 1) for domain in once] if replicas else once
        for double, n in Counter(domain.name for domain in domains).items():
            if n > 1:
                self.add(
                    top["parameters"],
                    "duplicate-name",
                    f"a name must be unique, but {n} parameters become {double!r} when numbered",
                    "rename one",
                )
        constraints = tuple(
            self.constraints(top.get("constraints"), [domain.name for domain in once], domains, replicas)
        )
        return InputModel(
            self.text(top.get("name"), "name"),
            tuple(domains),
            constraints,
            self.origin,
            self.text(top.get("doc"), "doc"),
            max(replicas, 1),
        )

    def read_constants(self, node: Node | None) -> None:
        """Add the constants of the file, or what replaces them, to `constants`."""
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
                raise BadRequest(
                    f"constant {name!r}",
                    f"only constants of {self.origin} can be replaced",
                    one_of(name, own),
                    slug="unknown-constant",
                )
            if not math.isfinite(value):
                raise BadRequest(f"constant {name!r}", f"it must be finite, but {value} given", slug="constant")

    def domain(self, name: str, node: Node, line: int) -> Domain | None:
        """Return the domain of one parameter, or None after adding findings that say why there is none."""
        before, what = len(self.findings), f"parameter {name!r}"
        record = self.record(node, what, ("unit",), ("doc", "kind", "range", "blocks", "edges", "closed"))
        unit = self.text(record.get("unit"), f"{what}: unit")
        doc = self.text(record.get("doc"), f"{what}: doc")
        kind = self.choice(record.get("kind"), f"{what}: kind", get_args(Kind), "real")
        closed = self.choice(record.get("closed"), f"{what}: closed", get_args(Closed), "right")
        edges = [self.number(item, what) for item in self.listed(record.get("edges"), f"{what}: edges")]
        blocks = [self.interval(item, what) for item in self.listed(record.get("blocks"), f"{what}: blocks")]
        stated = self.interval(record["range"], what) if "range" in record else None
        if name in self.constants:
            self.add(node, "duplicate-name", f"a name must be unique, but {name!r} is a constant already")
        if ("edges" in record) == ("blocks" in record):
            self.add(node, "blocks-or-edges", f"{what} must have either blocks or edges", "keep one of the two")
        if "closed" in record and "edges" not in record:
            self.add(record["closed"], "closed", f"{what}: closed goes with edges; blocks have brackets")
        if len(self.findings) > before:
            return None
        try:
            if "edges" in record:
                whole = split(name, unit, edges, closed="left" if closed == "left" else "right").blocks
            else:
                whole = tuple(block for block in blocks if block)
            return Domain(name, unit, whole, "integer" if kind == "integer" else "real", stated, doc)
        except BadDomain as error:
            self.findings.append(
                Finding(self.origin, line, "error", error.slug, f"{error.where}: {error.rule}", error.remedy)
            )
            return None

    def choice(self, node: Node | None, what: str, known: tuple[str, ...], absent: str) -> str:
        """Return one of a few words."""
        given = self.text(node, what, absent)
        if given not in known:
            self.add(node, "choice", f"{what} must be {' or '.join(known)}, but is {brief(given)}")
        return given

    def number(self, node: Node | None, what: str) -> float:
        """Return the number that an expression over the constants stands for."""
        return self.value(node.text, node, what) if isinstance(node, Scalar) else self.wrong(node, what)

    def wrong(self, node: Node | None, what: str) -> float:
        """Return 0 after noting that a node is no single value; a missing one was noted before."""
        self.text(node, what)
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

    def interval(self, node: Node, what: str) -> Block | None:
        """Return the block that a text such as `(1, 1.5]` stands for, or None after adding a finding."""
        text = self.text(node, what)
        parts = _INTERVAL.fullmatch(text)
        if not parts:
            self.add(
                node,
                "interval",
                f"{what}: a block must be written like (1, 1.5], but is {brief(text)}",
                "square brackets hold their end, round ones do not",
            )
            return None
        before = len(self.findings)
        low, high = self.value(parts[2].strip(), node, what), self.value(parts[3].strip(), node, what)
        if len(self.findings) > before:
            return None
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

    def constraints(
        self, node: Node | None, once: list[str], domains: list[Domain], replicas: int
    ) -> Iterator[Constraint]:
        """Yield the constraints over columns that the rules of the file stand for."""
        types = {domain.name: INT if domain.kind == "integer" else REAL for domain in domains}
        left = MAX_COLUMNS
        for name, entry, _ in self.entries(node, "constraints"):
            where = f"constraint {name!r}"
            record = self.record(entry, where, (), (*SCOPES, "doc"))
            doc = self.text(record.get("doc"), f"{where}: doc")
            scopes = [scope for scope in SCOPES if scope in record]
            if len(scopes) != 1 or (scopes != ["row"] and not replicas):
                self.add(
                    entry,
                    "constraint-scope",
                    f"{where} must have exactly one of row, and where parameters repeat, each and pairs",
                    "keep one",
                )
                continue
            (scope,) = scopes
            left -= n_instances(scope, replicas)
            if left < 0:
                self.add(entry, "columns", f"a file stands for at most {MAX_COLUMNS} constraints, but has more")
                return
            rule = self.parsed(record[scope], where, parse_expression, None)
            if rule is None:
                continue
            for full_name, instance in instances(name, scope, self.bound(rule), once, replicas):
                try:
                    given = type_of(instance, types, where=f"constraint {full_name!r}")
                except ParcoursError as error:
                    self.add(record[scope], error.slug, f"{error.where}: {error.rule}", error.remedy)
                    break
                if given != BOOL:
                    self.add(record[scope], "type", f"{where} must be true or false, but is {given}", "compare it")
                    break
                yield Constraint(full_name, instance, doc)
