"""A serialised abstract case and instances of components -> a trace in its order, or the first deviation.

Each reference of the case runs in an instance of its own. A message between references is held in a gate from the
moment it is sent until the event that receives it has its turn. Every transition that an instance really takes, and the
channels it sends on, are compared with what the case demands; the first deviation ends the execution. Where the
instances are does not matter: in this process (`execute`), in others, or on ROS (`enforce`).
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from parcours.abtc import Event
from parcours.errors import BadRequest
from parcours.run.clocks import Clock, ClockName, SimulatedClock
from parcours.run.driving import PATIENCE, Instances, Turn
from parcours.run.instance import Instance, Outcome
from parcours.run.port import ENVIRONMENT, Component, Step
from parcours.run.trace import Kind, Trace, TraceEvent

Prompt = Callable[[Event, Component, int], Iterator[Step]]
"""Moves an idle instance to a transition that no message starts: (event, instance, time [ns]) -> steps."""

TICK = 1_000_000
"""Simulated time between two events [ns]. A count of turns, no duration: simulated traces are never timed."""


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
        views: what the instances showed of themselves at the end, by reference.
    """

    trace: Trace
    deviation: Deviation | None
    views: dict[int, object] = field(repr=False)
    disorder: str = ""

    @property
    def completed(self) -> bool:
        """Whether every transition was taken in its turn."""
        return self.deviation is None and not self.disorder


def instance_name(event: Event) -> str:
    """Return how the event's instance is called in a trace, e.g. Planner#2 for the third reference."""
    return f"{event.component}#{event.reference}"


def wake_or_poll(event: Event, component: Component, now: int) -> Iterator[Step]:
    """Wake the instance if its time has come, else poll it with nothing present."""
    due = component.next_wake()
    return component.wake(now) if due is not None and due <= now else component.handle(None, None, now)


