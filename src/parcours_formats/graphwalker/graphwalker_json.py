"""Reads GraphWalker's JSON (version 4), which may be hostile, and writes it.

Like GraphWalker's own reader, it takes `//` and `/* */` for comments and lets strings run over lines. Repeated keys,
NaN and what is too large or too deep are refused.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator

from parcours.errors import BadModel
from parcours.model.conversion import MAX_FOREIGN_BYTES, ForeignModel, Writing
from parcours.model.documents import Mapping, Node, Scalar, Sequence
from parcours.model.nodes import shown
from parcours.model.structure import Cefsm
from parcours_formats.graphwalker.joining import joined
from parcours_formats.graphwalker.labels import LabelledEdge, Model, Vertex
from parcours_formats.graphwalker.splitting import parted
from parcours_formats.losses import Losses
from parcours_formats.naming import as_label, stem
from parcours_formats.token_stream import TokenStream

MAX_DEPTH = 50
"""Deepest nesting of lists and objects."""

Items = dict[str, Node]


def parse_json(text: str, origin: str) -> Node:
    """Return the only value of a JSON text, as nodes with lines; a scalar that is not `plain` is a string.

    >>> node = parse_json('/* head */ {"a": [1, "x // y"]}', "here")
    >>> [(key.text, [item.text for item in value.items]) for key, value in node.items]
    [('a', ['1', 'x // y'])]
    >>> parse_json('{"a": NaN}', "here")
    Traceback (most recent call last):
    parcours.errors.BadModel: here:1: a value must stand in JSON, but here is 'NaN}' [json-syntax]
    """
    if len(text) > MAX_FOREIGN_BYTES:
        rule = f"a file of this format has at most {MAX_FOREIGN_BYTES} characters, but this one has {len(text)}"
        raise BadModel(origin, rule, "split the model", slug="file-size")
    parser = _Parser(text, origin)
    found = parser.value(1)
    if parser.kind != "end":
        parser.fail_at_token("a file holds one value, but behind it")
    return found


class _Parser(TokenStream):
    pattern = re.compile(
        r"""(?P<blank>[ \t\r\n\ufeff]+ | //[^\n]* | /\*[^*]*\*+(?:[^/*][^*]*\*+)*/)
          | (?P<string>"[^"\\]*(?:\\.[^"\\]*)*")
          | (?P<plain>-?[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?(?![A-Za-z0-9_.]) | (?:true|false|null)\b)
          | (?P<sign>[\[\]{},:])""",
        re.VERBOSE | re.DOTALL,
    )
    slug = "json-syntax"
    quoted_kind = "string"

    def value(self, depth: int) -> Node:
        line = self.line
        if self.kind in ("plain", "string"):
            return self.scalar()
        if self.kind != "sign" or self.token not in "[{":
            self.fail_at_token("a value must stand in JSON, but")
        if depth > MAX_DEPTH:
            self.fail(f"JSON nests at most {MAX_DEPTH} deep here, but goes deeper", slug="json-size")
        if self.accept("["):
            return Sequence(tuple(self.value(depth + 1) for _ in self.parts("]")), line)
        self.advance()
        found: dict[str, tuple[Scalar, Node]] = {}
        for _ in self.parts("}"):
            if self.kind != "string":
                self.fail_at_token("a key in quotes must stand in JSON, but")
            key = self.scalar(found)
            if not self.accept(":"):
                self.fail_at_token("a colon must stand behind a key in JSON, but")
            found[key.text] = key, self.value(depth + 1)
        return Mapping(tuple(found.values()), line)

    def parts(self, closing: str) -> Iterator[None]:
        """Yield before each part of a list or object."""
        is_first = True
        while not self.accept(closing):
            if not is_first and not self.accept(","):
                self.fail_at_token("a comma or the end of the list or object must stand in JSON, but")
            is_first = False
            yield

    def scalar(self, known: dict[str, tuple[Scalar, Node]] | None = None) -> Scalar:
        text = self.token if self.kind == "plain" else self.token[1:-1]
        if self.kind == "string" and "\\" in text:
            try:
                text = json.loads(self.token, strict=False)
                text.encode()
            except ValueError:
                self.fail("a string must have known escapes and whole characters, but this one has not")
        if known and text in known:
            first = known[text][0].line
            self.fail(f"an object has each key once, but {text[:60]!r} was used in line {first}", slug="duplicate-key")
        found = Scalar(text, self.kind == "plain", self.line)
        self.advance()
        return found


def read(text: str, origin: str) -> ForeignModel:
    """Return the model that GraphWalker's JSON holds. Raises BadModel if it says what our language cannot."""
    root = parse_json(text, origin)
    reader = _Reader(origin)
    items = reader.items(root, "a GraphWalker file")
    models = reader.models(root, items)
    if "seed" in items:
        reader.losses.add("seed", items["seed"].line, "the seed is not kept; give it to parcours walk --seed")
    name = reader.text(items, "name") or (models[0].name if len(models) == 1 else stem(origin))
    return joined(models, as_label(name), origin, reader.losses)


class _Reader:
    def __init__(self, origin: str) -> None:
        self.origin, self.fallback = origin, stem(origin)
        self.losses = Losses()

    def models(self, root: Node, items: Items) -> list[Model]:
        if "models" not in items and "vertices" in items:
            return [self.model(root, 1)]
        if "models" not in items:
            raise self.wrong(root, "a GraphWalker file must have the key 'models', but this one has not")
        nodes = self.listed(items, "models")
        if not nodes:
            raise self.wrong(root, "a GraphWalker file must have a model, but 'models' is empty")
        return [self.model(node, number) for number, node in enumerate(nodes, 1)]

    def model(self, node: Node, number: int) -> Model:
        items = self.items(node, "a model")
        return Model(
            name=self.text(items, "name") or (self.fallback if number == 1 else f"{self.fallback} {number}"),
            vertices=[self.vertex(each) for each in self.listed(items, "vertices")],
            edges=[self.edge(each) for each in self.listed(items, "edges")],
            start=self.text(items, "startElementId"),
            actions=self.texts(items, "actions"),
            requirements=self.texts(items, "requirements"),
            generator=self.text(items, "generator"),
            predefined=self.texts(items, "predefinedPathEdgeIds"),
            line=node.line,
        )

    def vertex(self, node: Node) -> Vertex:
        items = self.items(node, "a vertex")
        self.described(items, node, "vertex")
        id, name, shared = (self.text(items, key) for key in ("id", "name", "sharedState"))
        actions, requirements = self.texts(items, "actions"), self.texts(items, "requirements")
        return Vertex(id, name, shared, actions, requirements, self.is_blocked(items), node.line)

    def edge(self, node: Node) -> LabelledEdge:
        items = self.items(node, "an edge")
        self.described(items, node, "edge")
        keys = ("id", "name", "sourceVertexId", "targetVertexId", "guard")
        id, name, source, target, guard = (self.text(items, key) for key in keys)
        actions, requirements = self.texts(items, "actions"), self.texts(items, "requirements")
        weight, dependency = self.number(items, "weight"), round(self.number(items, "dependency"))
        blocked = self.is_blocked(items)
        return LabelledEdge(
            id, name, source, target, guard, actions, requirements, weight, dependency, blocked, node.line
        )

    def is_blocked(self, items: Items) -> bool:
        value = items.get("blocked", _properties(items).get("blocked"))
        return isinstance(value, Scalar) and value.text.lower() == "true"

    def described(self, items: Items, node: Node, kind: str) -> None:
        # Where it stands in a drawing is of no account; what someone wrote is.
        for key in _properties(items).keys() - {"x", "y", "blocked"}:
            where = f"{kind} {self.text(items, 'name') or self.text(items, 'id')!r}"
            self.losses.add(where, node.line, f"its property {key[:60]!r} is not kept")

    def items(self, node: Node, what: str) -> Items:
        if not isinstance(node, Mapping):
            raise self.wrong(node, f"{what} must be an object, but is {shown(node)}")
        return {key.text: value for key, value in node.items if not _is_null(value)}

    def listed(self, items: Items, key: str) -> tuple[Node, ...]:
        node = items.get(key, Sequence((), 0))
        if not isinstance(node, Sequence):
            raise self.wrong(node, f"{key!r} must be a list, but is {shown(node)}")
        return node.items

    def text(self, items: Items, key: str) -> str:
        node = items.get(key, Scalar("", False, 0))
        if not isinstance(node, Scalar):
            raise self.wrong(node, f"{key!r} must be a string, but is {shown(node)}")
        return node.text

    def texts(self, items: Items, key: str) -> tuple[str, ...]:
        # A single text in place of a list of texts is found in old files.
        node = items.get(key, Sequence((), 0))
        found = (node,) if isinstance(node, Scalar) else self.listed(items, key)
        for each in found:
            if not isinstance(each, Scalar):
                raise self.wrong(each, f"{key!r} must be a list of strings, but has {shown(each)}")
        return tuple(each.text for each in found if isinstance(each, Scalar))

    def number(self, items: Items, key: str) -> float:
        text = self.text(items, key) or "0"
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0 <= value <= 1e9:
            raise self.wrong(items[key], f"{key!r} must be a number from 0 to 1e9, but is {text[:24]}")
        return value

    def wrong(self, node: Node, rule: str) -> BadModel:
        return BadModel(f"{self.origin}:{node.line}", rule, slug="graphwalker")


def _properties(items: Items) -> Items:
    node = items.get("properties")
    return {key.text: value for key, value in node.items} if isinstance(node, Mapping) else {}


def _is_null(node: Node) -> bool:
    return isinstance(node, Scalar) and node.plain and node.text == "null"


def write(cefsm: Cefsm) -> Writing:
    """Return a model as GraphWalker's JSON: each machine is a graph; messages are left out."""
    models, losses = parted(cefsm, tags=True)
    written = []
    for model in models:
        entry: dict[str, object] = {"name": model.name, "generator": model.generator, "startElementId": model.start}
        entry |= {"actions": model.actions} if model.actions else {}
        entry["vertices"] = [_said(each, _VERTEX) for each in model.vertices]
        entry["edges"] = [_said(each, _EDGE) for each in model.edges]
        written.append(entry)
    document = {"name": cefsm.name, "models": written}
    return Writing(json.dumps(document, indent=1, ensure_ascii=False), losses)


_VERTEX = {"id": "id", "name": "name", "sharedState": "shared", "actions": "actions", "requirements": "requirements"}
_EDGE = {"id": "id", "name": "name", "sourceVertexId": "source", "targetVertexId": "target"}
_EDGE |= {each: each for each in ("guard", "actions", "weight", "requirements")}


def _said(element: Vertex | LabelledEdge, keys: dict[str, str]) -> dict[str, object]:
    return {key: value for key, attribute in keys.items() if (value := getattr(element, attribute))}
