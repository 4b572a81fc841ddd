"""Flattens a chart: hierarchy, orthogonal regions and histories become transitions between configurations.

Each configuration that can be reached becomes a state, and each set of transitions that SCXML would take together
becomes one transition, with the content of exits, transitions and entries in the order of the standard. Inner
transitions go before outer ones and earlier before later ones: their conditions stand negated in the guards.

    parallel p                                 (a1, b1) --e--> (a2, b2)      both regions answer e at once
      region a:  a1 --e-----> a2       =>      (a1, b1) --f--> (a1, b2)
      region b:  b1 --e, f--> b2               (a1, b2) --e--> (a2, b2)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod

from parcours.errors import BadModel
from parcours.model.expression import Expression
from parcours_formats.guard_languages import sized
from parcours_formats.guard_languages.values import FALSE, MAX_CASES, TRUE, conjunction, negation
from parcours_formats.scxml.chart import (
    Arc,
    ChartConfiguration,
    StateNode,
    arrived,
    in_order,
    start,
    take,
    without_conflicts,
)
from parcours_formats.scxml.content import ContentOutcome, ContentRunner, DataScope

MAX_CONFIGURATIONS = 1_000
"""Most configurations of one machine."""

MAX_STEPS = 10_000
"""Most transitions of one machine."""

MAX_PAIRS = 100_000
"""Most pairs of a transition and an event that it answers."""


@dataclass(frozen=True, slots=True)
class FlatTransition:
    """One transition between configurations, given by their names; `event` is empty for a spontaneous one."""

    source: str
    target: str
    event: str
    outcome: ContentOutcome
    arcs: tuple[Arc, ...]


@dataclass(frozen=True, slots=True)
class Flat:
    """A flattened chart; `starts` are what happens on the way into the first configuration.

    `nodes` and `arcs` are the states and transitions of the document that this comes from.
    """

    initial: str
    starts: tuple[ContentOutcome, ...]
    states: tuple[str, ...]
    final: tuple[str, ...]
    steps: tuple[FlatTransition, ...]
    nodes: frozenset[StateNode] = frozenset()
    arcs: frozenset[Arc] = frozenset()


class Flattening:
    """Flattens one chart, or one region of it."""

    def __init__(
        self, root: StateNode, events: Sequence[str], content: ContentRunner, scope: DataScope, origin: str
    ) -> None:
        self.root, self.content, self.scope, self.origin = root, content, scope, origin
        self.order = {event: number for number, event in enumerate(events)}
        self.matching: dict[str, list[str]] = {}
        for event in events:
            for beginning in beginnings(event):
                self.matching.setdefault(beginning, []).append(event)
        self._pairs = 0
        self._answering: dict[StateNode, dict[str, list[Arc]]] = {}
        self._ended: set[Arc] = set()

    def flat(self) -> Flat:
        """Return the machine."""
        # Breadth first over configurations: all guards stay symbolic, so that only states are enumerated.
        first, beginning = start(self.root)
        steps: list[FlatTransition] = []
        seen = {first: first.name}
        border, final = [first], list[str]()
        while border:
            here = border.pop(0)
            if self.is_over(here):
                final.append(here.name)
                continue
            for event, guard, arcs in self.choices(here):
                after, leaving, entering = take(arcs, here)
                if after not in seen:
                    seen[after] = after.name
                    border.append(after)
                    if len(seen) > MAX_CONFIGURATIONS:
                        self.fail(f"a chart has at most {MAX_CONFIGURATIONS} configurations, but this one has more")
                # `In(id)` already sees the new configuration on entry, and still the old one on exit.
                outcomes = self.content.run(leaving, self.within(here, event))
                outcomes = self.content.run(entering, self.within(after, event), outcomes)
                for outcome in self.ended(here, after, outcomes):
                    whole = conjunction((guard, outcome.branch.guard))
                    if whole != FALSE:
                        steps.append(FlatTransition(here.name, after.name, event, outcome.under(whole), arcs))
                if len(steps) > MAX_STEPS:
                    self.fail(f"a chart has at most {MAX_STEPS} transitions when flattened, but this one has more")
        starts = self.content.run(beginning, self.within(first, ""))
        nodes = frozenset(node for here in seen for node in here.active)
        used = self._ended.union(arc for step in steps for arc in step.arcs)
        return Flat(first.name, tuple(starts), tuple(seen.values()), tuple(final), tuple(steps), nodes, frozenset(used))

    def ended(
        self, here: ChartConfiguration, after: ChartConfiguration, outcomes: list[ContentOutcome]
    ) -> list[ContentOutcome]:
        """Return outcomes with what transitions without target do when the states they wait for come to their end."""
        over = {f"done.state.{node.id}" for node in after.active if arrived(after, node) and not arrived(here, node)}
        for arc in (arc for node in sorted(after.active, key=in_order) for arc in node.arcs if not arc.targets):
            if any(plain(each) in over for each in arc.events):
                self._ended.add(arc)
                scope, option = self.within(after, ""), (arc.condition, f"{self.origin}:{arc.line}: cond", arc.content)
                outcomes = [each for outcome in outcomes for each in self.content.chosen([option], scope, outcome)]
        return outcomes

    def is_over(self, here: ChartConfiguration) -> bool:
        """Return whether a top state of the document is final: nothing happens any more."""
        tops = self.root.inner() if self.root.kind == "scxml" else []
        return any(node.kind == "final" and node in here.active for node in tops)

    def choices(self, here: ChartConfiguration) -> Iterator[tuple[str, Expression, tuple[Arc, ...]]]:
        """Yield event, guard and transitions of each way on; spontaneous ones go before events."""
        # SCXML looks at the event queue only when no transition without event can go: hence `resting`.
        spontaneous = list(self.sets(here, ""))
        resting = conjunction(negation(guard) for guard, _ in spontaneous)
        for guard, arcs in spontaneous:
            yield "", guard, arcs
        if resting == FALSE:
            return
        awaited = {event for node in here.active for event in self.answering(node)}
        for event in sorted(awaited, key=self.order.__getitem__):
            for guard, arcs in self.sets(here, event):
                if (both := conjunction((resting, guard))) != FALSE:
                    yield event, both, arcs

    def sets(self, here: ChartConfiguration, event: str) -> Iterator[tuple[Expression, tuple[Arc, ...]]]:
        """Yield the sets of transitions that an event may bring about, each with the condition for it."""
        scope = self.within(here, event)
        options: list[list[tuple[Expression, Arc | None]]] = []
        for atom in here.atoms():
            rest: Expression = TRUE
            own: list[tuple[Expression, Arc | None]] = []
            # Innermost first: an inner transition goes before an outer one, whose guard gets its condition negated.
            for node in (atom, *atom.ancestors()):
                for arc in self.answering(node).get(event, ()) if event else self.spontaneous(node, here):
                    if rest != FALSE:
                        holds = self.content.condition(arc.condition, scope, f"{self.origin}:{arc.line}: cond")
                        if (guard := conjunction((rest, holds))) != FALSE:
                            own.append((guard, arc))
                        rest = sized(conjunction((rest, negation(holds))), f"{self.origin}:{arc.line}: cond")
            if own:
                options.append([*own, (rest, None)] if rest != FALSE else own)
        # Each region chooses by itself; conflicts between the choices are settled below.
        count = prod(map(len, options))
        if count > MAX_CASES:
            self.fail(f"an event has at most {MAX_CASES} effects in a configuration, but {event!r} has {count}")
        found: dict[tuple[Arc, ...], list[Expression]] = {}
        for chosen in product(*options):
            guard = conjunction(condition for condition, _ in chosen)
            arcs = tuple(without_conflicts(dict.fromkeys(arc for _, arc in chosen if arc is not None), here))
            if arcs and guard != FALSE:
                found.setdefault(arcs, []).append(guard)
        yield from ((guard, arcs) for arcs, guards in found.items() for guard in guards)

    def answering(self, node: StateNode) -> dict[str, list[Arc]]:
        """Return the transitions of a state by the events they wait for, in the order of the document."""
        if node not in self._answering:
            found: dict[str, list[Arc]] = {}
            for arc in node.arcs:
                for event in dict.fromkeys(each for one in arc.events for each in self.matching.get(plain(one), ())):
                    found.setdefault(event, []).append(arc)
                self._pairs += sum(map(len, (self.matching.get(plain(one), ()) for one in arc.events)))
                if self._pairs > MAX_PAIRS:
                    self.fail(f"a chart has at most {MAX_PAIRS} pairs of transitions and events, but this one has more")
            self._answering[node] = found
        return self._answering[node]

    def spontaneous(self, node: StateNode, here: ChartConfiguration) -> Iterator[Arc]:
        """Yield the transitions that wait for nothing, or for the end of states that have come to it."""
        over = [f"done.state.{one.id}" for one in here.active if arrived(here, one)]
        ended = {each for event in over for each in beginnings(event) if each}
        for arc in node.arcs:
            if not arc.events or (arc.targets and any(plain(each) in ended for each in arc.events)):
                yield arc

    def within(self, here: ChartConfiguration, event: str) -> DataScope:
        """Return the scope of a configuration in which an event has arrived."""
        active = frozenset(node.id for node in here.active)
        return replace(self.scope, active=active, event=event)

    def fail(self, rule: str) -> None:
        """Raise the complaint that a chart is too large."""
        raise BadModel(f"{self.origin}:{self.root.line}", rule, "split the chart", slug="expansion-size")


def plain(descriptor: str) -> str:
    """Return an event descriptor without its wildcard: what an event must begin with.

    >>> plain("error.*"), plain("error."), plain("*")
    ('error', 'error', '')
    """
    return descriptor.removesuffix("*").removesuffix(".")


def beginnings(event: str) -> Iterator[str]:
    """Yield what descriptors of an event say: all of it, what stands before each dot, nothing.

    >>> list(beginnings("error.io"))
    ['error.io', 'error', '']
    """
    while event:
        yield event
        event = event.rpartition(".")[0]
    yield ""
