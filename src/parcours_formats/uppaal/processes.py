"""Reads templates and makes the processes of a system: parameters are bound, their ranges written out."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from parcours.errors import BadModel, one_of
from parcours.model.expression import Expression
from parcours_formats.guard_languages import refusal
from parcours_formats.naming import UniqueNames, as_label
from parcours_formats.uppaal import declarations
from parcours_formats.uppaal.declarations import Declaration, Declared, InstanceLine, Routine, SystemLine
from parcours_formats.uppaal.environment import Environment
from parcours_formats.xml_lines import Element

MAX_PROCESSES = 50_000
"""Most processes of a system."""

_NESTED = 20


@dataclass(frozen=True, slots=True)
class ProcessInstance:
    """An instance of a template: its name, e.g. `Train(0)`, and what its texts see."""

    name: str
    template: Template
    environment: Environment


class Instantiation:
    """Makes the processes of a system."""

    def __init__(
        self, templates: dict[str, Template], declared: list[Declaration], around: Environment, origin: str
    ) -> None:
        self.templates, self.around, self.origin = templates, around, origin
        self.instances = {each.name: each for each in declared if isinstance(each, InstanceLine)}
        self.systems = [each for each in declared if isinstance(each, SystemLine)]

    def processes(self) -> list[ProcessInstance]:
        """Return the processes that the system line names."""
        if not self.systems:
            raise BadModel(self.origin, "a file must have a system line, but has none", slug="uppaal-structure")
        found: list[ProcessInstance] = []
        for name in self.systems[-1].names:
            where = f"{self.origin}:{self.systems[-1].line}"
            parameters = (self.instances.get(name) or self.template(name, where)).parameters
            for scope, values in self.choices(parameters, where, MAX_PROCESSES - len(found)):
                template, environment = self.bound(name, scope, where, 0)
                if template.initial not in template.locations:
                    rule = f"template {template.name!r} must have an initial location, but has none"
                    at = f"{self.origin}:{template.line}"
                    raise BadModel(at, rule, "add <init ref=.../>", slug="uppaal-structure")
                shown = f"{name}({','.join(values)})" if values else name
                local = environment.inner(f"{shown}.")
                size = len(template.declarations) + len(template.locations) + len(template.edges)
                local.cells.allow(len(found) + 1)
                local.cells.spend(where, size // 16)
                for each in template.declarations:
                    if isinstance(each, Declared | Routine):
                        local.declare(each, f"{self.origin}:{each.line}")
                found.append(ProcessInstance(shown, template, local))
        return found

    def template(self, name: str, where: str) -> Template:
        """Return a template. Raises BadModel if there is none of that name."""
        if name not in self.templates:
            rule = f"a process must be an instance of a template, but {name!r} is not one"
            raise BadModel(where, rule, one_of(name[:99], [*self.templates, *self.instances][:50]), slug="unknown-name")
        return self.templates[name]

    def choices(
        self, parameters: tuple[Declared, ...], where: str, most: int
    ) -> Iterator[tuple[Environment, tuple[str, ...]]]:
        """Yield a scope for each choice of values of parameters that nothing was given for."""
        ranges, count = [], 1
        for parameter in parameters:
            shape = self.around.shape(parameter.type, where, parameter.lengths)
            if parameter.is_reference or shape.kind not in ("int", "bool"):
                raise refusal(where, f"a process without a value for the parameter {parameter.name!r}")
            values = shape.values(where)
            ranges.append(values)
            count *= len(tuple(values))
        if count > most:
            total = MAX_PROCESSES - most + count
            rule = f"a system has at most {MAX_PROCESSES} processes, but this one has {total} or more"
            remedy = "make the ranges of the parameters smaller: a few instances of each template behave like many"
            raise BadModel(where, rule, remedy, slug="expansion-size")
        for chosen in product(*ranges):
            scope = self.around.inner()
            for parameter, value in zip(parameters, chosen, strict=True):
                scope.hold(parameter.name, value)
            yield scope, tuple(str(value).lower() for value in chosen)

    def bound(self, name: str, scope: Environment, where: str, depth: int) -> tuple[Template, Environment]:
        """Return the template behind a name, with the scope in which its parameters have their arguments."""
        instance = self.instances.get(name)
        if instance is None:
            return self.template(name, where), scope
        if depth > _NESTED:
            rule = f"an instance must come from a template, but {name!r} comes from itself"
            raise BadModel(where, rule, "name a template", slug="uppaal-structure")
        where = f"{self.origin}:{instance.line}"
        inner = self.instances.get(instance.template)
        parameters = (inner or self.template(instance.template, where)).parameters
        if len(parameters) != len(instance.arguments):
            given = len(instance.arguments)
            rule = f"{instance.template!r} has {len(parameters)} parameters, but gets {given} arguments"
            raise BadModel(where, rule, slug="arity")
        bound = self.around.inner()
        for parameter, argument in zip(parameters, instance.arguments, strict=True):
            self.give(parameter, argument, scope, bound, where)
        return self.bound(instance.template, bound, where, depth + 1)

    def give(
        self, parameter: Declared, argument: Expression, scope: Environment, given: Environment, where: str
    ) -> None:
        """Let a parameter mean its argument: the place itself, or its value."""
        shape = self.around.shape(parameter.type, where, parameter.lengths)
        if parameter.is_reference or shape.lengths or shape.kind in ("chan", "clock", "struct"):
            given.names[parameter.name] = scope.place(argument, where)
        else:
            value = scope.constant(argument, where)
            given.hold(parameter.name, bool(value) if shape.kind == "bool" else value)


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
class TemplateEdge:
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
    edges: tuple[TemplateEdge, ...]
    line: int

    def ways(self) -> list[tuple[TemplateEdge, ...]]:
        """Return the ways from location to location: an edge, or two with a branch point between."""
        #   a ---> (fork) --+--> b       is the ways  a -> b  and  a -> c: UPPAAL has no time and no
        #                   '--> c       other step between the two edges
        found: list[tuple[TemplateEdge, ...]] = []
        leaving = {fork: [edge for edge in self.edges if edge.source == fork] for fork in self.forks}
        for edge in self.edges:
            if edge.source in self.locations:
                found += [(edge,)] if edge.target in self.locations else [(edge, each) for each in leaving[edge.target]]
        return found


def read_template(element: Element, origin: str) -> Template:
    """Return a template of a file."""
    where = f"{origin}:{element.line}"
    name = label_of(element.first("name")).text.strip()
    if not name:
        raise BadModel(where, "a template must have a name, but this one has none", "name it", slug="uppaal-structure")
    parameters, declared = label_of(element.first("parameter")), label_of(element.first("declaration"))
    names = UniqueNames()
    locations = {each.get("id"): _location(each, names) for each in element.all("location")}
    forks = frozenset(each.get("id") for each in element.all("branchpoint"))
    start = element.first("init")
    initial = start.get("ref") if start is not None else ""
    edges = []
    for number, each in enumerate(element.all("transition"), 1):
        source, target = (end.get("ref") if end is not None else "" for end in map(each.first, ("source", "target")))
        for end in (source, target):
            if end not in locations and end not in forks:
                rule = f"an edge of {name!r} must join locations, but {end!r} is not one"
                raise BadModel(f"{origin}:{each.line}", rule, slug="uppaal-structure")
        if source in forks and target in forks:
            rule = f"an edge of {name!r} must not join two branch points, but this one does"
            raise BadModel(f"{origin}:{each.line}", rule, slug="uppaal-structure")
        edges.append(TemplateEdge(_name(each) or str(number), source, target, _labels(each), each.line))
    given = declarations.parse_parameters(parameters.text, origin, parameters.line)
    local = declarations.parse_declarations(declared.text, origin, declared.line)
    return Template(name, given, local, locations, forks, initial, tuple(edges), element.line)


def label_of(element: Element | None) -> Label:
    """Return the text of an element with the line where it starts; an empty one if there is no element."""
    if element is None:
        return Label("", 1)
    blank = len(element.text) - len(element.text.lstrip())
    line = (element.text_line or element.line) + element.text.count("\n", 0, blank)
    return Label(element.text[blank:].rstrip(), line)


def _name(element: Element) -> str:
    # UPPAAL numbers elements by ids such as id7, which say nothing.
    id = element.get("id")
    return "" if re.fullmatch(r"id[0-9]+", id) else as_label(id) if id else ""


def _location(element: Element, names: UniqueNames) -> Location:
    name = label_of(element.first("name")).text or element.get("id")
    is_urgent, is_committed = (element.first(kind) is not None for kind in ("urgent", "committed"))
    return Location(names.label(name), _labels(element), is_urgent, is_committed, element.line)


def _labels(element: Element) -> dict[str, Label]:
    found = {each.get("kind"): label_of(each) for each in element.all("label")}
    return {kind: label for kind, label in found.items() if label.text}
