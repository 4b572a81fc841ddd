"""A serialised abstract case and real components -> a trace, enforced one transition at a time, in order.

Each reference of the case runs in an instance of its own. A message between references is held in a gate from
the moment it is sent until the event that receives it has its turn. Every transition that an instance really
takes, and the channels it sends on, are compared with what the case demands; the first deviation ends the
execution.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from parcours.abtc import Event
from parcours.errors import BadRequest
from parcours.run.clocks import Clock, SimulatedClock
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
    """What came of one case: the trace, and the first deviation if there was one."""

    trace: Trace
    deviation: Deviation | None
    instances: dict[int, Component] = field(repr=False)
    """The instances by reference, as the execution left them."""

    @property
    def completed(self) -> bool:
        """Whether every transition was taken in its turn."""
        return self.deviation is None


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
    clock: Clock | None = None,
    case: str = "",
) -> Execution:
    """Execute a serialised case and return its trace and first deviation.

    Args:
        events: `serialise(abstract_case)`.
        component: makes a fresh instance of the component with that name; called once a reference.
        supply: the message that the environment gives to a receiving event, from the test's data.
        prompt: starts a transition that no message starts. If what it starts yields none, and the instance
            wants to wake later, time moves on to that wake.
        prepare: called before every event with its instance, to set input variables.
        clock: simulated by default; with a WallClock durations are real.
        case: id of the case, for the trace.

    Raises:
        BadRequest: an event receives from an event that is not before it.
    """
    return _Gate(component, supply, prompt, prepare, clock or SimulatedClock(), case).run(events)


class _DeviationError(Exception):
    def __init__(self, expected: str, got: str) -> None:
        self.expected, self.got = expected, got


@dataclass(slots=True)
class _Instance:
    component: Component
    work: Iterator[Step] | None = None
    path: list[str] = field(default_factory=list)


class _Gate:
    def __init__(
        self,
        component: Callable[[str], Component],
        supply: Callable[[Event], object],
        prompt: Prompt,
        prepare: Callable[[Event, Component], None] | None,
        clock: Clock,
        case: str,
    ) -> None:
        self._make, self._supply, self._prompt, self._prepare = component, supply, prompt, prepare
        self._clock, self._case = clock, case
        self._instances: dict[int, _Instance] = {}
        self._gates: dict[tuple[int, str], deque[tuple[int, object]]] = {}
        self._events: list[TraceEvent] = []
        self._sent = 0

    def run(self, events: Sequence[Event]) -> Execution:
        self._clock.restart()
        deviation = None
        for event in events:
            if self._clock.name == "simulated":
                self._clock.advance(self._clock.now() + TICK)
            instance = self._instances.get(event.reference)
            if instance is None:
                instance = self._instances[event.reference] = _Instance(self._make(event.component))
            if self._prepare is not None:
                self._prepare(event, instance.component)
            try:
                self._turn(event, instance)
            except _DeviationError as found:
                self._record("deviation", event, text=f"expected {found.expected}, got {found.got}")
                path = tuple(instance.path)
                deviation = Deviation(event, found.expected, found.got, path, self._held())
                break
        trace = Trace(self._clock.name, tuple(self._events), "gated", self._case)
        return Execution(trace, deviation, {key: one.component for key, one in self._instances.items()})

    def _turn(self, event: Event, instance: _Instance) -> None:
        step = self._pull(event, instance)
        if event.receives is None:
            step = step or self._prompted(event, instance)
        elif step is None:
            step = self._delivered(event, instance)
        elif step.transition == event.transition:
            raise _DeviationError(f"{event.transition} on receiving {event.receives.channel}", "it unasked")
        if step is None:
            raise _DeviationError(event.transition, "no transition")
        if step.transition != event.transition:
            raise _DeviationError(event.transition, step.transition)
        self._record("take", event, transition=step.transition)
        self._emit(event, step)
        instance.path.append(step.transition)

    def _pull(self, event: Event, instance: _Instance) -> Step | None:
        """Return the next step of what the instance is doing; None if it has nothing more to do.

        Steps that the model does not name are passed over; what they send goes to the tester.
        """
        if instance.work is None:
            return None
        try:
            step = next(instance.work, None)
            while step is not None and step.transition == "":
                for channel, payload in step.sends:
                    self._record("send", event, channel=channel, message=self._number(), payload=payload)
                step = next(instance.work, None)
            if step is not None:
                Counter(channel for channel, _ in step.sends)  # what is no step is found here and blamed on it
                str.__len__(step.transition)
        except Exception as error:
            raise _DeviationError(event.transition, f"{type(error).__name__}: {error}") from error
        if step is None:
            instance.work = None
        return step

    def _start(self, event: Event, instance: _Instance, begin: Callable[[], Iterator[Step]]) -> Step | None:
        try:
            instance.work = iter(begin())
        except Exception as error:
            raise _DeviationError(event.transition, f"{type(error).__name__}: {error}") from error
        return self._pull(event, instance)

    def _prompted(self, event: Event, instance: _Instance) -> Step | None:
        part = instance.component
        step = self._start(event, instance, lambda: self._prompt(event, part, self._clock.now()))
        later = part.next_wake() if step is None else None
        if later is not None:
            now = self._clock.advance(later)
            step = self._start(event, instance, lambda: part.wake(now))
        return step

    def _delivered(self, event: Event, instance: _Instance) -> Step | None:
        assert event.receives is not None
        channel, source = event.receives.channel, event.receives.event
        if source is None:
            number, payload = self._number(), self._supply(event)
            self._record("send", None, channel=channel, message=number, payload=payload)
        else:
            if source >= event.position:
                rule = f"a message is received after its sending, but {event.position} receives from {source}"
                raise BadRequest("serialised case", rule, "use serialise()", slug="gate-order")
            gate = self._gates.get((source, channel))
            if not gate:
                raise _DeviationError(f"{event.transition} on receiving {channel}", f"no message from event {source}")
            number, payload = gate.popleft()
            self._record("release", event, channel=channel, message=number, payload=payload)
        self._record("receive", event, channel=channel, message=number, payload=payload)
        part, now = instance.component, self._clock.now()
        return self._start(event, instance, lambda: part.handle(channel, payload, now))

    def _emit(self, event: Event, step: Step) -> None:
        """Put what was sent into its gate, or hand it to the tester; the channels must be those demanded."""
        bound = {emission.channel: emission for emission in event.sends}
        for channel, payload in step.sends:
            number = self._number()
            self._record("send", event, channel=channel, message=number, payload=payload)
            if channel in bound and bound[channel].to == "reference":
                self._gates.setdefault((event.position, channel), deque()).append((number, payload))
                self._record("hold", event, channel=channel, message=number, payload=payload)
            elif channel in bound:
                self._record("receive", None, channel=channel, message=number, payload=payload)
        demanded, given = Counter(e.channel for e in event.sends), Counter(c for c, _ in step.sends)
        if demanded != given:
            raise _DeviationError(
                f"{event.transition} to send {_listed(demanded)}",
                f"{event.transition} sending {_listed(given)}",
            )

    def _number(self) -> int:
        self._sent += 1
        return self._sent - 1

    def _held(self) -> tuple[Held, ...]:
        return tuple(
            Held(number, channel, source) for (source, channel), gate in self._gates.items() for number, _ in gate
        )

    def _record(self, kind: Kind, event: Event | None, *, transition: str = "", channel: str = "",
                message: int = -1, text: str = "", payload: object = None) -> None:  # fmt: skip
        name = ENVIRONMENT if event is None else instance_name(event)
        self._events.append(TraceEvent(self._clock.now(), kind, name, transition, channel, message, text, payload))


def _listed(channels: Counter[str]) -> str:
    return ", ".join(sorted(channels.elements())) or "nothing"
