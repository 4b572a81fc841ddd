"""Gated execution in this process: the instances of a case, on a simulated or a real clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

from parcours.abtc import Event
from parcours.errors import ParcoursError
from parcours.run.clocks import Clock, ClockName, SimulatedClock
from parcours.run.enforcement import Execution, Turn, enforce
from parcours.run.instance import Begin, Instance, TurnOutcome
from parcours.run.port import Component, Send, Step

Prompt = Callable[[Event, Component, int], Iterator[Step]]
"""Moves an idle instance to a transition that no message starts: (event, instance, time [ns]) -> steps."""

View = Callable[[Component], tuple[str, object] | None]
"""Returns what an instance shows of itself, as a payload of some channel; None if nothing."""

TICK = 1_000_000
"""Simulated time between two events [ns]. A count of turns, no duration: simulated traces are never timed."""


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
    beside: Callable[[Event], Sequence[Send]] = lambda event: (),
    view: View = lambda component: None,
    clock: Clock | None = None,
    case: str = "",
    watch: Callable[[Event], AbstractContextManager[None]] = lambda event: nullcontext(),
    checked: Callable[[str, object], object] | None = None,
) -> Execution:
    """Execute a serialised case in this process and return its trace and first deviation.

    Args:
        events: `serialise(abstract_case)`.
        component: makes a fresh instance of the component with that name; called once a reference.
        supply: the message that the environment gives to a receiving event, from the test's data.
        prompt: starts a transition that no message starts. If what it starts yields none, and the instance
            wants to wake later, time moves on to that wake.
        prepare: called before every event with its instance, to set input variables.
        beside: the messages that its instance is handed then, beside the one that the event receives.
        view: what an instance shows of itself at the end, as a payload of some channel; by default nothing.
        clock: simulated by default; with a WallClock durations are real.
        case: id of the case, for the trace.
        watch: entered around every turn; it may end a component that hangs by raising there.
        checked: (channel, payload) -> the payload as it travels; what it raises is blamed on the sender.

    Raises:
        BadRequest: an event receives from an event that is not before it.
    """
    here = _Here(component, prompt, prepare, beside, view, clock or SimulatedClock(), watch, checked)
    return enforce(events, here, supply, case=case)


class _Here:
    """Instances in this process."""

    ahead = False

    def __init__(self, component: Callable[[str], Component], prompt: Prompt,
                 prepare: Callable[[Event, Component], None] | None, beside: Callable[[Event], Sequence[Send]],
                 view: View,
                 clock: Clock, watch: Callable[[Event], AbstractContextManager[None]],
                 checked: Callable[[str, object], object] | None) -> None:  # fmt: skip
        self._watch, self._checked = watch, checked
        self._make, self._prompt, self._prepare, self._clock = component, prompt, prepare, clock
        self._view, self._beside = view, beside
        self._instances: dict[int, Instance] = {}
        self._unmade: dict[int, Exception] = {}
        self._outcomes: list[tuple[int, TurnOutcome]] = []
        self.label: str = "here"
        self.clock: ClockName = clock.name

    def begin(self, case: str, events: Sequence[Event]) -> None:
        references = {event.reference: event.component for event in events}
        self._instances, self._unmade = {}, {}
        for reference, name in references.items():
            try:
                self._instances[reference] = Instance(self._make(name))
            except ParcoursError:
                raise
            except Exception as error:  # it is blamed in its first turn, as in a node
                self._unmade[reference] = error
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
        try:
            with self._watch(turn.event):
                outcome = self._turn(turn)
        except Exception as error:
            outcome = TurnOutcome("raised", self._clock.now(), text=f"{type(error).__name__}: {error}")
        self._outcomes.append((turn.event.reference, outcome))

    def _turn(self, turn: Turn) -> TurnOutcome:
        if turn.event.reference in self._unmade:
            raise self._unmade[turn.event.reference]
        event, part = turn.event, self._instances[turn.event.reference]
        if self._prepare is not None:
            self._prepare(event, part.component)
        settled = tuple(
            part.settle(self._handing(part.component, one), one, self._clock) for one in self._beside(event)
        )
        if event.receives is None:
            outcome = part.turn(event.transition, self._clock,
                                prompt=lambda now: self._prompt(event, part.component, now))  # fmt: skip
        else:
            channel = event.receives.channel
            outcome = part.turn(event.transition, self._clock,
                                message=lambda now: part.component.handle(channel, turn.payload, now))  # fmt: skip
        if self._checked is None:
            return replace(outcome, settled=settled) if settled else outcome
        return replace(
            outcome,
            sends=self._all_checked(outcome.sends),
            asides=tuple((at, self._all_checked([send])[0]) for at, send in outcome.asides),
            settled=tuple(one._replace(sends=self._all_checked(one.sends)) for one in settled),
        )

    def _all_checked(self, sends: Sequence[Send]) -> tuple[Send, ...]:
        assert self._checked is not None
        return tuple((channel, self._checked(channel, payload)) for channel, payload in sends)

    @staticmethod
    def _handing(component: Component, message: Send) -> Begin:
        return lambda now: component.handle(*message, now)

    def outcomes(self, patience: int) -> Sequence[tuple[int, TurnOutcome]]:
        over, self._outcomes = self._outcomes, []
        self._tick()
        return over

    def _tick(self) -> None:
        if self._clock.name == "simulated":
            self._clock.advance(self._clock.now() + TICK)

    def views(self) -> dict[int, tuple[str, object]]:
        shown = ((reference, self._view(one.component)) for reference, one in self._instances.items())
        return {reference: one for reference, one in shown if one is not None}

    def end(self) -> None:
        for part in self._instances.values():
            part.close()
        self._instances.clear()
