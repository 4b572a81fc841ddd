"""Follows a trace event by event, to its first deviation from what the model lets its components do."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import get_args

from parcours.errors import BadRequest, one_of, require_known
from parcours.model.configuration import Message
from parcours.model.structure import Cefsm
from parcours.run.trace import BESIDE, TraceEvent
from parcours.verdict.conformance.behaviour import Allowance
from parcours.verdict.conformance.channels import Channels
from parcours.verdict.conformance.findings import Expectation, TraceDeviation
from parcours.verdict.conformance.silence import Debts
from parcours.verdict.conformance.tracking import Observes, StateSet, Successor, Tracker, trackers
from parcours.verdict.contracts import ContractMonitor, Tally, View, Violation, contracts_of

Fields = View
"""Reads the model's fields from a payload: (channel, payload) -> field -> value; None if they cannot be seen."""

NOTHING = Allowance()
HIDDEN = 2000
"""Most states that are followed through steps nobody sees."""

LONGEST_PATH = 10_000
"""How many steps of the path to a deviation are kept."""


def no_fields(channel: str, payload: object) -> None:
    """Read nothing from a payload: messages are told apart by their channels alone."""


@dataclass(slots=True)
class _Instance:
    name: str
    tracker: Tracker
    node: StateSet
    path: deque[str] = field(default_factory=lambda: deque(maxlen=LONGEST_PATH))
    doubt: str = ""
    """Why it may stand elsewhere, too."""


