"""Works out the steps of a process: texts are translated, selections and varying channels written out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Expression, Literal
from parcours_formats.guard_languages import Branch, ForeignTokens, Translation, sized
from parcours_formats.guard_languages.foreign_syntax import Parser
from parcours_formats.guard_languages.values import FALSE, TRUE, conjunction
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames
from parcours_formats.uppaal.declarations import parse_selections
from parcours_formats.uppaal.environment import Environment
from parcours_formats.uppaal.execution import updates as updates_of
from parcours_formats.uppaal.processes import Label, ProcessInstance, TemplateEdge
from parcours_formats.uppaal.symbols import UppaalChannel

MAX_STEPS = 200_000
"""Most steps of all processes together."""


@dataclass(frozen=True, slots=True)
class ProcessStep:
    """One way of a process from location to location. `sign` is `!` or `?` if it meets another at `link`."""

    id: str
    source: str
    target: str
    guard: Expression
    actions: tuple[Assignment, ...]
    link: UppaalChannel | None
    sign: str
    weight: float
    line: int


class StepWriter:
    """Writes out the steps of the processes of one file; `losses` grows."""

    def __init__(self, origin: str) -> None:
        self.origin, self.count, self.ids, self.losses = origin, 0, UniqueNames(), Losses()

    def of(self, process: ProcessInstance) -> Iterator[ProcessStep]:
        """Yield the steps of a process."""
        locations, ways = process.template.locations, process.template.ways()
        self._bounded(len(ways), process.template.line)
        for way in ways:
            source, target = locations[way[0].source].name, locations[way[-1].target].name
            line, before = way[0].line, self.count
            for environment, suffix in self._selected(process.environment, way):
                id = ".".join(edge.name for edge in way) + suffix
                if process.name != process.template.name or way[0].name.isdecimal():
                    id = f"{process.name}.{id}"
                found = self._written_out(way, environment)
                self._bounded(len(found), line)
                self.count += len(found)
                for number, (guard, branch, link, sign) in enumerate(found, 1):
                    own = f"{id}#{number}" if len(found) > 1 else id
                    weight = self._weight(way, environment)
                    yield ProcessStep(
                        self.ids.label(own), source, target, guard, branch.actions, link, sign, weight, line
                    )
            if self.count == before:
                where = f"edge from {source!r} to {target!r} of {process.name!r}"
                self.losses.add(where, line, "its guard is false whatever happens; it is left out")

    def _bounded(self, more: int, line: int) -> None:
        if self.count + more > MAX_STEPS:
            rule = f"a system is written out to at most {MAX_STEPS} steps, but this one goes beyond"
            raise BadModel(self._where(line), rule, "make its ranges smaller", slug="expansion-size")

    def _selected(self, around: Environment, way: tuple[TemplateEdge, ...]) -> Iterator[tuple[Environment, str]]:
        labels = _labels(way, "select")
        selections = [each for label in labels for each in parse_selections(label.text, *self._at(label))]
        where = self._where(way[0].line)
        ranges = [around.shape(each.type, where).values(where) for each in selections]
        # Texts are translated again for each selection, and for each process.
        size = sum(len(label.text) for edge in way for label in edge.labels.values())
        selected = prod(len(tuple(each)) for each in ranges)
        around.cells.spend(where, selected * (size // 400 + bool(selections)))
        for chosen in product(*ranges):
            environment = around.inner()
            for each, value in zip(selections, chosen, strict=True):
                environment.hold(each.name, value)
            shown = ",".join(f"{each.name}={value}" for each, value in zip(selections, chosen, strict=True))
            yield environment, f"[{shown}]" if shown else ""

    def _written_out(
        self, way: tuple[TemplateEdge, ...], environment: Environment
    ) -> list[tuple[Expression, Branch, UppaalChannel | None, str]]:
        guards = [self.condition(label, environment) for label in _labels(way, "guard")]
        if FALSE in guards:  # a selection may put an index outside its array where the guard forbids it
            return []
        meetings: list[tuple[Expression, UppaalChannel | None, str]] = [(TRUE, None, "")]
        for label in _labels(way, "synchronisation"):
            meetings = list(self._meetings(label, environment))
        updates = [Branch(TRUE, ())]
        labels = _labels(way, "assignment")
        if labels:
            text = ", ".join(label.text.rstrip(" \n,;") for label in labels)
            updates = updates_of(text, environment, self.origin, labels[0].line)
        found = []
        for (case, link, sign), branch in product(meetings, updates):
            guard = conjunction((*guards, case, branch.guard))
            if guard != FALSE:
                found.append((sized(guard, self._where(way[0].line)), branch, link, sign))
        return found

    def condition(self, label: Label, environment: Environment) -> Expression:
        """Return the condition that a label says; the commas of old files mean `and`."""
        tokens = ForeignTokens(label.text, "uppaal", *self._at(label))
        parser, translation = Parser(tokens), Translation(environment, self._where(label.line))
        parts = []
        while tokens.token.kind != "end":
            parts.append(translation.truth(parser.condition()))
            if not (tokens.accept(",") or tokens.accept(";")) and tokens.token.kind != "end":
                tokens.fail("an operator or the end")
        return conjunction(parts)

    def _meetings(self, label: Label, environment: Environment) -> Iterator[tuple[Expression, UppaalChannel, str]]:
        tokens = ForeignTokens(label.text, "uppaal", *self._at(label))
        place = Parser(tokens).place()
        sign = tokens.token.text
        if sign not in ("!", "?"):
            tokens.fail("'!' or '?'")
        tokens.position += 1
        if tokens.token.kind != "end":
            tokens.fail("the end")
        for case, link in environment.links(place, self._where(label.line)):
            yield case, link, sign

    def _weight(self, way: tuple[TemplateEdge, ...], environment: Environment) -> float:
        weight = 1.0
        for label in _labels(way[1:], "probability"):
            tree = Parser(ForeignTokens(label.text, "uppaal", *self._at(label))).condition()
            weight *= environment.constant(tree, self._where(label.line)) if tree != Literal(1) else 1
        return weight

    def _at(self, label: Label) -> tuple[str, int]:
        return self.origin, label.line

    def _where(self, line: int) -> str:
        return f"{self.origin}:{line}"


def _labels(way: tuple[TemplateEdge, ...], kind: str) -> list[Label]:
    return [edge.labels[kind] for edge in way if kind in edge.labels]
