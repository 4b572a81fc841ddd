"""MPPI: an observation into the first speeds of a plan that random futures keep improving.

Williams, Wagener, Goldfain, Drews, Rehg, Boots, Theodorou, Information theoretic MPC for model-based reinforcement
learning, ICRA 2017, algorithm 2.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.streams import start
from parcours_navigation.planners.motion import extrapolate, require_count, require_number, runs_into, to_goal
from parcours_navigation.planners.mppi.futures import average, draw_pool, sample, score, shift_plan
from parcours_navigation.protocol import Command, Observation, Task

_PURPOSE = np.uint64(7)
_POOL = 8192
_WORD = (1 << 64) - 1
_HALT_STEP = 0.1


class Mppi:
    """Model predictive path integral control, among obstacles that are taken to keep their speed and yaw rate.

    Args:
        n_samples: number of futures drawn for each command.
        n_steps: length of a future in steps.
        step: length of a step; robot and obstacles are taken to move straight for this long [s].
        temperature: futures dearer than the cheapest by this count 1/e [cost].
        speed_spread: standard deviation of the speed's disturbance [m/s].
        yaw_rate_spread: standard deviation of the yaw rate's disturbance [rad/s].
        smooth: correlation of a disturbance with the one a step before.
        fresh: share of the futures that do not start from the last plan.
        collision: cost of running into an obstacle at the end of a future, twice that if at once [cost]. An obstacle
            that runs into the robot costs up to half of it.
        progress: cost of each metre left to the goal at the end of a future [cost/m].
        heading: cost of looking a right angle away from the goal then [cost].
        gap: cost of touching; less linearly down to none at `comfort` [cost].
        control: weight of the plan times its disturbance over the variance, summed over a future [cost].
        comfort: gaps above this cost nothing [m].
        margin: the robot's radius is enlarged by this [m].
        halt_time: brake if it would run into an obstacle within this time [s]; 0: never.
        halt_margin: ... or come this near to it [m].

    Raises:
        BadRequest: a parameter is no number or out of its range.
    """

    def __init__(
        self,
        *,
        n_samples: int = 64,
        n_steps: int = 15,
        step: float = 0.2,
        temperature: float = 0.01,
        speed_spread: float = 0.2,
        yaw_rate_spread: float = 0.6,
        smooth: float = 0.8,
        fresh: float = 0.2,
        collision: float = 3.0,
        progress: float = 1.0,
        heading: float = 0.2,
        gap: float = 0.25,
        control: float = 1e-4,
        comfort: float = 0.1,
        margin: float = 0.02,
        halt_time: float = 0.5,
        halt_margin: float = 0.01,
    ) -> None:
        n_samples = require_count("mppi", "n_samples", n_samples, 4, 100_000)
        n_steps = require_count("mppi", "n_steps", n_steps, 1, 1000)
        self._step = require_number("mppi", "step", step, 0.01, 1.0, "s")
        self._temperature = require_number("mppi", "temperature", temperature, 1e-9, 1e6, "")
        self._spread = np.array(
            [
                require_number("mppi", "speed_spread", speed_spread, 1e-6, 100.0, "m/s"),
                require_number("mppi", "yaw_rate_spread", yaw_rate_spread, 1e-6, 100.0, "rad/s"),
                require_number("mppi", "smooth", smooth, 0.0, 1.0, ""),
            ]
        )
        self._fresh = require_number("mppi", "fresh", fresh, 0.0, 0.9, "")
        named = {"collision": collision, "progress": progress, "heading": heading, "gap": gap, "control": control}
        self._weights = np.array([require_number("mppi", name, value, 0.0, 1e6, "") for name, value in named.items()])
        self._comfort = require_number("mppi", "comfort", comfort, 0.001, 10.0, "m")
        self._margin = require_number("mppi", "margin", margin, 0.0, 10.0, "m")
        self._halt_time = require_number("mppi", "halt_time", halt_time, 0.0, 10.0, "s")
        self._halt_margin = require_number("mppi", "halt_margin", halt_margin, 0.0, 10.0, "m")
        self._stream = np.zeros(1, np.uint64)
        self._pool = np.empty(_POOL)
        self._plan = np.zeros((n_steps, 2))
        self._samples = np.empty((n_samples, n_steps, 2))
        self._costs = np.empty(n_samples)
        self._places = np.empty((n_steps + 1, 0, 2))
        self._reaches = np.empty(0)
        self._limits = np.zeros(4)
        self._last = math.nan

    def reset(self, task: Task) -> None:
        """Begin a case: draw its random numbers from its seed, and plan to stand."""
        limits = task.limits
        self._limits = np.array([limits.speed, limits.yaw_rate, limits.acceleration, limits.yaw_acceleration])
        start(self._stream, np.uint64(task.seed & _WORD), np.uint64(0), _PURPOSE)
        draw_pool(self._stream, self._pool)
        self._plan[:] = 0.0
        self._last = math.nan

    def observe(self, observation: Observation) -> Command:
        """Return the first speeds of the improved plan; at the goal it stops."""
        task, robot, obstacles = observation.task, observation.robot, observation.obstacles
        elapsed = observation.time - self._last
        self._last = observation.time
        _, _, _, speed = to_goal(observation)
        if speed == 0.0:
            return Command(0.0, 0.0)
        if elapsed > 0.0:
            shift_plan(self._plan, elapsed / self._step)
        if len(obstacles) > len(self._reaches):
            self._places = np.empty((len(self._plan) + 1, len(obstacles), 2))
            self._reaches = np.empty(len(obstacles))
        radius, top = task.robot_radius + self._margin, task.limits.speed
        n = extrapolate(robot, obstacles, top, radius, self._comfort, self._step, self._places, self._reaches)
        sample(self._plan, top, self._spread, self._fresh, self._stream, self._pool, self._samples, self._costs)
        score(
            robot,
            task.goal[0],
            task.goal[1],
            self._limits,
            self._places,
            self._reaches,
            n,
            self._step,
            self._weights,
            self._comfort,
            self._samples,
            self._costs,
        )
        average(self._samples, self._costs, self._temperature, self._plan)
        v, w = min(float(self._plan[0, 0]), speed), float(self._plan[0, 1])
        radius = task.robot_radius + self._halt_margin
        if self._halt_time > 0.0 and runs_into(robot, v, w, obstacles, radius, self._halt_time, _HALT_STEP)[1] >= 0:
            v = 0.0
        return Command(v, w)
