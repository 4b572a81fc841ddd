"""Runs the nodes of a transport, and components of the tester's own, in real time, and relays every message.

The tester is in the middle of every channel: it records, and by a plan of faults it delays, drops, doubles, reorders
and corrupts. A sender never waits for room: what a receiver cannot keep up with is dropped there (topics) or queues up.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import cast

from parcours.errors import BadRequest, HostFailure
from parcours.run.clocks import WallClock, uninterrupted
from parcours.run.faults.corruption import corrupted_message
from parcours.run.faults.effects import ACTS, UNTOUCHED, Agenda, Effect, Effects, ProcessSignal, signals
from parcours.run.faults.plan import FaultPlan
from parcours.run.hosts.frames import Broke, Died, Dropped, Idle, Received, Report, RunFreely, TransitionTaken, Wire
from parcours.run.hosts.launching import bring_to_rest, ending
from parcours.run.hosts.node_program import Codec, Transport
from parcours.run.hosts.slots import Answer, Answering, injection_time, silence
from parcours.run.noise import Noise
from parcours.run.port import ENVIRONMENT, Component, Link, Step, StepReport, reported
from parcours.run.trace import Kind, Trace, TraceEvent

# One thread of the tester does everything; nodes are processes of their own:
#
#              commands, Deliver                     reports (Took, Received, Idle, Died, ...)
#   node A  ◄──────────────────── transport.poll ◄──────────────────── node B
#                                     │ _hear
#                                     ▼
#      _agenda (by time)   ◄─delayed─ _send ─► _hand_over ─► transport.deliver ─► node
#        injections, signals,           faults        └────► _inbox ─► local components, environment
#        late messages                                                   │ their sends
#                                       ▲────────────────────────────────┘
#
# The run is over when every node is Idle after the last message that was delivered to it, and nothing is due.

_ANSWER = 5_000_000_000
"""How long a node may take to come to rest [ns]."""

DIED = "died: "
"""How the note begins that says how a component ended."""


class EventLog:
    """The events of one live run, as nodes and tester report them; payloads are decoded when they are asked for."""

    def __init__(self, codec: Codec, listener: Callable[[TraceEvent], None] | None) -> None:
        self._codec, self._listener = codec, listener
        self._events: list[TraceEvent] = []
        self._payloads: dict[int, object] = {}

    def record(self, kind: Kind, when: int, *, component: str = "", wire: Wire | None = None, number: int = -1,
               transition: str = "", text: str = "", told: StepReport | None = None) -> None:  # fmt: skip
        """Write an event down; `when` is its time [ns], `number` that of the message in `wire`."""
        channel = wire.channel if wire else ""
        event = TraceEvent(when, kind, component, transition, channel, number, text, wire or told)
        self._events.append(event)
        if self._listener is not None:
            self._listener(self._opened(event))

    def events(self) -> tuple[TraceEvent, ...]:
        """Return the events in order of time, payloads opened."""
        return tuple(sorted(map(self._opened, self._events), key=lambda event: event.time))

    def _opened(self, event: TraceEvent) -> TraceEvent:
        if not isinstance(event.payload, Wire):
            return event
        return replace(event, payload=self._payload(event.payload))

    def _payload(self, wire: Wire) -> object:
        """Return what was sent; events of one message share it."""
        if id(wire) not in self._payloads:
            try:
                payload = self._codec.decode(wire.channel, wire.data)
            except BadRequest:
                payload = None  # corrupted on purpose: no message any more
            self._payloads[id(wire)] = payload
        return self._payloads[id(wire)]


class RealTimeHost:
    """Runs nodes freely, by their own timers.

    Args:
        transport: started; closed with the host.
        links: the channels.
        codec: of the payloads; with `flatten` and `restore`, so that messages can be corrupted field by field.
        case: what the nodes' programs are given; they make their components from it.
        local: components that live in the tester's own process.
        environment: the tester; gets what no component here receives.
        faults: what happens to messages and nodes.
        listener: called with each event as soon as it is known, payload included.

    Raises:
        HostFailure: two components share a name.
        BadRequest: the plan names an unknown channel or component.
    """

    def __init__(
        self,
        transport: Transport,
        links: Sequence[Link],
        codec: Codec,
        *,
        case: bytes = b"",
        local: Sequence[Component] = (),
        environment: Component | Answer = silence,
        faults: FaultPlan | None = None,
        listener: Callable[[TraceEvent], None] | None = None,
    ) -> None:
        tester = Answering(environment) if not hasattr(environment, "next_wake") else cast(Component, environment)
        self.label = transport.label
        self._transport, self._codec, self._case, self._listener = transport, codec, case, listener
        self._links = {link.channel: link for link in links}
        self._local = {part.name: part for part in (*local, tester)}
        self._tester = tester
        names = [*transport.nodes, *(part.name for part in (*local, tester))]
        if len(set(names)) != len(names):
            rule = f"component names differ, but given were: {', '.join(names)}"
            raise HostFailure(f"{self.label} host", rule, slug="host-names")
        self._plan = faults or FaultPlan(0)
        self._plan.check(list(self._links), list(transport.nodes))
        self._effects = Effects(self._plan)
        self._open = True
        self._clock = WallClock()
        self._clear()

    def _clear(self) -> None:
        self._event_log = EventLog(self._codec, self._listener)
        self._record = self._event_log.record
        self._begun = False
        self._until = 0
        self._sent = 0
        self._count: Counter[str] = Counter()
        self._delivered: Counter[str] = Counter()
        self._resting: dict[str, int] = {}
        self._wires: dict[int, Wire] = {}
        self._agenda = Agenda(self._now)
        self._inbox: deque[tuple[Component, int, Wire]] = deque()
        self.deaths: dict[str, str] = {}
        """Component -> how it ended, if it has."""

    def reset(self) -> None:
        """Return everything to where it began; nodes forget what they were doing.

        Raises HostFailure if the host is closed.
        """
        self._must_be_open()
        self.rest()
        self._clear()
        for part in self._local.values():
            part.reset()

    def close(self) -> None:
        """End the nodes. Closing again does nothing; the trace stays readable."""
        self._open = False
        self._transport.close()

    def trace(self, case: str = "", noise: Noise | None = None) -> Trace:
        """Return what has happened since the beginning or the last reset; payloads included."""
        return Trace("wall", self._event_log.events(), self.label, case, noise)

    def note(self, text: str) -> None:
        """Write a remark of the tester's into the trace."""
        self._record("note", self._now(), text=text)

    def inject(self, channel: str, message: object, at: int | None = None) -> None:
        """Send `message` in the place of the environment, or of a component that is nowhere here.

        Raises BadRequest if the channel is unknown, belongs to a component that is here, or the time is past.
        """
        self._must_be_open()
        here = {*self._local, *self._transport.nodes}
        due = injection_time(channel, self._links, here, at, self._now())
        data = self._codec.encode(channel, message)
        self._agenda.at(due, lambda: self._send(ENVIRONMENT, Wire(channel, data), self._now()))

    def run(self, until: int) -> None:
        """Run until the time `until` [ns], or until nothing is left that could happen.

        A node that dies does not end the run: it is noted, and stands in `deaths`. Raises HostFailure if a node was
        gone before the run began, a component sends on a channel that is not its own, or the host is closed.
        """
        self._must_be_open()
        if not self._begun:
            self._begin()
        self._until = until
        with uninterrupted():
            while (now := self._now()) < until:
                self._do_what_is_due()
                wake = self._next_wake()
                if wake is None and self._is_at_rest() and not self._transport.is_losing_one:
                    return
                target = until if wake is None else min(until, wake)
                for node, said in self._transport.poll(self._clock.zero + max(target, now)):
                    self._hear(node, said)

    def _must_be_open(self) -> None:
        if not self._open:
            raise HostFailure(f"{self.label} host", "is closed", "make a new one", slug="host-closed")

    def _now(self) -> int:
        return self._clock.now() if self._begun else 0

    def _begin(self) -> None:
        self.rest()
        if self.deaths:
            how = ", ".join(f"{node}: {how}" for node, how in self.deaths.items())
            rule = f"nodes must live as long as the host, but dead are {how}"
            raise HostFailure(f"{self.label} host", rule, "start the host again", slug="node-gone")
        self._clock.restart()
        self._begun = True
        for node in self._transport.nodes:
            self._transport.command(node, RunFreely(self._case, self._clock.zero))
            self._next_signal(signals(self._plan, node))

    def _next_signal(self, coming: Iterator[ProcessSignal]) -> None:
        one = next(coming, None)
        if one is not None:
            self._agenda.at(one.time, lambda: self._signal(one, coming))

    def _signal(self, one: ProcessSignal, coming: Iterator[ProcessSignal]) -> None:
        if one.component not in self.deaths:
            self._transport.signal(one.component, ACTS[one.act])
            self._record("note", self._now(), component=one.component, text=f"fault: {one.act}")
        self._next_signal(coming)

    def _next_wake(self) -> int | None:
        wakes = [wake for part in self._local.values() if (wake := part.next_wake()) is not None]
        if (due := self._agenda.next_due) is not None:
            wakes.append(due)
        return min(wakes, default=None)

    def _is_at_rest(self) -> bool:
        """Whether no node has anything to do: all have said so after the last message that was sent to them."""
        return not self._inbox and all(
            node in self.deaths or self._resting.get(node, -1) == self._delivered[node]
            for node in self._transport.nodes
        )

    def _do_what_is_due(self) -> None:
        self._agenda.do_what_is_due(self._empty_inbox)
        for part in self._local.values():
            wake = part.next_wake()
            if wake is not None and wake <= self._now():
                self._act(part, part.wake(self._now()))
                self._empty_inbox()

    def _hear(self, node: str, said: Report) -> None:
        match said:
            case TransitionTaken(when, transition, sends, variables, operations):
                if transition:
                    told = None if variables is None else StepReport(variables, operations)
                    self._record("take", when, component=node, transition=transition, told=told)
                for wire in sends:
                    self._send(node, wire, when)
            case Received(number, when):
                self._record("receive", when, component=node, wire=self._wires[number], number=number)
            case Dropped(number, when, why):
                self._record("drop", when, component=node, wire=self._wires[number], number=number, text=why)
            case Idle(taken):
                self._resting[node] = taken
            case Broke(when, text):
                self._bury(node, f"raised {text}", when)
            case Died(when, status):
                self._bury(node, ending(status), when - self._clock.zero)
        self._empty_inbox()

    def _bury(self, node: str, how: str, when: int) -> None:
        if node not in self.deaths:
            self.deaths[node] = how
            self._record("note", max(when, 0), component=node, text=DIED + how)

    # Messages: from their sender, by their effect, to their receiver.

    def _send(self, sender: str, wire: Wire, when: int) -> None:
        link = self._links.get(wire.channel)
        if link is None or sender not in (link.sender, ENVIRONMENT):
            rule = f"sends only on channels that are its own, but used {wire.channel!r}"
            own = ", ".join(channel for channel, other in self._links.items() if other.sender == sender)
            raise HostFailure(f"component {sender!r}", rule, f"its channels: {own}", slug="not-its-channel")
        number, k = self._sent, self._count[wire.channel]
        self._sent += 1
        self._count[wire.channel] += 1
        self._record("send", when, component=sender, wire=wire, number=number)
        effect = self._effects.effect(wire.channel, k, when)
        if not effect.copies:
            text = f"fault: {effect.why}"
            self._record("drop", self._now(), component=link.sender, wire=wire, number=number, text=text)
            return
        if effect is not UNTOUCHED:
            wire = self._struck(link, wire, number, effect)
        self._agenda.pass_on(wire.channel, effect, lambda: self._hand_over(link, wire, number))

    def _struck(self, link: Link, wire: Wire, number: int, effect: Effect) -> Wire:
        """Note what happens to a message, and return what is left of it."""
        now = self._now()
        self._record("note", now, component=link.sender, wire=wire, number=number,
                     text=f"fault: {wire.channel} {effect.why}")  # fmt: skip
        if effect.corrupt is not None:
            data, said = corrupted_message(self._codec, wire.channel, wire.data, effect.corrupt, effect.how)
            wire = Wire(wire.channel, data)
            self._record("note", now, component=link.sender, text=f"fault: {wire.channel} {said}")
        return wire

    def _hand_over(self, link: Link, wire: Wire, number: int) -> None:
        if link.receiver in self._transport.nodes:
            if link.receiver in self.deaths:
                self._record("drop", self._now(), component=link.receiver, wire=wire, number=number,
                             text="its receiver is dead")  # fmt: skip
                return
            self._wires[number] = wire
            self._delivered[link.receiver] += 1
            self._transport.deliver(wire.channel, number, wire.data)
        else:
            self._inbox.append((self._local.get(link.receiver, self._tester), number, wire))

    def _empty_inbox(self) -> None:
        """Let the tester's own components take up their messages; when its time is over a run ends even so."""
        while self._inbox and (now := self._now()) < self._until:
            part, number, wire = self._inbox.popleft()
            try:
                payload = self._codec.decode(wire.channel, wire.data)
            except BadRequest as error:
                self._record("drop", now, component=part.name, wire=wire, number=number, text=f"unreadable: {error}")
                continue
            self._record("receive", now, component=part.name, wire=wire, number=number)
            self._act(part, part.handle(wire.channel, payload, now))

    def _act(self, part: Component, steps: Iterator[Step]) -> None:
        for step in steps:
            now = self._now()
            if step.transition:
                self._record("take", now, component=part.name, transition=step.transition, told=reported(step))
            for channel, payload in step.sends:
                self._send(part.name, Wire(channel, self._codec.encode(channel, payload)), now)

    def rest(self) -> None:
        """Let the nodes forget what they were doing; the trace stays.

        A node that does not come to rest hangs: it is killed, and counts as dead.
        """
        died, hung = bring_to_rest(self._transport, set(self._transport.nodes) - set(self.deaths), _ANSWER)
        for node, said in died.items():
            self._hear(node, said)
        for node in hung:
            self._bury(node, f"hung: it did not come to rest within {_ANSWER * 1e-9:g} s", self._now())
