"""Reads an input model from a YAML file of format `data/1`: domains, their blocks, and constraints.

The file may be hostile: it is read as plain data of bounded size, numbers and rules through the guard language, and
everything wrong with it is said at once, each finding with its line. docs/test-data.md describes the format.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from parcours.data.constraints import Constraint
from parcours.data.domain_schema import DomainReader
from parcours.data.domains import Domain
from parcours.data.inputs import Group, InputModel, constraint_of
from parcours.data.naming import SCOPES, Scope, copies, instances, numbered_name
from parcours.errors import BadDomain, BadRequest, ParcoursError, one_of
from parcours.model.conversion import text_of
from parcours.model.documents import MAX_BYTES, Node, read_document
from parcours.model.expression import parse_expression
from parcours.model.finding import Finding, complaint
from parcours.model.nodes import brief

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


def read_input_model(path: Path | str, constants: Mapping[str, float] | None = None) -> InputModel:
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


def parse_input_model(text: str, origin: str, constants: Mapping[str, float] | None = None) -> InputModel:
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
    root, findings = read_document(text, origin)
    if root is None:
        raise _complaint(findings)
    reader = InputModelReader(origin, constants or {})
    model = reader.model(root)
    if findings or reader.findings:
        raise _complaint(findings + reader.findings)
    return model


def _complaint(findings: list[Finding]) -> BadDomain:
    error = complaint(tuple(sorted(findings)))
    return BadDomain(error.where, error.rule, error.remedy, slug=error.slug)


class InputModelReader(DomainReader):
    """One reading of one file; what it cannot understand it adds to `findings` and goes on."""

    def __init__(self, origin: str, replaced: Mapping[str, float]) -> None:
        super().__init__(origin, {"pi": math.pi})
        self.replaced = replaced

    def model(self, root: Node) -> InputModel:
        """Return the input model; it is fit for use only if no finding was added."""
        top = self.record(
            root,
            "an input model",
            ("parcours", "name", "parameters"),
            ("doc", "repeat", "constants", "constraints", "groups"),
        )
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
            self.add(
                top["parameters"],
                "columns",
                f"a row has at most {MAX_COLUMNS} columns, but this one would have {len(once) * replicas or len(once)}",
                "repeat it less often",
            )
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
                rule = f"only constants of {self.origin} can be replaced"
                raise BadRequest(f"constant {name!r}", rule, one_of(name, own), slug="unknown-constant")
            if not math.isfinite(value):
                raise BadRequest(f"constant {name!r}", f"it must be finite, but {value} given", slug="constant")

    def groups(
        self, node: Node | None, once: Sequence[str], domains: Sequence[Domain], replicas: int
    ) -> Iterator[Group]:
        """Yield the groups of inputs with a strength of their own; parameters by name mean one group a replica."""
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
                    rule = f"a group must name each input once, but {brief(name)} is unknown or doubled"
                    self.add(item, "group", rule, one_of(name, known[:20]))
            if len(names) < strength:
                self.add(entry, "group", f"a group must have {strength} inputs or more, but has {len(names)}")
            copies = range(1, replicas + 1) if is_repeated else ()
            for i in copies:
                yield Group(tuple(numbered_name(name, i) for name in names), strength)
            if not copies:
                yield Group(tuple(names), strength)

    def constraints(
        self, node: Node | None, once: list[str], domains: list[Domain], replicas: int
    ) -> Iterator[Constraint]:
        """Yield the constraints over columns that the rules of the file stand for."""
        left = MAX_COLUMNS
        for name, entry, _ in self.entries(node, "constraints"):
            where = f"constraint {name!r}"
            record = self.record(entry, where, (), (*SCOPES, OVER_BLOCKS, "doc"))
            doc = self.text(record.get("doc"), f"{where}: doc")
            keys = [key for key in (*SCOPES, OVER_BLOCKS) if key in record]
            if len(keys) != 1 or (keys[0] in ("each", "pairs") and not replicas):
                self.add(
                    entry,
                    "constraint-scope",
                    f"{where} must have exactly one of row, blocks, and where parameters repeat, each and pairs",
                    "keep one",
                )
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
                    yield constraint_of(
                        full_name, instance, domains, over="blocks" if key == OVER_BLOCKS else "values", doc=doc
                    )
                except ParcoursError as error:
                    self.add(record[key], error.slug, f"{error.where}: {error.rule}", error.remedy)
                    break
