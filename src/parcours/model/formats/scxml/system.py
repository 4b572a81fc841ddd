"""The text of an SCXML document to a model: one component whose machines are the document or its regions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Binary, Call, Expression, Literal, Name
from parcours.model.formats.foreign import variables
from parcours.model.formats.foreign.values import TRUE, conjunction, is_constant, replaced
from parcours.model.formats.naming import Names, as_label
from parcours.model.formats.reading import Loss, Reading, accepted
from parcours.model.formats.scxml.chart import Arc, ChartReader, Node
from parcours.model.formats.scxml.configuring import Configuration, exits
from parcours.model.formats.scxml.content import Content, DataScope, Outcome, is_inward
from parcours.model.formats.scxml.datamodel import DataModel
from parcours.model.formats.scxml.flattening import Flat, Flattening, matches
from parcours.model.formats.xml_lines import Element, parse_xml
from parcours.model.structure import (
    CLOCK,
    ENVIRONMENT,
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
)

EVENT = "Event"
"""The message class of every channel: what events carry is not known."""

CAPACITY = 8
"""How many events of one name wait at the document that sends them to itself; there, any number does."""

START = "(start)"
"""The state before the first configuration, where entering that does something."""


def read_chart(text: str, origin: str) -> Reading:
    """Return the chart of an SCXML document as a model, as `parcours.model.formats.scxml.read`."""
    root = parse_xml(text, origin)
    if root.tag != "scxml":
        rule = f"the root element must be scxml, but is {root.tag[:40]!r}"
        raise BadModel(f"{origin}:{root.line}", rule, slug="format")
    return _System(root, origin).reading()


class _System:
    def __init__(self, root: Element, origin: str) -> None:
        self.element, self.origin = root, origin
        self.data = DataModel(root, origin)
        self.losses: list[Loss] = list(self.data.losses)
        self.chart = ChartReader(root, origin)
        self.content = Content(origin, self.losses)
        self.component = Names().identifier(root.get("name") or PurePath(origin).stem)
        self.inward = sorted(self._inward())
        self.events = self._events()
        self.ids, self.channel_names = Names(), Names()
        self.channels: dict[tuple[str, str], Channel] = {}
        self.clocks: dict[str, tuple[str, float]] = {}

    def reading(self) -> Reading:
        """Return the model and what the document says beyond it."""
        regions = self._regions()
        events = {region: [each for each in self.events if _answered(region, each)] for region in regions}
        scope = DataScope("javascript", self.data.kinds, frozenset(), self.data.missing)
        flats = {
            region: Flattening(region, events[region], self.content, scope, self.origin).flat() for region in regions
        }
        self._time(flats.values())
        machines, names = [], Names()
        for region, flat in flats.items():
            machines.append(
                self._machine(names.label(self.component if region.kind == "scxml" else region.id), flat, region)
            )
        self._report()
        later = [each for machine in machines for step in machine.transitions for each in step.actions]
        declared = variables(
            self.data.initial, (each for each in later if isinstance(each, Assignment)), f"{self.origin}: <datamodel>"
        )
        clocks = tuple(Variable(clock, CLOCK, None, unit="s") for clock, _ in self.clocks.values())
        component = Component(self.component, tuple(machines), (*declared, *clocks), line=self.element.line)
        messages = (MessageClass(EVENT, ()),) if self.channels else ()
        name = as_label(self.element.get("name") or PurePath(self.origin).stem)
        cefsm = Cefsm(name, (component,), tuple(self.channels.values()), messages, source=self.origin)
        return accepted(cefsm, self.losses)

    def _regions(self) -> list[Node]:
        """Return the regions that can be machines of their own: nothing but data is shared between them."""
        root = self.chart.root
        top = root.inner()[0]
        if (
            len(root.inner()) > 1
            or top.kind != "parallel"
            or top.arcs
            or any("In(" in arc.condition for arc in _arcs(top))
        ):
            return [root]
        regions = top.inner()
        for event in self.events:
            if sum(_answered(region, event) for region in regions) > 1:
                return [root]
        for region in regions:
            whole = Configuration(frozenset(root.walk()))
            if any(not node.is_inside(region) for arc in _arcs(region) for node in exits(arc, whole)):
                return [root]
        if sum(any(not arc.events for arc in _arcs(region)) for region in regions) > 1:
            rule = "regions with transitions without events take them at once there; here one after the other"
            self.losses.append(Loss(f"parallel {top.id!r}", top.line, rule))
        return regions

    def _inward(self) -> Iterable[str]:
        for element in self.element.walk():
            if element.get("event") and is_inward(element):
                yield element.get("event")

    def _events(self) -> list[str]:
        named = [each for arc in _arcs(self.chart.root) for each in arc.events]
        ends = {f"done.state.{id}" for id in self.chart.nodes}
        plain = (each.removesuffix("*").removesuffix(".") for each in named)
        found = list(dict.fromkeys(each for each in (*plain, *self.inward) if each and each not in ends))
        if any(each.endswith("*") for each in named):
            rule = "an event with * is read as one of the events that the document names"
            self.losses.append(Loss("<scxml>", self.element.line, rule))
        return found or (["any"] if named else [])

    def _time(self, flats: Iterable[Flat]) -> None:
        """Give each event that is always sent with the same delay a clock that says how long ago that was."""
        delays: dict[str, set[float]] = {}
        for flat in flats:
            for outcome in (*flat.starts, *(step.outcome for step in flat.steps)):
                for each in outcome.sent:
                    if not each.is_outward:
                        delays.setdefault(each.event, set()).add(each.delay)
        names = Names(self.data.lines)
        for event, found in delays.items():
            if len(found) == 1 and found != {0.0}:
                self.clocks[event] = (names.identifier(f"since_{event}"), min(found))
                rule = f"arrives {min(found):g} s after each send there; here then or later, after the last"
                self.losses.append(Loss(f"event {event!r}", self.element.line, rule))
            elif len(found) > 1:
                rule = "is sent with several delays; here it may arrive at any time"
                self.losses.append(Loss(f"event {event!r}", self.element.line, rule))

    def _machine(self, name: str, flat: Flat, region: Node) -> Machine:
        transitions = []
        for step in flat.steps:
            id = self.ids.label(f"{step.source}:{step.event or 'always'}")
            transitions.append(
                self._transition(id, step.source, step.target, step.event, step.outcome, step.arcs[0].line)
            )
        states, initial = flat.states, flat.initial
        if not self._starts(flat.starts):
            states, initial = (START, *states), START
            transitions = [
                *(
                    self._transition(self.ids.label(START), START, flat.initial, "", each, region.line)
                    for each in flat.starts
                ),
                *transitions,
            ]
        return Machine(name, initial, states, tuple(transitions), flat.final, line=region.line)

    def _transition(self, id: str, source: str, target: str, event: str, outcome: Outcome, line: int) -> Transition:
        guard, actions = outcome.branch.guard, list[Assignment | Call](outcome.branch.actions)
        for each in outcome.sent:
            if not each.is_outward and each.event in self.clocks:
                actions.append(Assignment(self.clocks[each.event][0], Literal(0)))
        if event in self.clocks:
            clock, delay = self.clocks[event]
            guard = conjunction((guard, Binary(">=", Name(clock), Literal(delay))))
        receive = Receive(self._channel(event, inward=True)) if event else None
        sends = tuple(Send(self._channel(each.event, inward=not each.is_outward)) for each in outcome.sent)
        return Transition(
            id, source, target, receive, None if guard == TRUE else guard, tuple(actions), sends, line=line
        )

    def _starts(self, starts: Sequence[Outcome]) -> bool:
        """Take what entering the first configuration does into the initial values, if that is all it does."""
        if len(starts) != 1 or starts[0].branch.guard != TRUE or starts[0].sent:
            return False
        before: dict[str, Expression] = {each.target: each.value for each in self.data.initial}
        after = {name: replaced(value, before) for name, value in starts[0].branch.held().items()}
        if not all(map(is_constant, after.values())):
            return False
        self.data.initial = [Assignment(name, value) for name, value in {**before, **after}.items()]
        return True

    def _channel(self, event: str, *, inward: bool) -> str:
        sender = self.component if not inward or event in self.inward else ENVIRONMENT
        receiver = self.component if inward else ENVIRONMENT
        if (event, receiver) not in self.channels:
            name = self.channel_names.identifier(event)
            capacity = CAPACITY if sender == receiver else 1
            self.channels[event, receiver] = Channel(
                name, sender, receiver, EVENT, event if event != name else "", capacity
            )
        return self.channels[event, receiver].name

    def _report(self) -> None:
        line = self.element.line
        for name, reason in self.data.missing.items():
            self.losses.append(Loss(f"data {name!r}", self.data.lines[name], f"is left out: {reason.rule}"))
        for each in self.chart.invoked:
            self.losses.append(Loss("<invoke>", each.line, "what is invoked is left out"))
        if any(channel.sender == channel.receiver for channel in self.channels.values()):
            rule = (
                "events from inside go before those from outside there, and are dropped if no transition answers them"
            )
            self.losses.append(
                Loss("<scxml>", line, f"{rule}; here they wait, {CAPACITY} of a name, and go in any order")
            )


def _arcs(node: Node) -> list[Arc]:
    return [arc for each in node.walk() if each.kind != "history" for arc in each.arcs]


def _answered(region: Node, event: str) -> bool:
    return any(matches(descriptor, event) for arc in _arcs(region) for descriptor in arc.events)
