"""Parses Graphviz' DOT language into graphs of nodes and edges with their attributes and lines.

    file      := ['strict'] 'digraph' [id] '{' statement* '}' ...
    statement := id '=' id | ('graph' | 'node' | 'edge') attributes | ends ('->' ends)* attributes
    ends      := id [':' port [':' compass]] | ['subgraph' [id]] '{' statement* '}'

Subgraphs are flattened, but defaults set inside them end with them. Nothing is drawn, so most attributes are only kept.
"""

from __future__ import annotations

import html
import re
from dataclasses import dataclass, field
from itertools import pairwise

from parcours.errors import BadModel
from parcours.model.conversion import MAX_FOREIGN_BYTES
from parcours_formats.token_stream import TokenStream

MAX_DEPTH = 50
"""Deepest nesting of subgraphs."""

MAX_EDGES = 300_000
"""Most edges of one file: `{a b} -> {c d}` makes four."""

_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_TAG = re.compile(r"<[^<>]*>")
_ANGLE = re.compile(r"[<>]")
_WORDS = ("strict", "graph", "digraph", "node", "edge", "subgraph")

Attributes = dict[str, str]


class Markup(str):
    """A text that stood in <>, with these: a label of HTML."""

    __slots__ = ()


@dataclass(slots=True)
class DotEdge:
    """An edge with its attributes."""

    source: str
    target: str
    attributes: Attributes
    line: int


@dataclass(slots=True)
class DotGraph:
    """One directed graph; nodes in the order of their first mention, each with its attributes and that line."""

    name: str
    line: int
    attributes: Attributes = field(default_factory=dict)
    nodes: dict[str, Attributes] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    edges: list[DotEdge] = field(default_factory=list)


def parse_dot(text: str, origin: str) -> list[DotGraph]:
    """Return the graphs of a DOT file.

    >>> [graph] = parse_dot('digraph g { a -> {b "c d"} [label=x]; b [shape=box] }', "here")
    >>> [(edge.source, edge.target, edge.attributes) for edge in graph.edges]
    [('a', 'b', {'label': 'x'}), ('a', 'c d', {'label': 'x'})]
    >>> parse_dot("graph g { a -- b }", "here")
    Traceback (most recent call last):
    parcours.errors.BadModel: here:1: a graph must be directed, but this one is not; write digraph and -> [dot-graph]
    """
    if len(text) > MAX_FOREIGN_BYTES:
        rule = f"a file of this format has at most {MAX_FOREIGN_BYTES} characters, but this one has {len(text)}"
        raise BadModel(origin, rule, "split the model", slug="file-size")
    parser = _Parser(text, origin)
    graphs = [parser.graph()]
    while parser.kind != "end":
        graphs.append(parser.graph())
    return graphs


def label_text(attributes: Attributes, name: str = "", key: str = "label") -> str:
    """Return an attribute as its reader sees it: escapes worked out, tags of HTML left out.

    >>> label_text({"label": "a\\\\nb \\\\N"}, "n1"), label_text({"label": Markup("<<b>x</b> &amp; y>")})
    ('a\\nb n1', 'x & y')
    """
    label = attributes.get(key, "")
    if isinstance(label, Markup):
        return html.unescape(" ".join(_TAG.sub(" ", label[1:-1]).split()))
    known = {"n": "\n", "l": "\n", "r": "\n", "N": name, "E": name, "G": name, "L": name}
    return _ESCAPE.sub(lambda match: known.get(match[1], match[1]), label).strip()


_Defaults = dict[str, Attributes]
"""What nodes and edges have unless they say otherwise."""


