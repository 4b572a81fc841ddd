"""Control once more, in plain Python: what a trace says it received -> what it must have commanded and reported.

Time is simulated, so every command is due at a known time: each 50 ms, at the time of its event in a system case, by
count in a component case, where the tester asks for commands when it likes and for the last one long after the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from parcours.run.trace import Trace, TraceEvent
from parcours_ramp.components.motion_reference import Pose, planned, pose_of, wrapped
from parcours_ramp.planner.parameters import Parameters

_PERIOD = 50_000_000  # [ns]
_REPORTS = 1e9 / 30.0  # [ns]
_SAMPLE = 0.1  # [s]
_V, _W = 2e-4, 4e-3  # how far commands may be off: corners are looked up in a table [m/s], [rad/s]


def judge_control(trace: Trace, parameters: Parameters, *, timed: bool) -> str:
    """Return the first thing that a Control of the trace did otherwise; empty if nothing.

    Args:
        timed: whether events have the times that the components live by, as in system cases.
    """
    found: dict[str, _Control] = {}
    for position, event in enumerate(trace.events):
        if event.component.partition("#")[0] != "Control":
            continue
        known = found.setdefault(event.component, _Control(parameters, timed))
        if wrong := known.wrong(event, trace.events, position):
            return f"event {position}, {event.channel} of {event.component}: {wrong}"
    return ""


class _Control:
    def __init__(self, parameters: Parameters, timed: bool) -> None:
        self.parameters, self.timed = parameters, timed
        self.original = parameters.schedule == "original"
        self.pose = Pose(0.0, 0.0, 0.0)
        self.trajectory: Any = None
        self.begins = self.lag = self.t_halt = 0
        self.halt = self.paused = self.at_once = False
        self.limit = math.inf
        self.n_commands = self.n_reports = 0

    def wrong(self, event: TraceEvent, events: Sequence[TraceEvent], position: int) -> str:
        if event.kind == "receive":
            self.take_up(event.channel, event.payload, event.time)
        elif event.kind == "send" and event.channel == "cmd_vel":
            return self.commanded(event, events, position)
        elif event.kind == "send" and event.channel == "update":
            return self.reported(event.payload, event.time)
        return ""

    def take_up(self, channel: str, payload: Any, now: int) -> None:
        if channel == "best_trajectory":
            self.trajectory = payload
            self.begins = now if self.original else int(payload["begins"]) + self.lag - int(payload["lag"])
        elif channel == "imminent_collision":
            if payload and not self.halt:
                self.t_halt = now
            self.halt = bool(payload)
            self.paused = self.paused or (self.halt and self.parameters.halts_at_once)
            self.at_once = self.paused
        elif channel == "speed_limit":
            self.limit = float(payload)
        elif channel == "pose":
            self.pose = pose_of(payload.pose)

    def reported(self, update: Any, now: int) -> str:
        self.n_reports += 1
        if self.timed and abs(now - self.n_reports * _REPORTS) > 1000:
            return f"report {self.n_reports} is due after {self.n_reports * _REPORTS * 1e-6:.3f} ms"
        due = now if self.timed else round(self.n_reports * _REPORTS)
        if abs(update.stamp - due) > 1000:
            return f"report {self.n_reports} is of {due * 1e-6:.3f} ms, but says {update.stamp * 1e-6:.3f} ms"
        if pose_of(update.pose) != self.pose:
            return f"it must report the pose it was told, {self.pose}, but reports {pose_of(update.pose)}"
        if abs(update.lag - self.lag) > 1000:
            return f"limits have delayed it by {self.lag} ns, but it reports {update.lag} ns"
        return ""

    def commanded(self, event: TraceEvent, events: Sequence[TraceEvent], position: int) -> str:
        given: Any = event.payload
        if self.at_once:
            self.at_once = False
            return "" if tuple(given) == (0.0, 0.0) else f"halted, it must stop at once, but commands {given}"
        now = event.time if self.timed else self.n_commands * _PERIOD
        if self.timed and now != self.n_commands * _PERIOD:
            return f"command {self.n_commands} is due at {self.n_commands * 50} ms, but came at {now * 1e-6:g} ms"
        self.n_commands += 1
        if not self.timed and self.trajectory is not None and _ends(events, position):
            now = max(now, self.begins + round((float(self.trajectory["duration"]) + 1.0) * 1e9))
        v, w = self.command(now)
        if math.isclose(given[0], v, abs_tol=_V) and math.isclose(given[1], w, abs_tol=_W, rel_tol=1e-3):
            return ""
        return f"{(now - self.begins) * 1e-9:.3f} s into its trajectory it must command {v:.6g} m/s, {w:.6g} rad/s, " \
               f"but commands {given[0]:.6g} m/s, {given[1]:.6g} rad/s"  # fmt: skip

    def command(self, now: int) -> tuple[float, float]:
        if self.trajectory is None:
            return 0.0, 0.0
        if not self.halt:
            self.paused = False
        elif not self.paused:
            point = int((self.t_halt - self.begins) * 1e-9 / _SAMPLE) + 1  # the next one of the trajectory
            self.paused = self.parameters.halts_at_once or (now - self.begins) * 1e-9 >= point * _SAMPLE - 1e-9
        if self.paused:
            self.begins += _PERIOD
            return 0.0, 0.0
        return self.replayed(now) if self.original else self.tracked(now)

    def replayed(self, now: int) -> tuple[float, float]:
        """Return the trajectory's own speeds at its next point; on a straight the heading is corrected."""
        i = int((now - self.begins) * 1e-9 / _SAMPLE + 1e-6)
        if i + 1 >= int(self.trajectory["n"]):
            return 0.0, 0.0
        here, there = planned(self.trajectory, i * _SAMPLE), planned(self.trajectory, (i + 1) * _SAMPLE)
        w = wrapped(there.heading - here.heading) / _SAMPLE
        return there.v, 0.5 * wrapped(here.heading - self.pose.heading) if abs(w) < 1e-4 else w

    def tracked(self, now: int) -> tuple[float, float]:
        """Return the speeds by which the robot converges to where it should be; the plan waits for what limits it."""
        elapsed = (now - self.begins) * 1e-9
        goal = planned(self.trajectory, elapsed)
        turn = wrapped(goal.heading - self.pose.heading)
        share = 0.0 if abs(turn) > 0.3 else min(1.0, self.limit / goal.v) if goal.v > 0.0 else 1.0
        late = int((1.0 - share) * _PERIOD)
        self.begins += late
        self.lag += late
        dx, dy = goal.x - self.pose.x, goal.y - self.pose.y
        ahead = dx * math.cos(self.pose.heading) + dy * math.sin(self.pose.heading)
        aside = dy * math.cos(self.pose.heading) - dx * math.sin(self.pose.heading)
        soon = planned(self.trajectory, elapsed + 0.025 * share)
        v, w = share * soon.v, share * soon.w
        forward = max(min(v * math.cos(turn) + 2.0 * ahead, self.limit), 0.0)
        if elapsed >= float(self.trajectory["duration"]) and abs(ahead) < 0.005:
            forward = 0.0
        slow = v < 0.01
        return forward, w + 3.0 * turn if slow else w + v * (64.0 * aside + 16.0 * math.sin(turn))


def _ends(events: Sequence[TraceEvent], position: int) -> bool:
    """Return whether the instance's next event is that all is executed, its last command being this one."""
    name = events[position].component
    following = next((one for one in events[position + 1 :] if one.component == name), None)
    return following is not None and following.kind == "take" and following.transition == "p46"
