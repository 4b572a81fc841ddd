"""A planner under check: asked in small situations, its answers read as campaigns read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from parcours_navigation.guests import tracking
from parcours_navigation.guests.answers import read_answer
from parcours_navigation.protocol import HEADING, Floats, Observation, Task, X, Y

Speeds = tuple[float, float]
"""Forward speed [m/s] and yaw rate [rad/s]."""


@dataclass(frozen=True, slots=True)
class Subject:
    """The planner that is checked.

    Attributes:
        name: under which another process finds it, "module:attribute" or a registry name; "" if none can.
        make: returns a new planner: an object with `reset` and `observe`, or a function of an observation.
    """

    name: str
    make: Callable[[], object]

    def slot(self, task: Task) -> Slot:
        """Return a new planner, reset to the task."""
        slot = Slot(self.make())
        slot.reset(task)
        return slot


class Slot:
    """One planner that is asked: remembers the speeds of its last answer, which `None` leaves as they are."""

    def __init__(self, planner: object) -> None:
        observe = getattr(planner, "observe", None)
        self._reset: Callable[[Task], object] | None = getattr(planner, "reset", None)
        self._observe: Callable[[Observation], object] = observe if callable(observe) else planner  # type: ignore[assignment]
        self._held: Speeds = (0.0, 0.0)
        self._followed: Floats | None = None

    def reset(self, task: Task) -> None:
        """Begin a case."""
        self._held, self._followed = (0.0, 0.0), None
        if self._reset is not None:
            self._reset(task)

    def answer(self, observation: Observation) -> object:
        """Return the planner's own answer, whatever it is."""
        return self._observe(observation)

    def speeds(self, observation: Observation) -> Speeds:
        """Ask, and return the speeds that the answer means now; a trajectory is followed by the law of campaigns.

        Raises:
            BadAnswer: the answer is not of the protocol's form.
        """
        answer = self.answer(observation)
        if answer is not None:
            v, w, self._followed = read_answer(answer)
            self._held = v, w
        if self._followed is not None:
            x, y, heading = (float(observation.robot[k]) for k in (X, Y, HEADING))
            self._held = tracking.speeds(self._followed, observation.time, x, y, heading)
        return self._held


def replayed(
    subject: Subject, task: Task, observations: Iterable[Observation], slot: Slot | None = None
) -> list[Speeds]:
    """Return the speeds that a planner answers to observations, one after the other, after a reset to the task.

    With a slot, that planner is asked again instead of a new one.
    """
    if slot is None:
        slot = subject.slot(task)
    else:
        slot.reset(task)
    return [slot.speeds(seen) for seen in observations]
