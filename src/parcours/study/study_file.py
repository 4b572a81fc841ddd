"""Reads a study.yaml (docs/studies.md), and finds all that is wrong with it and the files it names."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Literal

from parcours.errors import BadRequest, ParcoursError
from parcours.model.documents import MAX_BYTES, Node, Scalar, read_document
from parcours.model.documents import Mapping as MappingNode
from parcours.model.expression import Expression, names, parse_expression
from parcours.model.finding import Finding, advice, complaint, errors_among
from parcours.model.nodes import brief, shown
from parcours.run.binding.quantities import QuantityReader, constant
from parcours.study.parameters import KINDS, OPTIONS, Parameter
from parcours.study.protocol import Study

FORMAT = "study/1"
# Entry points of this group read further kinds of study: `name = package.module:function`, called as a `Reader`
KIND_GROUP = "parcours.kinds"
_COMMON = ("doc", "kind", "parameters")


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a study.yaml whose value stands alone: nothing else in the file decides whether it is right."""

    field: str  # of the study that gets the value
    kind: Literal["word", "time", "count", "flag"]
    absent: Any = None  # the value where the key is missing
    words: tuple[str, ...] = ()  # those allowed, of kind `word`


def read_study(path: Path) -> Study:
    """Return the study that a file describes. No code that it names is run: that happens when its cases are."""
    study, found = check_study_file(path)
    if study is None:
        raise refusal(found)
    return study


def check_study_file(path: Path, text: str | None = None) -> tuple[Study | None, tuple[Finding, ...]]:
    """Return the study of a file, or of a text that will replace it; None if it has errors; and every finding."""
    try:
        if text is None:
            with path.open("rb") as file:
                text = file.read(MAX_BYTES + 1).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else "its bytes are no UTF-8 text"
        rule = f"a study must be a readable file, but: {said}"
        remedy = "check the path, or write one with `parcours new`"
        raise BadRequest(str(path), rule, remedy, slug="unreadable-file") from None
    document, found = read_document(text, str(path), "a study")
    study: Study | None = None
    if document is not None:
        reader = StudyReader(str(path), path.absolute())
        study = reader.study(document)
        found += reader.findings
    ordered = tuple(sorted(set(found), key=lambda finding: (finding.file, finding.line, finding.rule, finding.message)))
    return None if errors_among(ordered) else study, ordered


def refusal(found: tuple[Finding, ...]) -> ParcoursError:
    """Return one error that says all errors among the findings, one per line."""
    return complaint(errors_among(found), "a study", BadRequest, "study-errors")


