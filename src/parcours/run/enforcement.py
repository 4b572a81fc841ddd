"""Executes a serialised abstract case on instances of components, in its order, up to the first deviation.

Each reference of the case runs in an instance of its own. A message between references is held in a gate from the
moment it is sent until the event that receives it has its turn. Every transition that an instance really takes, and the
channels it sends on, are compared with what the case demands; the first deviation ends the execution. Where the
instances are does not matter: in this process (`execute`), in others, or on ROS (`enforce`).
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Protocol

from parcours.abtc import Event
from parcours.errors import BadRequest
from parcours.run.clocks import ClockName, uninterrupted
from parcours.run.instance import TurnOutcome
from parcours.run.port import ENVIRONMENT, Send
from parcours.run.trace import BESIDE, SHOWN, Kind, Trace, TraceEvent

PATIENCE = 5_000_000_000
"""How long a turn may take on the real clock [ns] before it counts as not coming."""


@dataclass(frozen=True, slots=True)
class Turn:
    """A granted event, with the message that it takes up: its number (-1 for none) and payload."""

    event: Event
    message: int = -1
    payload: object = None


class Instances(Protocol):
    """Where a case's instances are, and how they learn whose turn it is."""

    @property
    def label(self) -> str:
        """The host's name in traces."""

    @property
    def clock(self) -> ClockName:
        """Which kind of time the outcomes are stamped with."""

    @property
    def ahead(self) -> bool:
        """Whether several turns of an instance may be granted at once."""

    def begin(self, case: str, events: Sequence[Event]) -> None:
        """Make a fresh instance for each reference, in the order of their first events; time begins at zero."""

    def sealed(self, channel: str, payload: object) -> object:
        """Return the payload in the form in which it travels."""

    def opened(self, channel: str, sealed: object) -> object:
        """Return the payload that travelled in that form."""

    def now(self) -> int:
        """The time [ns]."""

    def grant(self, turns: Sequence[Turn]) -> None:
        """Let an instance take these turns, all of one reference, one after the other."""

    def outcomes(self, patience: int) -> Sequence[tuple[int, TurnOutcome]]:
        """Return (reference, outcome) of turns that are over, in each one's order; nothing after `patience` [ns]."""

    def views(self) -> dict[int, tuple[str, object]]:
        """Return what instances show of themselves, as sealed payloads of a channel, by reference."""

    def end(self) -> None:
        """Forget the case."""


@dataclass(frozen=True, slots=True)
class Held:
    """A message still in its gate: its number, channel, and the position of the event that sent it."""

    message: int
    channel: str
    sent_by: int


@dataclass(frozen=True, slots=True)
class Deviation:
    """The first point at which an instance did something else than the case demands."""

    event: Event
    expected: str
    got: str
    path: tuple[str, ...]
    """The transitions that the instance had taken before."""
    held: tuple[Held, ...]

    def __str__(self) -> str:
        path = " ".join(self.path) or "its start"
        held = ", ".join(f"{one.channel} from event {one.sent_by}" for one in self.held) or "nothing"
        return (
            f"event {self.event.position}, {instance_name(self.event)}: expected {self.expected},"
            f" got {self.got}, after {path}; held back: {held}"
        )


@dataclass(frozen=True, slots=True)
class Execution:
    """What came of one case: the trace, the first deviation if there was one, and whether the order was kept.

    Attributes:
        disorder: which two events came in another order than the case demands; empty if none did.
    """

    trace: Trace
    deviation: Deviation | None
    disorder: str = ""

    @property
    def completed(self) -> bool:
        """Whether every transition was taken in its turn."""
        return self.deviation is None and not self.disorder


def instance_name(event: Event) -> str:
    """Return how the event's instance is called in a trace, e.g. Planner#2 for the third reference."""
    return f"{event.component}#{event.reference}"


def enforce(
    events: Sequence[Event],
    instances: Instances,
    supply: Callable[[Event], object],
    *,
    case: str = "",
    strict: bool = True,
    patience: int = PATIENCE,
) -> Execution:
    """Execute a serialised case on instances wherever they are.

    Args:
        events: `serialise(abstract_case)`.
        instances: of one host.
        supply: the message that the environment gives to a receiving event; called for all of them first, in order.
        case: id of the case.
        strict: keep the serialised order itself, one turn at a time over all instances; else any order that the case
            leaves open (`Event.after`, `Event.before`), instances at the same time.
        patience: how long a turn may take [ns].

    Raises:
        BadRequest: an event receives from an event that is not before it.
        HostFailure: the host cannot go on.
    """
    _check(events)
    with uninterrupted(instances.clock == "wall"):
        return _Enforcement(events, instances, supply, case, strict, patience).run()


def _check(events: Sequence[Event]) -> None:
    for event in events:
        source = event.receives.event if event.receives else None
        if source is not None and source >= event.position:
            rule = f"a message is received after its sending, but {event.position} receives from {source}"
            raise BadRequest("serialised case", rule, "use serialise()", slug="gate-order")


