"""The grammar of labels by which GraphWalker writes a vertex or an edge into a drawing (yEd, DOT).

    vertex   v_Name  SHARED:State  INIT:a = 1; b = 2;  REQTAG=UC1,UC2  BLOCKED
    edge     e_Name[guard]/a = 1; b = 2;  WEIGHT=0.5  DEPENDENCY=1  REQTAG=UC1  BLOCKED

All parts may be left out, and stand on lines of their own; `/* */` is a comment, and so is what follows ` //`.
"""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from decimal import Decimal

_COMMENT = re.compile(r"/\*|(?:(?<=\s)|\A)//")
# The closing quote may be missing, so that a text full of quotes is walked over once.
_QUOTED = re.compile(r"'[^'\\\n]*(?:\\.[^'\\\n]*)*'?|\"[^\"\\\n]*(?:\\.[^\"\\\n]*)*\"?")
_KEYWORD = re.compile(r"\b(?:(SHARED|INIT|REQTAG)\s*[:=]|((?i:WEIGHT|DEPENDENCY))\s*=|(BLOCKED)\b(?![:=]))", re.ASCII)
_BREAK = re.compile(r"<\s*(?:br|/p|/tr|/div)\b[^>]*>", re.IGNORECASE)
_TAG = re.compile(r"<[^<>]*>")


def as_vertex(label: str, id: str, line: int = 0) -> tuple[Vertex, tuple[str, ...]]:
    """Return the vertex of a label, and what its model does at the start.

    >>> vertex, initial = as_vertex("v_Login\\nSHARED:IN\\nREQTAG=UC1, UC2\\nINIT:n = 0;", "n7")
    >>> vertex.name, vertex.shared, vertex.requirements, initial
    ('v_Login', 'IN', ('UC1', 'UC2'), ('n = 0;',))
    """
    name, parts = _parts(label)
    shared, initial = parts.get("SHARED", ""), parts.get("INIT", "")
    vertex = Vertex(id, " ".join(name.split()), shared, (), _listed(parts), "BLOCKED" in parts, line)
    return vertex, (initial,) if initial else ()


def as_edge(label: str, id: str, source: str, target: str, line: int = 0) -> LabelledEdge:
    """Return the edge of a label.

    >>> edge = as_edge("e_Add [n < a['x]']] / n++; BLOCKED WEIGHT=0.5", "e1", "n0", "n1")
    >>> edge.name, edge.guard, edge.actions, edge.weight, edge.blocked
    ('e_Add', "n < a['x]']", ('n++;',), 0.5, True)
    """
    text, parts = _parts(label)
    # `seen` has the same length as `text`: signs are looked for in the one, and cut from the other.
    seen = _masked(text)
    guard = ""
    slash, start = seen.find("/"), seen.find("[")
    if start >= 0 and not 0 <= slash < start:
        end = _closing(seen, start)
        guard = text[start + 1 : end]
        text, seen = f"{text[:start]} {text[end + 1 :]}", f"{seen[:start]} {seen[end + 1 :]}"
        slash = seen.find("/")
    name, actions = (text[:slash], text[slash + 1 :]) if slash >= 0 else (text, "")
    name, guard, actions = " ".join(name.split()), guard.strip(), actions.strip()
    weight, dependency = (_number(parts.get(key, "")) for key in ("WEIGHT", "DEPENDENCY"))
    said = (guard, (actions,) if actions else (), _listed(parts), weight, round(dependency), "BLOCKED" in parts)
    return LabelledEdge(id, name, source, target, *said, line)


def vertex_label(vertex: Vertex, initial: tuple[str, ...] = ()) -> str:
    """Return the label of a vertex; `as_vertex` inverts it."""
    said = [vertex.name]
    if vertex.shared:
        said.append(f"SHARED:{vertex.shared}")
    if initial:
        said.append(f"INIT:{' '.join(initial)}")
    return "\n".join(said)


