"""Reads an SCXML document as a model of one component, whose machines are the document or its regions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from pathlib import PurePath

from parcours.errors import BadModel
from parcours.model.conversion import ForeignModel, accepted
from parcours.model.expression import Assignment, Binary, Call, Literal, Name
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
from parcours_formats.guard_languages import variables
from parcours_formats.guard_languages.values import TRUE, conjunction, is_constant, replaced
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames, as_label
from parcours_formats.scxml.chart import Arc, ChartConfiguration, ChartReader, StateNode, exits
from parcours_formats.scxml.content import ContentOutcome, ContentRunner, DataScope, is_astray, is_inward
from parcours_formats.scxml.datamodel import DataModel
from parcours_formats.scxml.flattening import MAX_STEPS, Flat, Flattening, beginnings, plain
from parcours_formats.xml_lines import Element, parse_xml

EVENT = "Event"
"""The message class of every channel: what events carry is not known."""

CAPACITY = 8
"""How many events of one name wait at the document that sends them to itself; there, any number does."""

MAX_EVENTS = 2_000
"""Most events of one document."""

ERROR = "error.execution"
"""What SCXML raises where content fails."""

START = "(start)"
"""The state before the first configuration, where entering that does something."""


def read(text: str, origin: str) -> ForeignModel:
    """Return the chart of an SCXML document as a model. Raises BadModel if it says what cannot be translated."""
    root = parse_xml(text, origin)
    if root.tag != "scxml":
        rule = f"the root element must be scxml, but is {root.tag[:40]!r}"
        raise BadModel(f"{origin}:{root.line}", rule, slug="format")
    return _System(root, origin).reading()


class _System:
    def __init__(self, root: Element, origin: str) -> None:
        self.element, self.origin = root, origin
        self.data = DataModel(root, origin)
        self.losses = Losses(self.data.losses)
        self._stray(root)
        self.chart = ChartReader(root, origin)
        self.content = ContentRunner(origin, self.losses)
        self.component = UniqueNames().identifier(root.get("name") or PurePath(origin).stem)
        self.inward = sorted(self._inward())
        self.events = self._events()
        self.ids, self.channel_names = UniqueNames(), UniqueNames()
        self.channels: dict[tuple[str, str], Channel] = {}
        self.clocks: dict[str, tuple[str, float]] = {}

    def reading(self) -> ForeignModel:
        """Return the model and what the document says beyond it."""
        # The clocks of delays come before the machines, whose transitions set and read them.
        flats = self._flats()
        self._time(flats.values())
        machines, names = [], UniqueNames()
        for region, flat in flats.items():
            name = names.label(self.component if region.kind == "scxml" else region.id)
            machines.append(self._machine(name, flat, region))
        self._report()
        self._report_unused(flats)
        later = [each for machine in machines for step in machine.transitions for each in step.actions]
        initial = [Assignment(variable, value) for variable, value in self.data.initial.items()]
        assigned = [each for each in later if isinstance(each, Assignment)]
        declared = variables(initial, assigned, f"{self.origin}: <datamodel>")
        clocks = tuple(Variable(clock, CLOCK, None, unit="s") for clock, _ in self.clocks.values())
        component = Component(self.component, tuple(machines), (*declared, *clocks), line=self.element.line)
        messages = (MessageClass(EVENT, ()),) if self.channels else ()
        title = as_label(self.element.get("name") or PurePath(self.origin).stem)
        cefsm = Cefsm(title, (component,), tuple(self.channels.values()), messages, source=self.origin)
        return accepted(cefsm, self.losses)

    def _flats(self) -> dict[StateNode, Flat]:
        """Return the machines: the document, or its regions where these share nothing but data.

        Regions that answer the same event take it at once, which one machine for all of them says exactly; only
        where that has too many configurations, they are machines that take the event one after the other.
        """
        root, top = self.chart.root, self.chart.root.inner()[0]
        regions = top.inner()
        if len(root.inner()) > 1 or top.kind != "parallel" or not self._are_apart(top):
            return {root: self._flat(root)}
        answered = [_descriptors(region) for region in regions]
        shared = [event for event in self.events if sum(_is_among(event, each) for each in answered) > 1]
        if shared:
            try:
                return {root: self._flat(root)}
            except BadModel as error:
                if error.slug != "expansion-size":
                    raise
            rule = f"regions that answer {', '.join(shared[:9])} take it at once there; here one of them does"
            self.losses.add(f"parallel {top.id!r}", top.line, rule, alters=True)
        if sum(any(not arc.events for arc in _arcs(region)) for region in regions) > 1:
            rule = "regions with transitions without events take them at once there; here one after the other"
            self.losses.add(f"parallel {top.id!r}", top.line, rule, alters=True)
        return {region: self._flat(region) for region in regions}

    def _flat(self, region: StateNode) -> Flat:
        descriptors = _descriptors(region)
        events = [event for event in self.events if _is_among(event, descriptors)]
        data = self.data
        said = (data.kinds, frozenset[str](), data.missing, data.wholes, data.parts)
        scope = DataScope("javascript", *said, document=self.element.get("name"))
        return Flattening(region, events, self.content, scope, self.origin).flat()

    def _are_apart(self, top: StateNode) -> bool:
        """Return whether the regions of the only state of the document see nothing of each other but data."""
        whole = ChartConfiguration(frozenset(self.chart.root.walk()))
        if top.arcs or top.entry or self.chart.root.start_content or _asks_for_states(self.element):
            return False
        for region in top.inner():
            inside = {node.id for node in region.walk()}
            for arc in _arcs(region):
                ends = {each.removeprefix("done.state.") for each in arc.events if each.startswith("done.state.")}
                if not ends <= inside or any(not node.is_inside(region) for node in exits(arc, whole)):
                    return False
        return True

    def _stray(self, root: Element) -> None:
        """Let each block end where an event is sent to nowhere: there, an error is raised instead."""
        descriptors = {plain(each) for element in root.walk() if element.tag == "transition"
                       for each in element.get("event").split()}  # fmt: skip
        raised = [{"event": ERROR}] if _is_among(ERROR, descriptors) else []
        for parent in root.walk():
            kept, is_over = list[Element](), False
            for child in parent.children:
                is_over = is_over and child.tag not in ("else", "elseif")
                if is_astray(child):
                    rule = f"its target is invalid: {ERROR} is raised, and the rest of its block is not done"
                    self.losses.add("<send>", child.line, rule)
                    kept += [Element("raise", "", each, child.line) for each in raised if not is_over]
                    is_over = True
                if not is_over:
                    kept.append(child)
            if parent.tag == "if" and any(map(is_astray, parent.children)):
                rule = "what follows a failed send is left out inside it only"
                self.losses.add("<if>", parent.line, rule, alters=True)
            parent.children = kept

    def _inward(self) -> Iterable[str]:
        for element in self.element.walk():
            if element.get("event") and is_inward(element):
                yield element.get("event")

    def _events(self) -> list[str]:
        arcs = _arcs(self.chart.root)
        named = [each for arc in arcs for each in arc.events]
        ends = {f"done.state.{id}" for id in self.chart.nodes}
        found = list(dict.fromkeys(each for each in (*map(plain, named), *self.inward) if each and each not in ends))
        if len(arcs) > MAX_STEPS or len(found) > MAX_EVENTS:
            rule = f"a chart has at most {MAX_STEPS} transitions and {MAX_EVENTS} events, but this one has more"
            raise BadModel(f"{self.origin}:{self.element.line}", rule, "split the chart", slug="expansion-size")
        if any(each.endswith("*") for each in named):
            rule = "an event with * is read as one of the events that the document names"
            self.losses.add("<scxml>", self.element.line, rule, alters=True)
        return found or (["any"] if named else [])

    def _time(self, flats: Iterable[Flat]) -> None:
        """Give each event that is always sent with the same delay a clock that says how long ago that was."""
        delays: dict[str, set[float]] = {}
        for flat in flats:
            for outcome in (*flat.starts, *(step.outcome for step in flat.steps)):
                for each in outcome.sent:
                    if not each.is_outward:
                        delays.setdefault(each.event, set()).add(each.delay)
        #   send e, delay d:  since_e := 0  ...  e arrives:  guard since_e >= d
        names = UniqueNames(self.data.lines)
        for event, found in delays.items():
            if len(found) == 1 and found != {0.0}:
                self.clocks[event] = (names.identifier(f"since_{event}"), min(found))
                rule = f"arrives {min(found):g} s after each send there; here then or later, after the last"
                self.losses.add(f"event {event!r}", self.element.line, rule, alters=True)
            elif len(found) > 1:
                rule = "is sent with several delays; here it may arrive at any time"
                self.losses.add(f"event {event!r}", self.element.line, rule, alters=True)

    def _machine(self, name: str, flat: Flat, region: StateNode) -> Machine:
        transitions = []
        for step in flat.steps:
            silent = step.event not in self.inward and all(arc.is_silent for arc in step.arcs)
            event = "" if silent else step.event
            noted = step.arcs[0].id if len(step.arcs) == 1 else ""
            id = self.ids.label(noted or f"{step.source}:{event or 'always'}")
            transitions.append(self._transition(id, step.source, step.target, event, step.outcome, step.arcs[0].line))
        states, initial = flat.states, flat.initial
        if not self._starts(flat.starts):
            states, initial = (START, *states), START
            ends = (START, flat.initial, "")
            first = [self._transition(self.ids.label(START), *ends, each, region.line) for each in flat.starts]
            transitions = first + transitions
        return Machine(name, initial, states, tuple(transitions), flat.final, line=region.line)

    def _transition(
        self, id: str, source: str, target: str, event: str, outcome: ContentOutcome, line: int
    ) -> Transition:
        guard, actions = outcome.branch.guard, list[Assignment | Call](outcome.branch.actions)
        for each in outcome.sent:
            if not each.is_outward and each.event in self.clocks:
                actions.append(Assignment(self.clocks[each.event][0], Literal(0)))
        if event in self.clocks:
            clock, delay = self.clocks[event]
            guard = conjunction((guard, Binary(">=", Name(clock), Literal(delay))))
        receive = Receive(self._channel(event, inward=True)) if event else None
        sends = tuple(Send(self._channel(each.event, inward=not each.is_outward)) for each in outcome.sent)
        holds = None if guard == TRUE else guard
        return Transition(id, source, target, receive, holds, tuple(actions), sends, line=line)

    def _starts(self, starts: Sequence[ContentOutcome]) -> bool:
        """Take what entering the first configuration does into the initial values, if that is all it does."""
        if len(starts) != 1 or starts[0].branch.guard != TRUE or starts[0].sent:
            return False
        before = self.data.initial
        after = {name: replaced(value, before) for name, value in starts[0].branch.held(self.origin).items()}
        if not all(map(is_constant, after.values())):
            return False
        self.data.initial = {**before, **after}
        return True

    def _channel(self, event: str, *, inward: bool) -> str:
        sender = self.component if not inward or event in self.inward else ENVIRONMENT
        receiver = self.component if inward else ENVIRONMENT
        if (event, receiver) not in self.channels:
            name = self.channel_names.identifier(event)
            capacity = CAPACITY if sender == receiver else 1
            topic = event if event != name else ""
            self.channels[event, receiver] = Channel(name, sender, receiver, EVENT, topic, capacity)
        return self.channels[event, receiver].name

    def _report(self) -> None:
        line = self.element.line
        for name, reason in self.data.missing.items():
            self.losses.add(f"data {name!r}", self.data.lines[name], f"is left out: {reason.rule}")
        for each in self.chart.invoked:
            self.losses.add("<invoke>", each.line, "what is invoked is left out", alters=True)
        for each in self.element.walk():
            if each.tag == "donedata":
                rule = "what the end of a state carries is left out, and so are errors in it"
                self.losses.add("<donedata>", each.line, rule, alters=True)
        arcs = _arcs(self.chart.root)
        ends = [arc for arc in arcs if any(plain(event).startswith("done.state") for event in arc.events)]
        if ends and (self.inward or not all(arc.events for arc in arcs) or any(arc.condition for arc in ends)):
            there = "the end of a state is an event in the queue there"
            rule = f"{there}; here it goes before all others, as long as the state is at its end"
            self.losses.add("<transition>", ends[0].line, rule, alters=True)
        if any(channel.sender == channel.receiver for channel in self.channels.values()):
            there = "events from inside go before those from outside there, and are dropped if no transition answers"
            here = f"here they wait, {CAPACITY} of a name, and go in any order"
            self.losses.add("<scxml>", line, f"{there} them; {here}", alters=True)

    def _report_unused(self, flats: Mapping[StateNode, Flat]) -> None:
        """Note the states and transitions of the document that nothing leads to."""
        for region, flat in flats.items():
            for node in region.walk():
                if node.kind == "history":
                    continue
                if node is not region and node not in flat.nodes:
                    self.losses.add(f"state {node.id!r}", node.line, "can never be entered; left out")
                for number, arc in enumerate(node.arcs, 1):
                    if arc not in flat.arcs:
                        where = f"transition {number} of state {node.id!r}"
                        self.losses.add(where, arc.line, "can never be taken; left out")


def _arcs(node: StateNode) -> list[Arc]:
    return [arc for each in node.walk() if each.kind != "history" for arc in each.arcs]


def _descriptors(region: StateNode) -> set[str]:
    return {plain(descriptor) for arc in _arcs(region) for descriptor in arc.events}


def _asks_for_states(root: Element) -> bool:
    return any("In(" in text for element in root.walk() for text in (element.text, *element.attributes.values()))


def _is_among(event: str, descriptors: Set[str]) -> bool:
    return not descriptors.isdisjoint(beginnings(event))
