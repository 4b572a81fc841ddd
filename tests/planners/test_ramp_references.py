"""Control and Planner against their second programs: sound runs pass, each planted fault is found."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from parcours.run.trace import Trace, TraceEvent
from parcours_ramp.components.control_reference import judge_control
from parcours_ramp.components.motion_reference import pose_of
from parcours_ramp.components.planner_reference import judge_planner
from parcours_ramp.planner.latency import none
from parcours_ramp.system.component_form import run_components, start_pose
from parcours_ramp.system.study import SystemStudy, system_study

SECONDS = 5.0


def study_of(schedule: str) -> SystemStudy:
    return dataclasses.replace(system_study(schedule, seed=3), latencies=none())


@functools.cache
def trace_of(schedule: str) -> Trace:
    return run_components(study_of(schedule), 0, SECONDS).trace


def wrong(trace: Trace, schedule: str) -> str:
    study = study_of(schedule)
    begin = pose_of(start_pose(study))
    goal = float(study.setting().goal_x), float(study.setting().goal_y)
    return judge_control(trace, study.parameters, timed=True) or judge_planner(trace, study.parameters, begin, goal)


@pytest.mark.parametrize("schedule", ["original", "guarded"])
def test_a_sound_run_passes(schedule: str) -> None:
    assert wrong(trace_of(schedule), schedule) == ""
    assert {"cmd_vel", "speed_limit" if schedule == "guarded" else "cmd_vel"} <= {
        event.channel for event in trace_of(schedule).events
    }


def changed(schedule: str, channel: str, change: Callable[[Any], Any], of: Callable[[Any], bool]) -> str:
    """Return what is said of a run in which one message that a component sends is another, or none."""
    events: list[TraceEvent] = []
    is_done = False
    for event in trace_of(schedule).events:
        if not is_done and event.kind == "send" and event.channel == channel and of(event.payload):
            is_done = True
            payload = change(event.payload)
            if payload is None:
                continue
            event = dataclasses.replace(event, payload=payload)
        events.append(event)
    assert is_done
    return wrong(dataclasses.replace(trace_of(schedule), events=tuple(events)), schedule)


def other_id(trajectory: Any) -> Any:
    other = trajectory.copy()
    other["id"] += 1000
    return other


def with_margin(request: Any) -> Any:
    begins, first, last, _, may_leave = request.window
    return request._replace(window=(begins, first, last, 0.0, may_leave))


FAULTS: dict[str, tuple[str, Callable[[Any], Any], Callable[[Any], bool], str]] = {
    "speeds are swapped": ("cmd_vel", lambda m: (m[1], m[0]), lambda m: abs(m[0] - m[1]) > 0.05, "it must command"),
    "straights at twice the speed": ("cmd_vel", lambda m: (2 * m[0], m[1]), lambda m: m[0] > 0.1, "it must command"),
    "the limit is not said": ("speed_limit", lambda m: None, lambda m: np.isfinite(m), "the robot may drive at"),
    "another limit is said": ("speed_limit", lambda m: 0.9 * m, lambda m: 0 < m < 1, "the robot may drive"),
    "the margin is zero": ("evaluation_request", with_margin, lambda m: m.window is not None, "margin, leave"),
    "the drift is left out": ("evaluation_request", lambda m: m._replace(drift=(0.0, 0.0)),
                              lambda m: np.hypot(*m.drift) > 1e-3, "beside its plan"),
    "the heading is old": ("evaluation_request", lambda m: m._replace(heading=9.0), lambda m: True, "heading"),
    "a halt is claimed": ("evaluation_request", lambda m: m._replace(halted=not m.halted), lambda m: True, "halted is"),
    "a prediction is lost": ("evaluation_request", lambda m: m._replace(predictions=m.predictions[1:]),
                             lambda m: len(m.predictions) > 1, "pass on the predictions"),
    "another member is followed": ("best_trajectory", other_id, lambda m: m["begins"] > 0, "is the fittest"),
    "the lag is forgotten": ("update", lambda m: m._replace(lag=m.lag + 10**7), lambda m: True, "have delayed it"),
    "a report is of another time": ("update", lambda m: m._replace(stamp=m.stamp - 33_333_333),
                                    lambda m: True, "report 1 is of 33.333 ms, but says 0.000 ms"),
    "members get each other's ways": ("evaluation_request", lambda m: m._replace(trajectories=_of_the_first(m)),
                                      lambda m: m.tag.cycle == "control" and m.window is None, "each its own"),
    "a candidate is entered elsewhere": ("trajectory_request", lambda m: m._replace(starts=_moved_all(m.starts),
                                         paths=_moved_paths(m.paths)), lambda m: m.tag.cycle == "planning"
                                         and m.obstacles is None and m.tag.serial > 8, "entered as the population"),
    "another pose is reported": ("update", lambda m: m._replace(pose=_moved(m.pose)),
                                 lambda m: True, "report the pose it was told"),
}  # fmt: skip


def _of_the_first(request: Any) -> Any:
    """Let every member but the first have the way of the second, under ids of their own."""
    ways = request.trajectories.copy()
    for k in range(2, len(ways)):
        ways[k], ways[k]["id"] = ways[1], request.trajectories[k]["id"]
    return ways


def _moved_all(starts: Any) -> Any:
    others = starts.copy()
    others["x"] += 0.3
    return others


def _moved_paths(paths: Any) -> Any:
    others = paths.copy()
    others["x"][:, 0] += 0.3
    return others


def _moved(pose: Any) -> Any:
    other = pose.copy()
    other["x"] += 0.01
    return other


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(fault: str) -> None:
    channel, change, of, said = FAULTS[fault]
    assert said in changed("guarded", channel, change, of)


def test_the_published_replay_is_held_to_its_points() -> None:
    assert "it must command" in changed("original", "cmd_vel", lambda m: (0.5 * m[0], m[1]), lambda m: m[0] > 0.1)