def edge_label(edge: LabelledEdge) -> str:
    """Return the label of an edge; `as_edge` inverts it.

    >>> edge_label(LabelledEdge("e0", "e_Add", "n0", "n1", "n < 3", ("n = n + 1;",), weight=0.5))
    'e_Add[n < 3]/n = n + 1;\\nWEIGHT=0.5'
    """
    said = edge.name
    if edge.guard:
        said += f"[{edge.guard}]"
    if edge.actions:
        said += f"/{' '.join(edge.actions)}"
    # GraphWalker's numbers have no exponent.
    return f"{said}\nWEIGHT={Decimal(repr(edge.weight)):f}" if edge.weight else said


def plain_text(label: str) -> str:
    """Return a label without the tags of HTML that it may have.

    >>> plain_text("<html>v_<b>Home</b><br>SHARED:A &amp; B</html>"), plain_text("[a<b]")
    ('v_Home\\nSHARED:A & B', '[a<b]')
    """
    if label.lstrip()[:6].lower() != "<html>":
        return label
    return html.unescape(_TAG.sub("", _BREAK.sub("\n", label)))


def _masked(text: str) -> str:
    """Return the text with quoted strings blotted out, so that signs inside them are not met."""
    return _QUOTED.sub(_blot, text)


def _blot(match: re.Match[str]) -> str:
    said = match[0]
    return "'" + "_" * (len(said) - 2) + "'" if len(said) > 1 and said[0] == said[-1] else said


def _parts(label: str) -> tuple[str, dict[str, str]]:
    """Return what stands before the first keyword that is no part of a guard, and the text of each keyword."""
    label = _uncommented(label)
    seen = _masked(label)
    found = list(_KEYWORD.finditer(seen))
    if not found:
        return label, {}
    parts: dict[str, str] = {}
    ends = [*(match.start() for match in found[1:]), len(label)]
    rest = [label[: found[0].start()]]
    for match, end in zip(found, ends, strict=True):
        key = next(filter(None, match.groups())).upper()
        value = label[match.end() : end]
        if key == "BLOCKED":
            rest.append(value)
            value = ""
        elif key in ("WEIGHT", "DEPENDENCY", "SHARED"):
            value, _, behind = value.strip().partition("\n") if "\n" in value.strip() else value.strip().partition(" ")
            rest.append(behind)
        parts[key] = value.strip()
    return " ".join(rest), parts


def _uncommented(label: str) -> str:
    """Return the label without comments; one that does not end is not a comment."""
    seen, kept, at = _masked(label), list[str](), 0
    while (match := _COMMENT.search(seen, at)) is not None:
        end = seen.find("*/" if match[0] == "/*" else "\n", match.end())
        if end < 0 and match[0] == "/*":
            break
        kept.append(label[at : match.start()])
        at = len(label) if end < 0 else end + 2 * (match[0] == "/*")
    return " ".join([*kept, label[at:]])


def _closing(seen: str, start: int) -> int:
    depth = 0
    for at in range(start, len(seen)):
        depth += (seen[at] == "[") - (seen[at] == "]")
        if not depth:
            return at
    return len(seen)


def _listed(parts: dict[str, str]) -> tuple[str, ...]:
    return tuple(each.strip() for each in parts.get("REQTAG", "").split(",") if each.strip())


def _number(text: str) -> float:
    match = re.match(r"[0-9]{0,12}\.?[0-9]{0,30}", text, re.ASCII)
    digits = match.group() if match else ""
    return float(digits) if digits.strip(".") else 0.0


@dataclass(slots=True)
class Vertex:
    """A vertex; those that share a state in several models are places where the walk may change the model."""

    id: str
    name: str
    shared: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    blocked: bool = False
    line: int = 0


@dataclass(slots=True)
class LabelledEdge:
    """An edge; one without source is where a walk starts. `weight` is its share of probability, 0 if not given."""

    id: str
    name: str
    source: str
    target: str
    guard: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    weight: float = 0.0
    dependency: int = 0
    blocked: bool = False
    line: int = 0


@dataclass(slots=True)
class Model:
    """One graph: `start` is the id of the vertex or edge where a walk starts, if it is given."""

    name: str
    vertices: list[Vertex]
    edges: list[LabelledEdge]
    start: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    generator: str = ""
    predefined: tuple[str, ...] = ()
    line: int = 0