class _Parser(TokenStream):
    pattern = re.compile(
        r"""(?P<blank>[\s\ufeff]+ | //[^\n]* | /\*[^*]*\*+(?:[^/*][^*]*\*+)* / | \#[^\n]*)
          | (?P<id>[A-Za-z_\u0080-\U0010ffff][A-Za-z0-9_\u0080-\U0010ffff]* | -?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?))
          | (?P<text>"[^"\\]*(?:\\.[^"\\]*)*")
          | (?P<markup><)
          | (?P<sign>->|--|[\[\]{}=;,:+])""",
        re.VERBOSE | re.DOTALL,
    )
    slug = "dot-graph"

    def __init__(self, text: str, origin: str) -> None:
        super().__init__(text, origin)
        self.strict: dict[tuple[str, str], DotEdge] | None = None
        self.depth = self.count = 0

    def advance(self) -> None:
        super().advance()
        if self.kind == "markup":
            # Markup nests, which no regular expression follows: angles are counted.
            start, depth = self.at - 1, 0
            for match in _ANGLE.finditer(self.text, start):
                depth += 1 if match.group() == "<" else -1
                if not depth:
                    self.at = match.end()
                    self.token = self.text[start : self.at]
                    return
            self.fail("a text in <> must end with >, but the one that starts here does not")

    def word(self) -> str:
        """Return the next token in lower case if it has no quotes, else an empty text."""
        return self.token.lower() if self.kind == "id" else ""

    def accept_word(self, word: str) -> bool:
        if self.word() != word:
            return False
        self.advance()
        return True

    def graph(self) -> DotGraph:
        strict = self.accept_word("strict")
        if self.word() == "graph":
            self.fail("a graph must be directed, but this one is not", "write digraph and ->")
        if not self.accept_word("digraph"):
            self.fail_at_token("'digraph' must stand here, but")
        line = self.line
        name = self.id("") if self.kind in ("id", "text", "markup") else ""
        found = DotGraph(name, line)
        self.strict = {} if strict else None
        self.body(found, {"node": {}, "edge": {}})
        return found

    def body(self, graph: DotGraph, defaults: _Defaults) -> dict[str, None]:
        """Read `{ ... }`; return the nodes met in it."""
        self.expect("{")
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self.fail(f"subgraphs nest at most {MAX_DEPTH} deep, but here they go deeper")
        met: dict[str, None] = {}
        while not self.accept("}"):
            if not self.accept(";") and not self.accept(","):
                met.update(self.statement(graph, defaults))
        self.depth -= 1
        return met

    def statement(self, graph: DotGraph, defaults: _Defaults) -> dict[str, None]:
        word, line = self.word(), self.line
        if word in ("graph", "node", "edge"):
            self.advance()
            given = self.attributes()
            if word in defaults:
                defaults[word] = {**defaults[word], **given}
            elif self.depth == 1:
                graph.attributes.update(given)
            return {}
        ends, is_node = self.ends(graph, defaults)
        if is_node and self.accept("="):  # it was a key, not a node
            [key] = ends
            value = self.id("a value")
            if self.depth == 1:
                graph.attributes[key] = value
            return {}
        for id in ends:
            self.node(graph, defaults, id, line)
        met, chain = dict(ends), [ends]
        while self.kind == "sign" and self.token in ("->", "--"):
            if self.token == "--":
                self.fail("a graph must be directed, but this edge is not", "write ->")
            self.advance()
            line_of_end = self.line
            ends, is_node = self.ends(graph, defaults)
            for id in ends:
                self.node(graph, defaults, id, line_of_end)
            chain.append(ends)
            met.update(ends)
        given = self.attributes()
        if len(chain) == 1 and is_node:
            graph.nodes[next(iter(ends))].update(given)
        for sources, targets in pairwise(chain):
            self.count += len(sources) * len(targets)
            if self.count > MAX_EDGES:
                self.fail(f"a file has at most {MAX_EDGES} edges, but here are more")
            for source in sources:
                for target in targets:
                    self.edge(graph, DotEdge(source, target, {**defaults["edge"], **given}, line), given)
        return met

    def ends(self, graph: DotGraph, defaults: _Defaults) -> tuple[dict[str, None], bool]:
        """Read a node or a subgraph; return its nodes, and whether it was a node."""
        if self.word() == "subgraph" or (self.kind == "sign" and self.token == "{"):
            if self.accept_word("subgraph") and self.kind in ("id", "text", "markup"):
                self.id("")
            return self.body(graph, dict(defaults)), False
        id = self.id("a node, an edge or a subgraph")
        for _ in range(2):
            if self.accept(":"):
                self.id("a port")
        return {id: None}, True

    def node(self, graph: DotGraph, defaults: _Defaults, id: str, line: int) -> None:
        if id not in graph.nodes:
            graph.nodes[id] = dict(defaults["node"])
            graph.lines[id] = line

    def edge(self, graph: DotGraph, edge: DotEdge, given: Attributes) -> None:
        if self.strict is not None:
            known = self.strict.setdefault((edge.source, edge.target), edge)
            if known is not edge:
                known.attributes.update(given)
                return
        graph.edges.append(edge)

    def attributes(self) -> Attributes:
        found: Attributes = {}
        while self.accept("["):
            while not self.accept("]"):
                key = self.id("the name of an attribute")
                found[key] = self.id("a value") if self.accept("=") else "true"
                if not self.accept(";"):
                    self.accept(",")
        return found

    def id(self, wanted: str) -> str:
        if self.kind == "text":
            return self.quoted()
        if self.kind == "id" and self.word() not in _WORDS:
            found = self.token
        elif self.kind == "markup":
            found = Markup(self.token)
        else:
            self.fail_at_token(f"{wanted} must stand here, but")
        self.advance()
        return found

    def quoted(self) -> str:
        """Return the text in quotes that stands here, with what `+` adds to it."""
        parts = []
        while True:
            parts.append(self.token[1:-1].replace('\\"', '"').replace("\\\r\n", "").replace("\\\n", ""))
            self.advance()
            if not self.accept("+"):
                return "".join(parts)
            if self.kind != "text":
                self.fail_at_token("a text in quotes must stand behind '+', but")


def quoted(text: str) -> str:
    """Return a text in quotes, such that `label_text` gives it back.

    >>> quoted('say "a\\\\b"')
    '"say \\\\"a\\\\\\\\b\\\\""'
    """
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