class StudyReader(QuantityReader):
    """Reads the parts that all kinds of study share; `findings` grows as it goes."""

    def __init__(self, origin: str, path: Path) -> None:
        super().__init__(origin)
        self.path, self.folder = path, path.parent
        self.digests: dict[str, str] = {}
        self.digest(path)

    def study(self, root: Node) -> Study | None:
        """Return the study of a document; it is fit for use only if no finding was added."""
        if not isinstance(root, MappingNode):
            self.add(root, "kind", f"a study must be a mapping, but is {shown(root)}", "write parcours: study/1")
            return None
        top = {key.text: value for key, value in root.items}
        form = self.text(top.get("parcours"), "parcours", "")
        if form != FORMAT:
            self.add(top.get("parcours", root), "format", f"the format must be {FORMAT}, but is {brief(form)}")
            return None
        kinds = kinds_of_study()
        kind = self.text(top.get("kind"), "kind", "components")
        if kind not in kinds:
            self.add(top["kind"], "study-kind", f"a kind of study must be known, but is {brief(kind)}",
                     advice(kind, list(kinds), self.findings))  # fmt: skip
            return None
        try:
            return kinds[kind](self, root)
        except ParcoursError as error:  # of a file that the study names
            self.add(None, error.slug, f"{error.where}: {error.rule}", error.remedy)
            return None

    def keys(self, root: Node, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, Node]:
        """Return the values of the study's keys; those that all kinds share are among them."""
        return self.record(root, "a study", ("parcours", "name", *required), (*_COMMON, *optional))

    def described(
        self, root: Node, required: tuple[str, ...], keys: Mapping[str, Key], optional: tuple[str, ...]
    ) -> tuple[dict[str, Node], dict[str, Any]]:
        """Return the nodes of a study's keys, and what its fields get: from what all kinds share and from `keys`."""
        top = self.keys(root, required, (*keys, *optional))
        own = tuple(self._parameter(name, node) for name, node, _ in self.entries(top.get("parameters"), "parameters"))
        fields: dict[str, Any] = {"name": self.name(top), "own": own, "doc": self.text(top.get("doc"), "doc"),
                                  "where": str(self.path), "digests": self.digests}  # fmt: skip
        for name, key in keys.items():
            node = top.get(name)
            if key.kind == "word":
                fields[key.field] = self.named(node, name, key.words, key.absent)
            elif key.kind == "flag":
                fields[key.field] = self.named(node, name, ("true", "false"), "false") == "true"
            else:
                fields[key.field] = (self.duration if key.kind == "time" else self.count)(node, name, key.absent)
        return top, fields

    def name(self, top: Mapping[str, Node]) -> str:
        """Return the study's name, which begins the ids of its cases."""
        from parcours.suite.cases import is_part

        name = self.text(top.get("name"), "name", "study")
        if not is_part(name):
            rule = f"a study's name consists of letters, digits and _ . + @ = , -, but is {brief(name)}"
            self.add(top["name"], "case-id", rule)
        return name

    def settings(self, top: Mapping[str, Node], known: Mapping[str, Parameter]) -> dict[str, object]:
        """Return what stands under `settings`: other defaults of known parameters, by name."""
        found: dict[str, object] = {}
        for name, node, line in self.entries(top.get("settings"), "settings"):
            if name not in known:
                rule, remedy = f"settings: there is no parameter {name!r}", advice(name, list(known), self.findings)
                self.findings.append(Finding(self.origin, line, "error", "parameter-unknown", rule, remedy))
                continue
            with self.noting(node, f"settings, {name}"):
                if not isinstance(node, Scalar):
                    raise BadRequest(name, f"must be a single value, but is {shown(node)}", slug="parameter-kind")
                found[name] = known[name].read(node.text if known[name].kind == "text" else constant(node))
        return found

    def file(self, node: Node | None, what: str, absent: str = "") -> Path | None:
        """Return a file that the study names; `absent`, if it is there, where node is None. Its digest counts."""
        text = self.text(node, what, absent)
        path = self.folder / text
        if not text or (node is None and not path.exists()):
            return None
        if not path.is_file():
            seen = f"{brief(text)} is a folder" if path.is_dir() else f"there is no {brief(text)}"
            self.add(node, "study-file", f"{what} must be a file, but {seen}", "check the path")
            return None
        self.digest(path)
        return path

    def digest(self, path: Path) -> None:
        """Let the study's results depend on the content of a file."""
        try:
            name = str(path.relative_to(self.folder)) if path.is_relative_to(self.folder) else path.name
            self.digests[name] = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        except OSError as error:
            self.add(None, "study-file", f"{path} must be readable, but: {error.strerror}")

    def modules(self, node: Node | None) -> tuple[str, ...]:
        """Return the Python files, from the study's folder, and modules or packages that `parcours mutate` changes."""
        found = self.words(node, "mutants")
        for one in found:
            if one.endswith(".py") and not (self.folder / one).is_file():
                self.add(node, "study-file", f"mutants: there is no file {brief(one)}", "check the path")
        return found

    def target(self, node: Node, what: str, methods: tuple[str, ...] = ()) -> str:
        """Return a `file.py:Name` or `module:Name` whose file defines the name, and the methods if it is a class.

        The file is parsed, not run.
        """
        from parcours.study.loading import absent_in, file_of, is_target

        text = self.text(node, what)
        if not is_target(text):
            rule = f"{what} must be file.py:Name or package.module:Name, but is {brief(text)}"
            self.add(node, "target-form", rule)
            return ""
        path = file_of(text, self.folder)
        if path is not None and not path.is_file():
            self.add(node, "study-file", f"{what}: there is no file {brief(text.rpartition(':')[0])}", "check the path")
        elif path is not None:
            self.digest(path)
            for slug, rule, remedy in absent_in(path, text.rpartition(":")[2], methods):
                self.add(node, slug, f"{what}: {rule}", remedy)
        return text

    def formulas(
        self, node: Node | None, what: str, fields: Mapping[str, tuple[str, ...]], known: tuple[str, ...], owner: str
    ) -> dict[str, dict[str, Expression]]:
        """Return formulas by owner and field."""
        found: dict[str, dict[str, Expression]] = {}
        for name, inner in self.known_entries(node, what, fields, f"there is no {owner} {{}}"):
            for part, value in self.known_entries(inner, f"{what} of {name}", fields[name], "it has no {}"):
                formula = self.formula(value, f"{what} of {name}, {part}", known)
                if formula is not None:
                    found.setdefault(name, {})[part] = formula
        return found

    def formula(self, node: Node, what: str, known: tuple[str, ...]) -> Expression | None:
        """Return a formula that reads known names only."""
        formula = self.parsed(node, what, parse_expression, None)
        for name in sorted(names(formula) - set(known)) if formula is not None else ():
            rule = f"{what}: a formula reads test inputs and parameters, but there is no {brief(name)}"
            self.unknown(node.line, name, rule, known)
            return None
        return formula

    def known_entries(
        self, node: Node | None, what: str, known: Collection[str], rule: str, name: bool = False
    ) -> Iterator[tuple[str, Node]]:
        """Yield each entry of a mapping whose name is known; `rule` says of another, {}, that it is not.

        Names are labels, or identifiers if `name`.
        """
        for given, value, line in self.entries(node, what, None if name else self.label):
            if given in known:
                yield given, value
            else:
                self.unknown(line, given, f"{what}: {rule.format(brief(given))}", list(known))

    @contextlib.contextmanager
    def noting(self, node: Node | None, what: str, kind: type[ParcoursError] = BadRequest) -> Iterator[None]:
        """Note an error of a kind that is raised meanwhile, at the node's line."""
        try:
            yield
        except kind as error:
            self.add(node, error.slug, f"{what}: {error.rule}", error.remedy)

    def unknown(self, line: int, name: str, rule: str, known: Sequence[str]) -> None:
        """Note that a name is not known."""
        remedy = advice(name, known, self.findings)
        self.findings.append(Finding(self.origin, line, "error", "study-name", rule, remedy))

    def named(self, node: Node | None, what: str, known: Sequence[str], absent: str) -> str:
        """Return one of a few names."""
        text = self.text(node, what, absent)
        if node is None or text in known:
            return text
        self.unknown(node.line, text, f"{what} must be a known name, but is {brief(text)}", known)
        return absent

    def complain(self, error: ParcoursError) -> None:
        """Note what is wrong with another file, at the line that the error names."""
        where, _, line = error.where.rpartition(":")
        at = int(line) if line.isdecimal() else 0
        self.findings.append(Finding(where if at else error.where, at, "error", error.slug, error.rule, error.remedy))

    def count(self, node: Node | None, what: str, absent: int | None) -> int | None:
        """Return a whole number of at least 1."""
        return absent if node is None else self.integer(node, what, 1, 1_000_000_000)

    def _parameter(self, name: str, node: Node) -> Parameter:
        what = f"parameter {name}"
        if name in OPTIONS:
            self.add(node, "study-double", f"{what}: --{name.replace('_', '-')} is an option already", "rename it")
        entries = self.record(node, what, ("default",), ("type", "unit", "range", "choices", "doc"))
        kind = self.one_of(entries.get("type"), f"type of {what}", KINDS, "real")
        limits = self.listed(entries.get("range"), f"range of {what}")
        ends = [self.signed(one, f"range of {what}") for one in limits]
        if limits and len(ends) != 2:
            self.add(entries["range"], "value", f"range of {what} must be [least, greatest], but has {len(ends)} items")
        low, high = ends if len(ends) == 2 and ends[0] <= ends[1] else (None, None)
        if len(ends) == 2 and low is None:
            rule = f"range of {what} must be [least, greatest], but {ends[0]:g} > {ends[1]:g}"
            self.add(entries["range"], "value", rule)
        parameter = Parameter(
            name, kind, False, self.text(entries.get("doc"), f"doc of {what}"),  # type: ignore[arg-type]
            self.text(entries.get("unit"), f"unit of {what}", "1"), low, high,
            self.words(entries.get("choices"), f"choices of {what}"),
        )  # fmt: skip
        given = entries.get("default")
        if given is None:
            return parameter
        try:
            value = self.text(given, f"default of {what}") if kind == "text" else constant(given)  # type: ignore[arg-type]
            return replace(parameter, default=parameter.read(value))
        except (BadRequest, AttributeError) as error:
            said = error.rule if isinstance(error, BadRequest) else f"is {shown(given)}"
            self.add(given, "value", f"default of {what} {said}")
            return parameter

    def signed(self, node: Node, what: str) -> float:
        """Return a number of either sign."""
        value = constant(node) if not isinstance(node, MappingNode) and hasattr(node, "plain") else None  # type: ignore[arg-type]
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.add(node, "value", f"{what} must hold numbers, but holds {shown(node)}")
            return 0.0
        return float(value)


Reader = Callable[[StudyReader, Node], "Study | None"]


def kinds_of_study() -> dict[str, Reader]:
    """Return what reads each kind of study, those of add-ons among them."""
    from parcours.study.campaign.campaign_file import read_campaign
    from parcours.study.components.components_file import read_components

    kinds: dict[str, Reader] = {"components": read_components, "campaign": read_campaign}
    for point in entry_points(group=KIND_GROUP):
        kinds.setdefault(point.name, _lazy(point.name, point.load))
    return kinds


def _lazy(name: str, load: Callable[[], Reader]) -> Reader:
    def read(reader: StudyReader, root: Node) -> Study | None:
        try:
            found = load()
        except Exception as error:
            rule = f"the package that registers kind {name!r} must load, but raised {type(error).__name__}: {error}"
            raise BadRequest(f"kind {name!r}", rule, "repair or remove the package", slug="study-broken") from error
        return found(reader, root)

    return read
