"""A planner under check -> its answers, each looked at for form, and the speeds that an answer means now."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from parcours_navigation.guests import tracking
from parcours_navigation.protocol import HEADING, Observation, Task, Trajectory, X, Y

Speeds = tuple[float, float]
"""Forward speed [m/s] and yaw rate [rad/s]."""


class Malformed(Exception):
    """An answer is not of the form that the protocol asks for; its slug and what was seen."""

    def __init__(self, slug: str, seen: str) -> None:
        self.slug, self.seen = slug, seen
        super().__init__(seen)


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
        self.held: Speeds = (0.0, 0.0)
        self.followed: Trajectory | None = None

    def reset(self, task: Task) -> None:
        """Begin a case."""
        self.held, self.followed = (0.0, 0.0), None
        if self._reset is not None:
            self._reset(task)

    def answer(self, observation: Observation) -> object:
        """Return the planner's own answer, whatever it is."""
        return self._observe(observation)

    def speeds(self, observation: Observation) -> Speeds:
        """Ask, and return the speeds that the answer means at the time of the observation.

        Raises:
            Malformed: the answer is not of the protocol's form.
        """
        answer = self.answer(observation)
        require_form(answer)
        if isinstance(answer, Trajectory):
            self.followed = Trajectory(np.array(answer.points, dtype=np.float64))
        elif answer is not None:
            self.followed = None
            self.held = float(answer[0]), float(answer[1])  # type: ignore[index]
        if self.followed is not None:
            self.held = speeds_along(self.followed, observation)
        return self.held


def require_form(answer: object) -> None:
    """Raise Malformed unless the answer is a pair of finite numbers, a Trajectory in order, or None."""
    if answer is None:
        return
    if isinstance(answer, Trajectory):
        points = np.asarray(answer.points)
        if points.ndim != 2 or points.shape[1] != 4 or not len(points) or points.dtype.kind not in "fiu":
            raise Malformed(
                "answer-type", f"a Trajectory whose points have shape {points.shape} of {points.dtype}, not (n, 4)"
            )
        if not np.isfinite(points).all():
            raise Malformed("answer-finite", "a Trajectory with points that are not finite")
        if not (np.diff(points[:, 0]) > 0.0).all():
            raise Malformed("answer-type", "a Trajectory whose times do not increase")
        return
    if isinstance(answer, (str, bytes)) or not isinstance(answer, (Sequence, np.ndarray)) or len(answer) != 2:
        raise Malformed("answer-type", f"an answer of type {type(answer).__name__}: {_brief(answer)}")
    try:
        pair = [float(part) for part in answer]
    except (TypeError, ValueError):
        raise Malformed("answer-type", f"a pair that holds something other than numbers: {_brief(answer)}") from None
    if not all(map(math.isfinite, pair)):
        raise Malformed("answer-finite", f"the command (v, w) = ({pair[0]:g}, {pair[1]:g})")


def speeds_along(trajectory: Trajectory, observation: Observation) -> Speeds:
    """Return speeds that follow a trajectory from where the robot is, by the law that campaigns use.

    >>> from parcours_navigation.checking.scenes import observation, standard_task
    >>> ahead = Trajectory(np.array([[0.0, 0.0, 0.0, 0.0], [10.0, 2.0, 0.0, 0.0]]))
    >>> v, w = speeds_along(ahead, observation(standard_task(), (0.0, 0.0, 0.0)))
    >>> round(v, 6), round(w, 6)
    (0.2, 0.0)
    """
    x, y, heading = (float(observation.robot[k]) for k in (X, Y, HEADING))
    v, w = tracking.speeds(trajectory.points, observation.time, x, y, heading)
    return float(v), float(w)


def replayed(
    subject: Subject, task: Task, observations: Iterable[Observation], slot: Slot | None = None
) -> list[Speeds]:
    """Return the speeds that a planner answers to observations, one after the other, after a reset.

    Args:
        subject: what to ask.
        task: for the reset.
        observations: shown in this order.
        slot: a planner to go on with; a new one if None.
    """
    if slot is None:
        slot = subject.slot(task)
    else:
        slot.reset(task)
    return [slot.speeds(seen) for seen in observations]


def _brief(value: object) -> str:
    try:
        text = repr(value)
    except Exception:
        return "(no text)"
    return text if len(text) <= 60 else text[:57] + "..."
