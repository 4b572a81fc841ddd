"""Checks how a planner conducts itself: in odd scenes, in time, on an open way, at the goal, before an obstacle."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np

from parcours.run.exception_text import is_ctrl_c
from parcours_navigation.checking.form import malformed, where_raised
from parcours_navigation.checking.remark import OutOfPatience, Remark, error, note, warning
from parcours_navigation.checking.scenes import PERIOD, crowd, observation
from parcours_navigation.checking.subject import AskedPlanner, Subject, drive
from parcours_navigation.guests.answers import BadAnswer
from parcours_navigation.protocol import Floats, Observation, Task

COUNTS = (1, 3, 10, 50)
"""Numbers of obstacles that decisions are timed with."""


def odd_scenes(task: Task) -> dict[str, list[Observation]]:
    """Return scenes that cases may hold, though few do: name -> four observations of each."""
    start = (0.3, 0.3, 0.785, 0.1, 0.0)
    rest = (0.3, 0.3, 0.785)
    scenes = {
        "no obstacle": (start, ()),
        "one obstacle": (start, crowd(1)),
        "50 obstacles": (start, crowd(50)),
        "an obstacle on top of the robot": (start, ((0.3, 0.3), *crowd(2))),
        "an obstacle touching the robot": (rest, ((0.3 + 0.225, 0.3),)),
        "an obstacle of which only the edge overlaps": (rest, ((0.4, 0.45, 0.0, 0.2),)),
        "start at the goal": ((*task.goal, 0.0), crowd(3)),
        "start at the goal, no obstacle": ((*task.goal, 0.0), ()),
        "an obstacle on the goal": (start, ((*task.goal,),)),
        "goal straight behind": ((0.3, 0.3, 0.785 - math.pi), crowd(3)),
        "far outside the arena": ((-3.0, 4.0, 1.0, 0.2, 0.0), crowd(3)),
        "driving backward": ((0.3, 0.3, 0.785, -0.2, 0.0), crowd(3)),
        "obstacles at the same place": (start, ((1.0, 1.0), (1.0, 1.0))),
    }
    return {
        name: [observation(task, robot, obstacles, k * task.period) for k in range(4)]
        for name, (robot, obstacles) in scenes.items()
    }


def survives_odd_scenes(subject: Subject) -> Iterator[Remark]:
    """No scene makes it raise or answer what is not finite."""
    task = subject.task()
    raised: dict[str, list[str]] = {}
    ill: dict[bool, tuple[BadAnswer, list[str]]] = {}
    for name, steps in odd_scenes(task).items():
        try:
            slot = subject.slot(task)
            for seen in steps:
                slot.speeds(seen)
        except BadAnswer as wrong:
            ill.setdefault(wrong.finite, (wrong, []))[1].append(name)
        except OutOfPatience:
            raise
        except BaseException as problem:  # also SystemExit
            if is_ctrl_c(problem):
                raise
            raised.setdefault(where_raised(problem), []).append(name)
    for what, names in raised.items():
        yield error(
            "scene-raises", f"{'; '.join(names)}: {what}", "handle these scenes: a case may start or pass there"
        )
    for fault, names in ill.values():
        yield malformed(fault, f"with {'; '.join(names)}")


def decides_in_time(subject: Subject) -> Iterator[Remark]:
    """A decision takes less than the period, also with many obstacles; wall time of this machine."""
    task = subject.task()
    times = {count: decision_times(subject.slot(task), task, count) for count in COUNTS}
    usual = times[3]
    median, p99, largest = (float(x) * 1e3 for x in (np.median(usual), np.quantile(usual, 0.99), usual.max()))
    growth = ", ".join(f"{1e3 * float(np.median(taken)):.3g} ms with {count}" for count, taken in times.items())
    seen = f"3 obstacles: median {median:.3g} ms, p99 {p99:.3g} ms, largest {largest:.3g} ms; medians: {growth}"
    remedy = f"a new observation comes every {1e3 * PERIOD:.0f} ms; on a robot the answer would be late"
    if median > 1e3 * PERIOD:
        yield error("too-slow", seen, remedy)
    elif p99 > 1e3 * PERIOD or float(np.median(times[50])) > PERIOD:
        yield warning("too-slow", seen, remedy)
    else:
        yield note("decision-time", seen)


def decision_times(slot: AskedPlanner, task: Task, count: int, n: int = 40, patience: float = 5.0) -> Floats:
    """Return the wall times of n decisions among `count` obstacles [s], fewer where patience [s] ends first.

    A first decision does not count: it may compile.
    """
    taken = []
    begun = time.perf_counter()
    for k in range(n + 1):
        robot = (0.1 + 0.02 * k * task.period, 0.1, 0.7, 0.2, 0.0)
        seen = observation(task, robot, crowd(count), k * task.period)
        before = time.perf_counter()
        slot.speeds(seen)
        after = time.perf_counter()
        taken.append(after - before)
        if after - begun > patience and k:
            break
    return np.array(taken[1:])


def reaches_a_free_goal(subject: Subject) -> Iterator[Remark]:
    """In an empty world it moves, reaches the goal, and stops there."""
    task = subject.task()
    drove = drive(subject, task, (0.0, 0.0, math.pi / 4.0), seconds=30.0, beyond_goal=3.0)
    way = math.hypot(*task.goal)
    if drove.travelled < 0.05:
        seen = f"{drove.travelled:.3f} m in 30 s of an empty world, {way:.1f} m from the goal"
        remedy = "command a speed above zero: does it wait for obstacles, or take the start for the goal?"
        yield error("never-moves", seen, remedy)
        return
    if math.isnan(drove.t_goal):
        gap = float(np.hypot(*(drove.states[:, :2] - task.goal).T).min())
        seen = f"a free goal was not reached in 30 s: {drove.travelled:.1f} m driven, nearest {gap:.2f} m"
        remedy = f"the straight way of {way:.1f} m takes {way / task.limits.speed:.0f} s at top speed"
        yield error("goal-missed", seen, remedy)
        return
    after = drove.states[drove.times > drove.t_goal + 2.0]
    speed = float(np.abs(after[:, 3]).max(initial=0.0))
    if speed >= 0.02:
        gone = float(np.hypot(*(after[:, :2] - task.goal).T).max())
        seen = f"2 s after the goal was reached it still drives at {speed:.2f} m/s, up to {gone:.2f} m from the goal"
        yield warning("drives-on", seen, "command (0, 0) within task.goal_tolerance of task.goal")
    slow = drove.t_goal / ((way - task.goal_tolerance) / task.limits.speed)
    if slow > 1.5:
        yield note("slow", f"the free goal took {drove.t_goal:.1f} s, {slow:.1f} times as long as at top speed")


def passes_a_standing_obstacle(subject: Subject) -> Iterator[Remark]:
    """It does not run into an obstacle that stands straight ahead, and gets past it."""
    task = subject.task()
    scenes = {"straight ahead": (1.0, 1.0), "a little to the left": (0.97, 1.05), "a little to the right": (1.05, 0.97)}
    held = []
    for where, place in scenes.items():
        drove = drive(subject, task, (0.0, 0.0, math.pi / 4.0), (place,), seconds=40.0)
        if drove.touched:
            remedy = (
                "rows of observation.obstacles are x, y, heading, speed, yaw rate, radius; centres must stay "
                "task.robot_radius + radius apart"
            )
            yield error("runs-into", f"it drove into an obstacle that stands {where}, 1.4 m from the start", remedy)
            return
        if math.isnan(drove.t_goal):
            held.append(where)
    if held:
        seen = f"one standing obstacle ({'; '.join(held)}) kept it from the goal for 40 s"
        remedy = "fine for a planner that only avoids; a case with obstacles on the way will end unreached"
        yield warning("held-up", seen, remedy)
