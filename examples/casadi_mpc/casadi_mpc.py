"""A planner by CasADi: predictive control of a unicycle by multiple shooting, solved by Ipopt once a period.

pip install casadi (LGPL 3; 93 MB, 280 MB unpacked), then: parcours run navigation --planner casadi_mpc.py:CasadiMpc
"""

from __future__ import annotations

import math

import casadi
import numpy as np

from parcours_navigation.protocol import Command, Observation, Task

STEPS, STEP = 12, 0.3  # the horizon: steps, and their length [s]
NEAREST = 5  # obstacles that are looked at
MARGIN = 0.04  # gap that is kept if it can be [m]
FAR = 100.0  # where obstacles are put that there are not [m]


class CasadiMpc:
    """Goes for the goal among obstacles that are taken to keep their speed and yaw rate."""

    def reset(self, task: Task) -> None:
        """State the problem once for a case, and forget the last plan."""
        limits = task.limits
        problem = casadi.Opti()
        states, speeds = problem.variable(3, STEPS + 1), problem.variable(2, STEPS)
        slack = problem.variable(1, STEPS)
        start, before = problem.parameter(3), problem.parameter(2)
        goal, places = problem.parameter(2), problem.parameter(2 * NEAREST, STEPS)
        reaches = problem.parameter(NEAREST)
        problem.subject_to(states[:, 0] == start)
        cost = 0
        for k in range(STEPS):
            v, w, heading = speeds[0, k], speeds[1, k], states[2, k] + 0.5 * STEP * speeds[1, k]
            moved = casadi.vertcat(v * casadi.cos(heading), v * casadi.sin(heading), w) * STEP
            problem.subject_to(states[:, k + 1] == states[:, k] + moved)
            change = speeds[:, k] - (before if k == 0 else speeds[:, k - 1])
            problem.subject_to(problem.bounded(-limits.acceleration * STEP, change[0], limits.acceleration * STEP))
            turn = limits.yaw_acceleration * STEP
            problem.subject_to(problem.bounded(-turn, change[1], turn))
            for i in range(NEAREST):
                away = states[:2, k + 1] - places[2 * i : 2 * i + 2, k]
                problem.subject_to(casadi.sumsqr(away) >= reaches[i] ** 2 - slack[k])
            cost += casadi.sqrt(casadi.sumsqr(states[:2, k + 1] - goal) + 0.01) / STEPS + 0.01 * w * w + 50.0 * slack[k]
        cost += 2.0 * casadi.sqrt(casadi.sumsqr(states[:2, STEPS] - goal) + 0.01)
        problem.subject_to(problem.bounded(0.0, speeds[0, :], limits.speed))
        problem.subject_to(problem.bounded(-limits.yaw_rate, speeds[1, :], limits.yaw_rate))
        problem.subject_to(slack >= 0.0)
        problem.minimize(cost)
        quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "error_on_fail": False}
        # Iterations, not seconds: a busy machine must not change an answer
        problem.solver("ipopt", {**quiet, "ipopt.max_iter": 40, "ipopt.tol": 1e-4})
        given = [start, before, goal, places, reaches, states, speeds, slack]
        self._solve = problem.to_function("solve", given, [states, speeds, slack])
        self._last: tuple[object, ...] | None = None

    def observe(self, observation: Observation) -> Command:
        """Return the first speeds of the plan; at the goal it stops."""
        task, robot = observation.task, observation.robot
        away = np.subtract(task.goal, robot[:2])
        if math.hypot(*away) < 0.5 * task.goal_tolerance:
            return Command(0.0, 0.0)
        places, reaches = self._obstacles(observation)
        if self._last is None:
            heading = robot[2] + np.remainder(math.atan2(away[1], away[0]) - robot[2] + math.pi, math.tau) - math.pi
            ahead = robot[:2, None] + np.outer(away, np.linspace(0.0, 0.5, STEPS + 1))
            self._last = np.vstack([ahead, np.full(STEPS + 1, heading)]), np.zeros((2, STEPS)), np.zeros((1, STEPS))
        self._last = self._solve(robot[:3], robot[3:], task.goal, places, reaches, *self._last)
        v, w = (float(each) for each in np.asarray(self._last[1])[:, 0])
        if not (math.isfinite(v) and math.isfinite(w)):
            self._last = None
            return Command(0.0, 0.0)
        return Command(v, w)

    def _obstacles(self, observation: Observation) -> tuple[np.ndarray, np.ndarray]:
        """Return where the nearest obstacles will be, (2 NEAREST, STEPS), and how far to keep from them (NEAREST,)."""
        robot, rows = observation.robot, observation.obstacles
        near = rows[np.argsort(np.hypot(*(rows[:, :2] - robot[:2]).T), kind="stable")[:NEAREST]]
        places, reaches = np.full((2 * NEAREST, STEPS), FAR), np.zeros(NEAREST)
        times = STEP * np.arange(1, STEPS + 1)
        for i, (x, y, heading, v, w, radius) in enumerate(near.tolist()):
            chord = v * np.sinc(0.5 * w * times / math.pi) * times
            places[2 * i] = x + chord * np.cos(heading + 0.5 * w * times)
            places[2 * i + 1] = y + chord * np.sin(heading + 0.5 * w * times)
            reaches[i] = radius + observation.task.robot_radius + MARGIN
        return places, reaches
