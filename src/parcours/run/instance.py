"""Lets one instance of a component take a transition when it is its turn.

The same rule holds in this process, in a process of its own and on ROS: work that is under way goes on first; if there
is none, the message that the turn awaits is taken up, or the instance is prompted; if a prompt moves nothing, time goes
on to its next wake.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

from parcours.run.clocks import Clock
from parcours.run.port import Component, Send, Step, StepReport, reported

Begin = Callable[[int], Iterator[Step]]
"""Starts work at a time [ns]: hands a message over, or prompts."""

Manner = Literal["taken", "unasked", "nothing", "raised"]
"""taken: a transition was taken. unasked: it was taken before the message it awaits. nothing: there was none.
raised: the component broke the port's contract."""


class HandedOver(NamedTuple):
    """A message that was handed over before a turn, beside the awaited one, and what the component sent upon it."""

    time: int
    message: Send
    sends: tuple[Send, ...] = ()


@dataclass(frozen=True, slots=True)
class TurnOutcome:
    """What came of a turn.

    Attributes:
        manner: whether a transition was taken, and how.
        time: when it was over [ns].
        transition: the transition taken.
        sends: what left with it.
        received: when the awaited message was taken up [ns]; -1 if none was.
        asides: what steps that the model does not name have sent before it, each with its time [ns].
        text: the error, if the component raised.
        reported: what the component says of its variables; None if nothing.
        settled: the messages that were handed over before the turn.
        early: how many of the asides were sent before the awaited message was taken up.
    """

    manner: Manner
    time: int
    transition: str = ""
    sends: tuple[Send, ...] = ()
    received: int = -1
    asides: tuple[tuple[int, Send], ...] = ()
    text: str = ""
    reported: StepReport | None = None
    settled: tuple[HandedOver, ...] = ()
    early: int = 0


class Instance:
    """A component and the work it has under way."""

    def __init__(self, component: Component) -> None:
        self.component = component
        self._work: Iterator[Step] | None = None
        self._asides: list[tuple[int, Send]] = []
        self._early = 0

    def turn(
        self, transition: str, clock: Clock, *, message: Begin | None = None, prompt: Begin | None = None
    ) -> TurnOutcome:
        """Take one transition.

        Args:
            transition: the one that is expected.
            clock: of the run.
            message: hands over the message that the turn awaits.
            prompt: moves the idle instance, if the turn awaits none; without it, only work under way goes on.
        """
        self._asides, self._early = [], 0
        received = -1
        try:
            step = self._pull(clock)
            self._early = len(self._asides)
            if step is not None and message is not None and step.transition == transition:
                return self._outcome("unasked", clock, step)
            if step is None and message is not None:
                received = clock.now()
                self._work = iter(message(received))
                step = self._pull(clock)
            elif step is None and prompt is not None:
                step = self._prompted(prompt, clock)
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            return TurnOutcome("raised", clock.now(), received=received, asides=tuple(self._asides), text=text)
        if step is None:
            return TurnOutcome("nothing", clock.now(), received=received, asides=tuple(self._asides))
        return self._outcome("taken", clock, step, received)

    def settle(self, begin: Begin, message: Send, clock: Clock) -> HandedOver:
        """Do at once what `begin` starts, the handing over of a message: it puts the instance where a case wants it.

        Work under way stays; transitions that are taken are passed over, what is sent with them is not.
        """
        now = clock.now()
        return HandedOver(now, message, tuple(send for step in begin(now) for send in step.sends))

    def close(self) -> None:
        """Let go of what the component holds, if it holds anything: a process, a thread."""
        self._work = None
        close = getattr(self.component, "close", None)
        if close is not None:
            close()

    def _outcome(self, manner: Manner, clock: Clock, step: Step, received: int = -1) -> TurnOutcome:
        return TurnOutcome(manner, clock.now(), step.transition, tuple(step.sends), received, tuple(self._asides),
                       reported=reported(step), early=self._early)  # fmt: skip

    def _prompted(self, prompt: Begin, clock: Clock) -> Step | None:
        self._work = iter(prompt(clock.now()))
        step = self._pull(clock)
        later = self.component.next_wake() if step is None else None
        if later is not None:
            self._work = iter(self.component.wake(clock.advance(later)))
            step = self._pull(clock)
        return step

    def _pull(self, clock: Clock) -> Step | None:
        """Return the next step of the work under way that the model names; None if there is none."""
        while self._work is not None:
            step = next(self._work, None)
            if step is None:
                self._work = None
                break
            Counter(channel for channel, _ in step.sends)  # what is no step is found here and blamed on it
            if str.__len__(step.transition) > 0:
                return step
            self._asides += ((clock.now(), send) for send in step.sends)
        return None
