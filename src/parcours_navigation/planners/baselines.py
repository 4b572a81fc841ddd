"""The plainest planners, by which others are measured: stand still, or drive straight."""

from __future__ import annotations

from parcours.elementary import PI, atan2, wrap
from parcours_navigation.protocol import HEADING, Command, Observation, Task, X, Y

_BLIND_GAIN = 4.0
"""Yaw rate commanded for each radian of heading error [1/s]."""


class StandStill:
    """Brakes and never moves again: what is reached or touched is not its doing."""

    def reset(self, task: Task) -> None:
        """Begin a case; there is nothing to remember."""

    def observe(self, observation: Observation) -> Command:
        """Return the command to stand."""
        return Command(0.0, 0.0)


class StraightAhead:
    """Drives at the goal at top speed, turning on the way, and sees no obstacle; stops on the goal."""

    def reset(self, task: Task) -> None:
        """Begin a case; there is nothing to remember."""

    def observe(self, observation: Observation) -> Command:
        """Return the command towards the goal, whatever is in between."""
        robot, task = observation.robot, observation.task
        to_x, to_y = task.goal[0] - float(robot[X]), task.goal[1] - float(robot[Y])
        if to_x * to_x + to_y * to_y < (0.5 * task.goal_tolerance) ** 2:
            return Command(0.0, 0.0)
        error = wrap(atan2(to_y, to_x) - float(robot[HEADING]))
        w = min(max(_BLIND_GAIN * error, -task.limits.yaw_rate), task.limits.yaw_rate)
        return Command(task.limits.speed * max(1.0 - 2.0 * abs(error) / PI, 0.0), w)