class Checker:
    """Follows a running system. After the first deviation it stays there.

    A component whose name carries a number, as Planner#2, is an instance for one visit, which runs one machine, or
    for a whole case, which runs all; a component that the model does not name is the environment, and what happens on
    channels that it does not name is passed over.

    Args:
        cefsm: a model without errors.
        component: which components to follow; None is all that appear. Only those named are watched for silence before
            they first appear.
        observes: whether the trace reports transitions, or only the messages count.
        quiescence: channel -> how long [ns] a message that must come may take.
        allowance: what is let pass beside the model.
        hidden: most states that are followed through steps nobody sees; beyond it a deviation is in doubt.
        fields: reads what guards need from the payloads.
        data: reads what formulas need from the payloads; `fields` if not given.

    Raises:
        BadRequest: a name is unknown, or a timeout is not above 0.

    Attributes:
        components: the names of the model's components.
        deviation: the first one, once there was one.
        n_outside: events on channels that the model does not name.
    """

    def __init__(
        self,
        cefsm: Cefsm,
        *,
        component: str | Collection[str] | None = None,
        observes: Observes = "transitions",
        quiescence: Mapping[str, int] | None = None,
        allowance: Allowance = NOTHING,
        hidden: int = HIDDEN,
        fields: Fields = no_fields,
        data: Fields | None = None,
    ) -> None:
        require_known(observes, get_args(Observes), "observes", slug="unknown-observation")
        self._cefsm, self._observes, self._fields = cefsm, observes, fields
        self._debts = Debts(quiescence or {}, cefsm) if quiescence else None
        self.components = frozenset(each.name for each in cefsm.components)
        named = {component} if isinstance(component, str) else set(component or ())
        for name in sorted(named - self.components):
            rule = f"must be a component of {cefsm.name!r}, but is {name!r}"
            raise BadRequest("component", rule, one_of(name, sorted(self.components)), slug="unknown-part")
        self._trackers = trackers(cefsm, observes, allowance, hidden)
        self._followed = named or self.components
        self._instances: dict[str, _Instance | None] = {}
        self._channels = Channels(cefsm)
        self._monitor = ContractMonitor(contracts_of(cefsm), data or fields)
        self._time, self._position = 0, -1
        self.deviation: TraceDeviation | None = None
        self.n_outside = 0
        for name in sorted(named):
            self._instance(name)

    def observe(self, event: TraceEvent) -> TraceDeviation | None:
        """Take note of an event and return the first deviation so far.

        Args:
            event: the next one, times never decreasing.

        Raises:
            BadModel: a guard of the model has no value where the system stands.
        """
        if self.deviation is not None:
            return self.deviation
        self._position += 1
        if self._debts is not None and event.time > self._debts.deadline:  # this event came too late to help
            self._overdue(self._debts)
            return self.deviation
        before, self._time = self._time, event.time
        kind = event.kind
        if event.text == BESIDE and kind in ("send", "receive"):
            pass  # the model's transitions are not seen then
        elif kind == "take":
            if self._observes == "transitions" and (instance := self._instance(event.component)):
                self._take(instance, event)
        elif kind == "send":
            self._send(event)
        elif kind == "receive":
            self._receive(event)
        elif event.channel in self._channels:
            self._channels.note(kind, event.channel, event.message)
        elif kind == "deviation" and event.transition:
            self._silent(event, before)
        violation = self._monitor.observe(event)
        if violation is not None and self.deviation is None:
            self._violated(violation)
        return self.deviation

    @property
    def tally(self) -> Tally:
        """What was judged of data, and what could not be."""
        return self._monitor.tally

    def expected(self) -> tuple[Expectation, ...]:
        """Return what the components that appeared may do next; after a deviation, what was expected there."""
        if self.deviation is not None:
            return self.deviation.expected
        followed = [each for each in self._instances.values() if each is not None]
        return tuple(sorted({one for each in followed for one in each.tracker.expected(each.node)}, key=str))

    def quiet(self, until: int) -> TraceDeviation | None:
        """Take note that nothing else happened before the time `until` [ns]; return the first deviation so far."""
        if self.deviation is None and self._debts is not None and until > self._debts.deadline:
            self._position += 1
            self._overdue(self._debts)
        return self.deviation

    def owed(self) -> tuple[tuple[str, str], ...]:
        """Return (component, channel) of every message that must come, sorted."""
        return tuple(
            sorted((name, channel) for name, each in self._instances.items() if each for channel in _owed(each))
        )

    def _silent(self, event: TraceEvent, since: int) -> None:
        # A component had its turn, and did nothing until the tester's patience was over. It deviates where the model
        # does not let it be silent; if it has not even taken up the message of that turn, with this message.
        instance = self._instance(event.component)
        if instance is None or event.transition not in instance.tracker.behaviour.transitions:
            return
        tracker = instance.tracker
        instance.node = tracker.running(instance.node, event.transition)
        awaited = tracker.behaviour.transitions[event.transition].event
        if awaited is not None and tracker.take(instance.node, event.transition).node is None:
            contents = self._channels.waiting(awaited.channel)
            self._follow(instance, tracker.receive(instance.node, awaited.channel, contents))
        if owed := _owed(instance):
            waited = f"{(event.time - since) / 1e6:g} ms"
            self._deviates(
                instance, None, f"nothing came on {' and '.join(owed)} within {waited} of its turn, but must"
            )

    def _overdue(self, debts: Debts) -> None:
        due, name, channel = debts.first()
        rule = f"nothing came on {channel} within {debts.timeouts[channel] / 1e6:g} ms, but must"
        self._deviates(self._instance(name), None, rule, time=due)

    def finish(self, until: int | None = None) -> TraceDeviation | None:
        """Take note that the trace is over, at the time `until` [ns] if given; return the first deviation.

        What a transition taken last still had to send is missing then.
        """
        if until is not None:
            self.quiet(until)
        for instance in self._instances.values():
            if self.deviation is None and instance is not None and not instance.tracker.is_settled(instance.node):
                self._position += 1
                self._deviates(instance, None, "the trace ends before it has sent what it must")
        if self.deviation is None and (violation := self._monitor.finish()) is not None:
            self._violated(violation)
        return self.deviation

    def _violated(self, violation: Violation) -> None:
        event = violation.event
        self._deviates(self._instance(event.component), event, f"{violation.clause}: {violation.why}")

    def _instance(self, name: str) -> _Instance | None:
        # None for the environment, and for components that are not followed.
        try:
            return self._instances[name]
        except KeyError:
            base, mark, _ = name.partition("#")  # Planner#2 may be an instance of one machine
            made = None
            if base in self._followed:
                tracker = self._trackers.of(base, apart=bool(mark))
                made = _Instance(name, tracker, tracker.begin, doubt=tracker.begin.doubt)
            self._instances[name] = made
            if made is not None:
                self._note(made, seen="")
            return made

    def _take(self, instance: _Instance, event: TraceEvent) -> None:
        if not self._follow(instance, instance.tracker.take(instance.node, event.transition)):
            self._deviates(instance, event, instance.tracker.why_not_taken(instance.node, event.transition))
            return
        self._note(instance, seen=event.transition)

    def _send(self, event: TraceEvent) -> None:
        channel = event.channel
        if channel not in self._channels:
            self.n_outside += 1
            return
        instance = self._instance(event.component)
        contents: tuple[Message, ...] = ((),)
        observed = self._observed(event)
        if instance is not None:
            edge = instance.tracker.send(instance.node, channel, observed)
            contents = edge.contents
            if not self._follow(instance, edge):
                self._deviates(instance, event, instance.tracker.why_not_sent(instance.node, channel, observed))
                return
            self._note(instance, seen=f"!{channel}" if self._observes == "messages" else "", sent=channel)
        elif observed:
            contents = (observed,)
        if wrong := self._channels.send(channel, event.message, event.component, contents):
            self._deviates(instance, event, wrong)

    def _receive(self, event: TraceEvent) -> None:
        channel = event.channel
        if channel not in self._channels:
            self.n_outside += 1
            return
        instance = self._instance(event.component)
        contents, wrong = self._channels.receive(channel, event.message, event.component)
        base = event.component.partition("#")[0]
        if base in self.components and base != self._cefsm.channel(channel).receiver:
            wrong = f"{self._cefsm.channel(channel).receiver} receives {channel}, not {base}"
        if wrong:
            self._deviates(instance, event, wrong)
        elif instance is not None:
            if observed := self._observed(event):
                contents = (observed,)
            if not self._follow(instance, instance.tracker.receive(instance.node, channel, contents)):
                self._deviates(instance, event, f"it received {channel} before it had sent what it must")
                return
            self._note(instance, seen=f"?{channel}" if self._observes == "messages" else "")

    def _follow(self, instance: _Instance, edge: Successor) -> bool:
        if edge.doubt and not instance.doubt:
            instance.doubt = edge.doubt
        if edge.node is None:
            return False
        instance.node = edge.node
        return True

    def _observed(self, event: TraceEvent) -> Message:
        if self._fields is no_fields or event.payload is None:
            return ()
        fields = self._fields(event.channel, event.payload)
        if not fields:
            return ()
        owner = self._cefsm.channel(event.channel)
        name = next(each for each in (owner.sender, owner.receiver) if each in self.components)
        return self._trackers.of(name).behaviour.content(event.channel, dict(fields))

    def _note(self, instance: _Instance, *, seen: str, sent: str = "") -> None:
        if seen:
            instance.path.append(seen)
        if self._debts is not None:
            self._debts.note(instance.name, instance.tracker, instance.node, self._time, sent)

    def _deviates(
        self, instance: _Instance | None, event: TraceEvent | None, rule: str, time: int | None = None
    ) -> None:
        at = self._time if time is None else time
        if instance is None:
            name = event.component if event is not None else ""
            self.deviation = TraceDeviation(self._position, at, name, event, rule, (), ())
            return
        expected, path = instance.tracker.expected(instance.node), tuple(instance.path)
        self.deviation = TraceDeviation(self._position, at, instance.name, event, rule, expected, path, instance.doubt)


def _owed(instance: _Instance) -> list[str]:
    tracker = instance.tracker
    return [channel for channel in sorted(tracker.behaviour.sends) if tracker.owes(instance.node, channel)]