def disorder(events: Sequence[Event], trace: Trace) -> str:
    """Return the first pair of a case's events whose stamps are not in the order that the case demands, in words.

    Empty if there is none. Each event is the next transition that its instance took.
    """
    stamps: dict[str, deque[int]] = {}
    for one in trace.events:
        if one.kind == "take":
            stamps.setdefault(one.component, deque()).append(one.time)
    done = {event.position: stamps[instance_name(event)].popleft() for event in events}
    for event in events:
        pairs = [(one, event.position) for one in event.after]
        pairs += [(event.position, event.before)] if event.before is not None else []
        for first, second in pairs:
            late = done[first] - done[second]
            if late > 0:
                return f"event {first} must come before event {second}, but came {late} ns after it"
    return ""


class Precedence:
    """Which events of a case are allowed by what is done: `after` comes first, and what is `before` them, too."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._barriers: dict[int, list[int]] = {}
        for event in events:
            if event.before is not None:
                self._barriers.setdefault(event.before, []).append(event.position)

    def allows(self, event: Event, done: Set[int], ahead: Set[int] = frozenset()) -> bool:
        """Return whether an event is due, when those `ahead` will be done by its own instance before it."""
        barriers = self._barriers.get(event.position, ())
        return all(one in done or one in ahead for one in event.after) and all(one in done for one in barriers)


class _DeviationError(Exception):
    def __init__(self, event: Event, expected: str, got: str, *, silent: bool = False) -> None:
        self.event, self.expected, self.got, self.silent = event, expected, got, silent


# How an order is enforced on our own components, here (1: A sends m to B, 2: B, 3: A):
#
#     instance A            this loop            gate (1, m)            instance B
#        |<---- turn 1 --------|                      |                     |  waits
#        |-- took 1, sent m -->|------- hold -------->|                     |
#        |  waits              |<----- release -------|                     |
#        |                     |------ turn 2, with m --------------------->|
#        |                     |<----- took 2 ------------------------------|
#        |<---- turn 3 --------|
#
# Ours move only when they are granted a turn. Foreign nodes do not ask: there the gates alone keep them, and where no
# message does, their process is stopped.


class _Enforcement:
    def __init__(self, events: Sequence[Event], instances: Instances, supply: Callable[[Event], object], case: str,
                 strict: bool, patience: int) -> None:  # fmt: skip
        self._events, self._instances, self._case = events, instances, case
        self._strict, self._patience = strict, patience
        self._supply = supply
        self._to_do: dict[int, deque[Event]] = {}
        for event in events:
            self._to_do.setdefault(event.reference, deque()).append(event)
        self._granted: dict[int, deque[Turn]] = {reference: deque() for reference in self._to_do}
        self._paths: dict[int, list[str]] = {reference: [] for reference in self._to_do}
        self._done: set[int] = set()
        self._precedence = Precedence(events)
        self._gates: dict[tuple[int, str], deque[tuple[int, object]]] = {}
        self._trace: list[TraceEvent] = []
        self._payloads: dict[int, object] = {}
        self._sent = 0

    def run(self) -> Execution:
        deviation = None
        self._instances.begin(self._case, self._events)
        self._supplied = {
            event.position: self._instances.sealed(event.receives.channel, self._supply(event))
            for event in self._events
            if event.receives is not None and event.receives.event is None
        }
        try:
            while len(self._done) < len(self._events):
                self._grant()
                self._listen()
        except _DeviationError as found:
            path = tuple(self._paths[found.event.reference])
            deviation = Deviation(found.event, found.expected, found.got, path, self._held())
            missing = found.event.transition if found.silent else ""
            self._record("deviation", found.event, transition=missing, text=str(deviation))
        self._show(self._instances.views() if deviation is None else {})
        self._instances.end()
        events = sorted(map(self._opened, self._trace), key=lambda event: event.time)
        trace = Trace(self._instances.clock, tuple(events), f"{self._instances.label}, gated", self._case)
        return Execution(trace, deviation, "" if deviation else disorder(self._events, trace))

    def _grant(self) -> None:
        """Grant every instance that has nothing under way as many turns as it may take now."""
        for reference, to_do in self._to_do.items():
            if self._granted[reference]:
                continue
            turns: list[Turn] = []
            ahead: set[int] = set()
            while to_do and self._is_due(to_do[0], ahead) and (not turns or self._instances.ahead):
                event = to_do.popleft()
                turns.append(self._turn(event))
                ahead.add(event.position)
            if turns:
                self._granted[reference].extend(turns)
                self._instances.grant(turns)

    def _is_due(self, event: Event, ahead: set[int]) -> bool:
        if self._strict:
            return event.position == len(self._done) + len(ahead)
        return self._precedence.allows(event, self._done, ahead)

    def _turn(self, event: Event) -> Turn:
        """Open the gate of the message that the event receives."""
        if event.receives is None:
            return Turn(event)
        channel, source = event.receives.channel, event.receives.event
        if source is None:
            number, payload = self._number(), self._supplied[event.position]
            self._record("send", None, channel=channel, message=number, payload=payload)
        else:
            gate = self._gates.get((source, channel))
            if not gate:
                wanted = f"{event.transition} on receiving {channel}"
                raise _DeviationError(event, wanted, f"no message from event {source}")
            number, payload = gate.popleft()
            self._record("release", event, channel=channel, message=number, payload=payload)
        return Turn(event, number, payload)

    def _listen(self) -> None:
        outcomes = self._instances.outcomes(self._patience)
        if not outcomes:
            waiting = next(granted[0] for granted in self._granted.values() if granted)
            raise _DeviationError(
                waiting.event, waiting.event.transition, f"nothing within {self._patience * 1e-9:g} s", silent=True
            )
        for reference, outcome in outcomes:
            if not self._granted[reference]:
                continue  # after a turn that came out otherwise there is nothing to compare with
            self._judge(self._granted[reference].popleft(), outcome)

    def _judge(self, turn: Turn, outcome: TurnOutcome) -> None:
        event = turn.event
        for time, (channel, payload), sends in outcome.settled:
            number = self._number()
            self._record("send", None, time, channel=channel, message=number, text=BESIDE, payload=payload)
            self._record("receive", event, time, channel=channel, message=number, text=BESIDE, payload=payload)
            for sent, one in sends:
                self._record("send", event, time, channel=sent, message=self._number(), text=BESIDE, payload=one)
        self._aside(event, outcome.asides[: outcome.early])
        if outcome.received >= 0 and event.receives is not None:
            self._record("receive", event, outcome.received, channel=event.receives.channel, message=turn.message,
                         payload=turn.payload)  # fmt: skip
        self._aside(event, outcome.asides[outcome.early :])
        if outcome.manner == "unasked":
            assert event.receives is not None
            raise _DeviationError(event, f"{event.transition} on receiving {event.receives.channel}", "it unasked")
        if outcome.manner != "taken":
            is_silent = outcome.manner == "nothing"
            raise _DeviationError(event, event.transition, outcome.text or "no transition", silent=is_silent)
        if outcome.transition != event.transition:
            raise _DeviationError(event, event.transition, outcome.transition)
        self._record("take", event, outcome.time, transition=outcome.transition, payload=outcome.reported)
        self._emit(event, outcome)
        self._paths[event.reference].append(outcome.transition)
        self._done.add(event.position)

    def _aside(self, event: Event, asides: Sequence[tuple[int, Send]]) -> None:
        for time, (channel, payload) in asides:
            self._record("send", event, time, channel=channel, message=self._number(), payload=payload)

    def _emit(self, event: Event, outcome: TurnOutcome) -> None:
        """Put what was sent into its gate, or hand it to the tester; the channels must be those demanded."""
        bound = {emission.channel: emission for emission in event.sends}
        for channel, payload in outcome.sends:
            number = self._number()
            self._record("send", event, outcome.time, channel=channel, message=number, payload=payload)
            if channel in bound and bound[channel].to == "reference":
                self._gates.setdefault((event.position, channel), deque()).append((number, payload))
                self._record("hold", event, outcome.time, channel=channel, message=number, payload=payload)
            elif channel in bound:
                self._record("receive", None, outcome.time, channel=channel, message=number, payload=payload)
        demanded, given = Counter(e.channel for e in event.sends), Counter(c for c, _ in outcome.sends)
        if demanded != given:
            raise _DeviationError(
                event, f"{event.transition} to send {_listed(demanded)}", f"{event.transition} sending {_listed(given)}"
            )

    def _show(self, views: Mapping[int, tuple[str, object]]) -> None:
        last = {event.reference: event for event in self._events}
        for reference, (channel, payload) in views.items():
            time = self._trace[-1].time
            self._record("note", last[reference], time, channel=channel, text=SHOWN, payload=payload)

    def _opened(self, event: TraceEvent) -> TraceEvent:
        if not event.channel:
            return event
        if id(event.payload) not in self._payloads:
            self._payloads[id(event.payload)] = self._instances.opened(event.channel, event.payload)
        return replace(event, payload=self._payloads[id(event.payload)])

    def _number(self) -> int:
        self._sent += 1
        return self._sent - 1

    def _held(self) -> tuple[Held, ...]:
        return tuple(
            Held(number, channel, source) for (source, channel), gate in self._gates.items() for number, _ in gate
        )

    def _record(self, kind: Kind, event: Event | None, time: int | None = None, *, transition: str = "",
                channel: str = "", message: int = -1, text: str = "", payload: object = None) -> None:  # fmt: skip
        name = ENVIRONMENT if event is None else instance_name(event)
        stamp = self._instances.now() if time is None else time
        self._trace.append(TraceEvent(stamp, kind, name, transition, channel, message, text, payload))


def _listed(channels: Counter[str]) -> str:
    return ", ".join(sorted(channels.elements())) or "nothing"
