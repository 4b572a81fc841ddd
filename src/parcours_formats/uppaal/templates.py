"""The XML of a UPPAAL file to its templates as written: locations, edges and the texts at them, with their lines."""

from __future__ import annotations

import re
from dataclasses import dataclass

from parcours.errors import BadModel
from parcours_formats.naming import Names, as_label
from parcours_formats.uppaal.declarations import parse_declarations, parse_parameters
from parcours_formats.uppaal.declared import Declaration, Declared
from parcours_formats.xml_lines import Element


@dataclass(frozen=True, slots=True)
class Label:
    """A text at a location or an edge."""

    text: str
    line: int


@dataclass(frozen=True, slots=True)
class Location:
    """A location; of its labels `invariant` and `exponentialrate` matter."""

    name: str
    labels: dict[str, Label]
    is_urgent: bool
    is_committed: bool
    line: int


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge between locations, or from or to a branch point; `name` is its id, or counts from 1 in its template."""

    name: str
    source: str
    target: str
    labels: dict[str, Label]
    line: int


@dataclass(frozen=True, slots=True)
class Template:
    """A template; `locations` are by id, and `forks` are the ids of its branch points."""

    name: str
    parameters: tuple[Declared, ...]
    declarations: list[Declaration]
    locations: dict[str, Location]
    forks: frozenset[str]
    initial: str
    edges: tuple[Edge, ...]
    line: int

    def ways(self) -> list[tuple[Edge, ...]]:
        """Return the ways from location to location: an edge, or two with a branch point between."""
        found: list[tuple[Edge, ...]] = []
        leaving = {fork: [edge for edge in self.edges if edge.source == fork] for fork in self.forks}
        for edge in self.edges:
            if edge.source in self.locations:
                found += [(edge,)] if edge.target in self.locations else [(edge, each) for each in leaving[edge.target]]
        return found


def read_template(element: Element, origin: str) -> Template:
    """Return a template of a file.

    Args:
        element: a `template` element.
        origin: the file's name, for messages.

    Raises:
        BadModel: it has no name or initial location, an edge leads nowhere, or a declaration is not well formed.
    """
    where = f"{origin}:{element.line}"
    name = label_of(element.first("name")).text.strip()
    if not name:
        raise BadModel(where, "a template must have a name, but this one has none", "name it", slug="uppaal-structure")
    parameters, declared = label_of(element.first("parameter")), label_of(element.first("declaration"))
    names = Names()
    locations = {each.get("id"): _location(each, names) for each in element.all("location")}
    forks = frozenset(each.get("id") for each in element.all("branchpoint"))
    start = element.first("init")
    initial = start.get("ref") if start is not None else ""
    edges = []
    for number, each in enumerate(element.all("transition"), 1):
        source, target = (end.get("ref") if end is not None else "" for end in map(each.first, ("source", "target")))
        for end in (source, target):
            if end not in locations and end not in forks:
                rule = f"an edge of {name!r} must join locations, but {end!r} is none"
                raise BadModel(f"{origin}:{each.line}", rule, slug="uppaal-structure")
        if source in forks and target in forks:
            rule = f"an edge of {name!r} must not join two branch points, but this one does"
            raise BadModel(f"{origin}:{each.line}", rule, slug="uppaal-structure")
        edges.append(Edge(_name(each) or str(number), source, target, _labels(each), each.line))
    return Template(
        name,
        parse_parameters(parameters.text, origin, parameters.line),
        parse_declarations(declared.text, origin, declared.line),
        locations,
        forks,
        initial,
        tuple(edges),
        element.line,
    )


def label_of(element: Element | None) -> Label:
    """Return the text of an element with the line where it starts; an empty one if there is no element."""
    if element is None:
        return Label("", 1)
    blank = len(element.text) - len(element.text.lstrip())
    return Label(
        element.text[blank:].rstrip(), (element.text_line or element.line) + element.text.count("\n", 0, blank)
    )


def _name(element: Element) -> str:
    # UPPAAL numbers elements by ids such as id7, which say nothing.
    id = element.get("id")
    return "" if re.fullmatch(r"id[0-9]+", id) else as_label(id) if id else ""


def _location(element: Element, names: Names) -> Location:
    name = label_of(element.first("name")).text or element.get("id")
    is_urgent, is_committed = (element.first(kind) is not None for kind in ("urgent", "committed"))
    return Location(names.label(name), _labels(element), is_urgent, is_committed, element.line)


def _labels(element: Element) -> dict[str, Label]:
    found = {each.get("kind"): label_of(each) for each in element.all("label")}
    return {kind: label for kind, label in found.items() if label.text}
