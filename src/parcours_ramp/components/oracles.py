"""Expected results of Table VIII: the trace of an interaction of RAMP components -> pass or fail, and why."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from parcours.kernels import Record
from parcours.run.trace import SHOWN, Trace
from parcours.verdict.judgement import Judgement, Verdict
from parcours_ramp.planner import messages
from parcours_ramp.planner.trajectory import samples

Oracle = Callable[[Trace], Judgement]


def _sent(trace: Trace, channel: str) -> list[object]:
    """Return what the components sent on a channel."""
    return [e.payload for e in trace.events if e.kind == "send" and e.channel == channel and "#" in e.component]


def _judge(holds: bool, why: str) -> Judgement:
    return Judgement(Verdict.PASS if holds else Verdict.FAIL, why)


def trajectory_size(trace: Trace) -> Judgement:
    """ITP1: 10 <= size(trajectory) <= 500."""
    answers = [m for m in _sent(trace, "trajectory_response") if isinstance(m, messages.TrajectoryResponse)]
    sizes = [int(n) for answer in answers for n in answer.trajectories["n"]]
    holds = bool(sizes) and all(10 <= n <= 500 for n in sizes)
    return _judge(holds, f"sizes of the trajectories: {', '.join(map(str, sizes)) or 'none came'}; 10..500 expected")


def fitness_range(trace: Trace) -> Judgement:
    """ITP2: 0 < fitness <= 2."""
    answers = [m for m in _sent(trace, "evaluation_response") if isinstance(m, messages.EvaluationResponse)]
    values = np.concatenate([answer.fitness for answer in answers]) if answers else np.zeros(0)
    holds = values.size > 0 and bool(np.all((values > 0.0) & (values <= 2.0)))
    spread = f"{values.min():.4g} to {values.max():.4g}" if values.size else "none came"
    return _judge(holds, f"fitness of {values.size} trajectories: {spread}; above 0, at most 2 expected")


def path_is_modified(trace: Trace) -> Judgement:
    """ITP3: modified path != previous path; a knot drawn again may fall close to where it was."""
    asked: dict[str, messages.ModificationRequest] = {}  # by the instance that received it last
    moved: list[float] = []
    for event in trace.events:
        if event.kind == "receive" and isinstance(event.payload, messages.ModificationRequest):
            asked[event.component] = event.payload
        elif (
            event.kind == "send" and "#" in event.component and isinstance(event.payload, messages.ModificationResponse)
        ):
            before = asked[event.component].modification.first
            moved.append(max((_moved(before, after) for after in event.payload.paths), default=0.0))
    holds = bool(moved) and min(moved) > 0.0
    ways = " or ".join(f"{one:.3g} m" for one in moved)
    return _judge(holds, f"{len(moved)} answers; a knot moved by {ways or 'nothing'} (inf: another size)")


def _moved(before: Record, after: Record) -> float:
    """Return by how much a knot of a PATH moved at most [m]; inf if there are more or fewer."""
    if after.n != before.n:
        return float(np.inf)
    return float(np.hypot(after.x - before.x, after.y - before.y)[: before.n].max())


def state_is_sent(trace: Trace) -> Judgement:
    """ITP4: latest motion state != null."""
    states = [m for m in _sent(trace, "update") if isinstance(m, messages.StateReport)]
    holds = bool(states) and all(np.isfinite(list(state.pose)).all() for state in states)
    return _judge(holds, f"{len(states)} motion states were sent, all of finite numbers")


def _same_motion(one: Record, other: Record) -> bool:
    """Return whether two arrays of POSE, shape (n,), are of the same trajectory."""
    return len(one) == len(other) and all(np.array_equal(one[name], other[name]) for name in ("x", "y", "heading"))


def control_follows(trace: Trace) -> Judgement:
    """ITP5: control <- trajectory."""
    got: dict[str, Record] = {}  # by the instance that received it last
    following: set[str] = set()
    for event in trace.events:
        if event.channel != "best_trajectory" or "#" not in event.component:
            continue
        if event.kind == "receive":
            got[event.component] = event.payload
        elif event.kind == "note" and event.text == SHOWN and event.component in got:
            shown = event.payload
            follows = isinstance(shown, np.void) and shown["n"] > 0
            if follows and _same_motion(samples(shown), samples(got[event.component])):
                following.add(event.component)
    holds = bool(got) and following == got.keys()
    return _judge(holds, f"{len(got)} controls received best trajectories, {len(following)} follow the last one")


def state_changes(trace: Trace) -> Judgement:
    """ITP6: the latest motion state is changed."""
    states = [m.pose for m in _sent(trace, "update") if isinstance(m, messages.StateReport)]
    distance = max((float(np.hypot(s.x - states[0].x, s.y - states[0].y)) for s in states), default=0.0)
    return _judge(distance > 0.0, f"{len(states)} motion states, the last {distance:.3g} m from the first")


ORACLES: dict[str, Oracle] = {
    "ITP1": trajectory_size,
    "ITP2": fitness_range,
    "ITP3": path_is_modified,
    "ITP4": state_is_sent,
    "ITP5": control_follows,
    "ITP6": state_changes,
}  # The expected result of each interaction test path (Table VIII, functional evaluation)
