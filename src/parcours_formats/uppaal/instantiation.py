"""Templates and a system line to processes: parameters bound, ranges of parameters written out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from parcours.errors import BadModel, one_of
from parcours_formats.guard_languages import refusal
from parcours_formats.guard_languages.tree import Tree
from parcours_formats.uppaal.declared import Declaration, Declared, Instance, Routine, System
from parcours_formats.uppaal.environment import Environment
from parcours_formats.uppaal.templates import Template

MAX_PROCESSES = 50_000
"""Most processes of a system."""

_NESTED = 20


@dataclass(frozen=True, slots=True)
class Process:
    """An instance of a template: its name, e.g. `Train(0)`, and what its texts see."""

    name: str
    template: Template
    environment: Environment


class Instantiation:
    """Makes the processes of a system.

    Args:
        templates: by name.
        declared: the declarations of the file and of its system, in order.
        around: the global scope.
        origin: the file's name, for messages.
    """

    def __init__(
        self, templates: dict[str, Template], declared: list[Declaration], around: Environment, origin: str
    ) -> None:
        self.templates, self.around, self.origin = templates, around, origin
        self.instances = {each.name: each for each in declared if isinstance(each, Instance)}
        self.systems = [each for each in declared if isinstance(each, System)]

    def processes(self) -> list[Process]:
        """Return the processes that the system line names.

        Raises:
            BadModel: it names none, or something unknown, or a template in a circle; too many processes.
        """
        if not self.systems:
            raise BadModel(self.origin, "a file must have a system line, but has none", slug="uppaal-structure")
        found: list[Process] = []
        for name in self.systems[-1].names:
            where = f"{self.origin}:{self.systems[-1].line}"
            instance = self.instances.get(name)
            parameters = instance.parameters if instance is not None else self.template(name, where).parameters
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
                found.append(Process(shown, template, local))
        return found

    def template(self, name: str, where: str) -> Template:
        """Return a template. Raises BadModel if there is none of that name."""
        if name not in self.templates:
            rule = f"a process must be an instance of a template, but {name!r} is none"
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
        parameters = inner.parameters if inner is not None else self.template(instance.template, where).parameters
        if len(parameters) != len(instance.arguments):
            rule = (
                f"{instance.template!r} has {len(parameters)} parameters, but gets {len(instance.arguments)} arguments"
            )
            raise BadModel(where, rule, slug="arity")
        given = self.around.inner()
        for parameter, argument in zip(parameters, instance.arguments, strict=True):
            self.give(parameter, argument, scope, given, where)
        return self.bound(instance.template, given, where, depth + 1)

    def give(self, parameter: Declared, argument: Tree, scope: Environment, given: Environment, where: str) -> None:
        """Let a parameter mean its argument: the place itself, or its value."""
        shape = self.around.shape(parameter.type, where, parameter.lengths)
        if parameter.is_reference or shape.lengths or shape.kind in ("chan", "clock", "struct"):
            places = scope.locate(argument, where)
            if len(places) != 1:
                raise refusal(where, "an index that varies in an argument")
            given.names[parameter.name] = places[0][1]
        else:
            value = scope.constant(argument, where)
            given.hold(parameter.name, bool(value) if shape.kind == "bool" else value)