def execute(
    events: Sequence[Event],
    component: Callable[[str], Component],
    supply: Callable[[Event], object],
    *,
    prompt: Prompt = wake_or_poll,
    prepare: Callable[[Event, Component], None] | None = None,
    view: Callable[[Component], object] = lambda component: component,
    clock: Clock | None = None,
    case: str = "",
) -> Execution:
    """Execute a serialised case in this process and return its trace and first deviation.

    Args:
        events: `serialise(abstract_case)`.
        component: makes a fresh instance of the component with that name; called once a reference.
        supply: the message that the environment gives to a receiving event, from the test's data.
        prompt: starts a transition that no message starts. If what it starts yields none, and the instance
            wants to wake later, time moves on to that wake.
        prepare: called before every event with its instance, to set input variables.
        view: what an instance shows of itself at the end; by default itself.
        clock: simulated by default; with a WallClock durations are real.
        case: id of the case, for the trace.

    Raises:
        BadRequest: an event receives from an event that is not before it.
    """
    return enforce(events, _Here(component, prompt, prepare, view, clock or SimulatedClock()), supply, case=case)


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
        patience: so long a turn may take [ns].

    Raises:
        BadRequest: an event receives from an event that is not before it.
        HostFailure: the host cannot go on.
    """
    _check(events)
    return _Enforcement(events, instances, supply, case, strict, patience).run()


def _check(events: Sequence[Event]) -> None:
    for event in events:
        source = event.receives.event if event.receives else None
        if source is not None and source >= event.position:
            rule = f"a message is received after its sending, but {event.position} receives from {source}"
            raise BadRequest("serialised case", rule, "use serialise()", slug="gate-order")


class _DeviationError(Exception):
    def __init__(self, event: Event, expected: str, got: str) -> None:
        self.event, self.expected, self.got = event, expected, got


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
        self._done: dict[int, int] = {}
        self._barriers: dict[int, list[int]] = {}
        for event in events:
            if event.before is not None:
                self._barriers.setdefault(event.before, []).append(event.position)
        self._gates: dict[tuple[int, str], deque[tuple[int, object]]] = {}
        self._trace: list[TraceEvent] = []
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
            self._record("deviation", found.event, text=f"expected {found.expected}, got {found.got}")
            path = tuple(self._paths[found.event.reference])
            deviation = Deviation(found.event, found.expected, found.got, path, self._held())
        views = self._instances.views() if deviation is None else {}
        self._instances.end()
        events = sorted(map(self._opened, self._trace), key=lambda event: event.time)
        trace = Trace(self._instances.clock, tuple(events), f"{self._instances.label}, gated", self._case)
        return Execution(trace, deviation, views, "" if deviation else self._disorder())

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
        return all(one in self._done or one in ahead for one in event.after) and all(
            one in self._done for one in self._barriers.get(event.position, ())
        )

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
                waiting.event, waiting.event.transition, f"nothing within {self._patience * 1e-9:g} s"
            )
        for reference, outcome in outcomes:
            if not self._granted[reference]:
                continue  # after a turn that came out otherwise there is nothing to compare with
            self._judge(self._granted[reference].popleft(), outcome)

    def _judge(self, turn: Turn, outcome: Outcome) -> None:
        event = turn.event
        for time, (channel, payload) in outcome.asides:
            self._record("send", event, time, channel=channel, message=self._number(), payload=payload)
        if outcome.received >= 0 and event.receives is not None:
            self._record("receive", event, outcome.received, channel=event.receives.channel, message=turn.message,
                         payload=turn.payload)  # fmt: skip
        if outcome.manner == "unasked":
            assert event.receives is not None
            raise _DeviationError(event, f"{event.transition} on receiving {event.receives.channel}", "it unasked")
        if outcome.manner != "taken":
            raise _DeviationError(event, event.transition, outcome.text or "no transition")
        if outcome.transition != event.transition:
            raise _DeviationError(event, event.transition, outcome.transition)
        self._record("take", event, outcome.time, transition=outcome.transition)
        self._emit(event, outcome)
        self._paths[event.reference].append(outcome.transition)
        self._done[event.position] = outcome.time

    def _emit(self, event: Event, outcome: Outcome) -> None:
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
                event,
                f"{event.transition} to send {_listed(demanded)}",
                f"{event.transition} sending {_listed(given)}",
            )

    def _disorder(self) -> str:
        """Return the first pair of events whose stamps are not in the order that the case demands."""
        for event in self._events:
            pairs = [(one, event.position) for one in event.after]
            pairs += [(event.position, event.before)] if event.before is not None else []
            for first, second in pairs:
                late = self._done[first] - self._done[second]
                if late > 0:
                    return f"event {first} must come before event {second}, but came {late} ns after it"
        return ""

    def _opened(self, event: TraceEvent) -> TraceEvent:
        if event.message < 0:
            return event
        return replace(event, payload=self._instances.opened(event.channel, event.payload))

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


class _Here:
    """Instances in this process."""

    ahead = False

    def __init__(self, component: Callable[[str], Component], prompt: Prompt,
                 prepare: Callable[[Event, Component], None] | None, view: Callable[[Component], object],
                 clock: Clock) -> None:  # fmt: skip
        self._make, self._prompt, self._prepare, self._clock = component, prompt, prepare, clock
        self._view = view
        self._instances: dict[int, Instance] = {}
        self._outcomes: list[tuple[int, Outcome]] = []
        self.label: str = "here"
        self.clock: ClockName = clock.name

    def begin(self, case: str, events: Sequence[Event]) -> None:
        references = {event.reference: event.component for event in events}
        self._instances = {reference: Instance(self._make(name)) for reference, name in references.items()}
        self._clock.restart()
        self._tick()

    def now(self) -> int:
        return self._clock.now()

    def sealed(self, channel: str, payload: object) -> object:
        return payload

    def opened(self, channel: str, sealed: object) -> object:
        return sealed

    def grant(self, turns: Sequence[Turn]) -> None:
        [turn] = turns
        event, part = turn.event, self._instances[turn.event.reference]
        if self._prepare is not None:
            self._prepare(event, part.component)
        if event.receives is None:
            outcome = part.turn(event.transition, self._clock,
                                prompt=lambda now: self._prompt(event, part.component, now))  # fmt: skip
        else:
            channel = event.receives.channel
            outcome = part.turn(event.transition, self._clock,
                                message=lambda now: part.component.handle(channel, turn.payload, now))  # fmt: skip
        self._outcomes.append((event.reference, outcome))

    def outcomes(self, patience: int) -> Sequence[tuple[int, Outcome]]:
        over, self._outcomes = self._outcomes, []
        self._tick()
        return over

    def _tick(self) -> None:
        if self._clock.name == "simulated":
            self._clock.advance(self._clock.now() + TICK)

    def views(self) -> dict[int, object]:
        return {reference: self._view(one.component) for reference, one in self._instances.items()}

    def end(self) -> None:
        self._instances.clear()


def _listed(channels: Counter[str]) -> str:
    return ", ".join(sorted(channels.elements())) or "nothing"
