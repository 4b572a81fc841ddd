"""What a Planner knows by the messages that it received: for the reference that judges what it says.

It follows the conversations of an instance, and what waits behind them. Time is simulated.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from parcours.run.trace import TraceEvent
from parcours_ramp.components.guard_reference import speed_limit
from parcours_ramp.components.motion_reference import Pose, planned, pose_of
from parcours_ramp.planner.parameters import Parameters

NEVER = 9999.0  # the collision time of a trajectory that meets nobody [s]
_SEEN = "obstacles that the guard has seen"  # they wait behind a control cycle


class PlannerTold:
    """What one Planner has been told, and what that means for it: conversations, and what waits behind them."""

    def __init__(self, parameters: Parameters, begin: Pose | None, goal: tuple[float, float] | None) -> None:
        self.begin, self.goal = begin, goal
        self.dragged: bool | None = None  # whether the last commitment was moved onto the robot noticeably
        self.parameters, self.guarded = parameters, parameters.schedule == "guarded"
        self.latest, self.t_latest, self.lag = begin, 0, 0
        self.drift: tuple[float, float] | None = (0.0, 0.0)
        self.halted = self.rested = self.knows = self.hit = False
        self.limit = math.inf
        self.moving: Any = None  # the motion under way, as it was sent
        self.begins, self.t_control, self.t_next = 0, 0, -1
        # how the population is entered since the last control cycle, if it is known: from where, the kind, the anchor
        self.entered: tuple[Pose, int, Pose] | None = None
        self.n_commitments = 0
        self.nearest = (0.0, NEVER)  # direction [rad] and distance [m] of an obstacle
        self.cycle, self.serial, self.to_try, self.stage = "", 0, 0, 0
        self.waiting: deque[tuple[str, Any]] = deque()
        self.obstacles: Any = None  # the list that is looked at
        self.seen = self.was_halted = False  # whether the guard has seen it before; whether the robot was halted then
        self.predictions: list[Any] = []
        self.owes = False  # whether it has to ask for the way of another modified path now
        self.answered: Any = None
        self.paths: list[Any] = []
        self.members: dict[int, Any] = {}  # the population, as it was last sent: id -> trajectory
        self.fitness: dict[int, float] = {}
        self.stray = False  # whether paths were modified that it keeps
        self.joined: list[tuple[float, bool]] = []  # fitness of candidates since, and whether they are feasible

    def observe(self, event: TraceEvent) -> list[str]:
        """Take note of an event and return what is wrong with it."""
        if event.kind == "receive":
            return self.receive(event.channel, event.payload)
        if event.kind == "send":
            owes, self.owes = self.owes, False
            if owes and event.channel != "trajectory_request":
                return ["two paths were modified, but it asks no way for the second"]
            check = getattr(self, f"sends_{event.channel}", None)
            return [] if check is None else [one for one in check(event.payload, event.time) if one]
        if event.kind == "take":
            return self.take(event.transition, event.time)
        return []

    # What it takes up, one conversation after the other.

    def receive(self, channel: str, payload: Any) -> list[str]:
        """Take up a message, or let it wait; an answer counts in its own conversation only."""
        tag = getattr(payload, "tag", None)
        if tag is not None:
            return self.answer(channel, payload) if (tag.cycle, tag.serial) == (self.cycle, self.serial) else []
        self.waiting.append((channel, payload))
        return self.go_on()

    def go_on(self) -> list[str]:
        """Take up what waits, until a conversation is open."""
        while self.waiting and not self.cycle:
            channel, payload = self.waiting.popleft()
            if channel == "update":
                self.take_report(payload)
            elif channel in ("obstacles", _SEEN):
                self.cycle, self.serial, self.obstacles, self.seen = "sensing", 0, payload, channel == _SEEN
                self.was_halted = self.halted
        return []

    def take_report(self, report: Any) -> None:
        """Take note of where the robot is, and of how late."""
        more, self.lag = report.lag - self.lag, report.lag
        self.latest, self.t_latest = pose_of(report.pose), report.stamp
        if self.halted:
            self.t_next = -1  # it may hasten the next control cycle
        elif more:
            self.begins += more
            self.t_next += more if self.t_next >= 0 else 0

    def answer(self, channel: str, payload: Any) -> list[str]:
        """Take up the answer of a service."""
        if channel == "modification_response":
            self.stray = True  # what others made of a path may lead anywhere
            self.paths, self.to_try = [payload.paths[k] for k in range(len(payload.paths))], len(payload.paths)
        elif channel == "trajectory_response":
            self.answered = payload.trajectories
            if self.cycle == "sensing":
                self.predictions.append(payload.trajectories[0])
        else:
            self.evaluated(payload)
        if self.cycle == "planning" and channel != "trajectory_response" and not self.to_try:
            self.cycle = ""
        return self.go_on()

    def evaluated(self, payload: Any) -> None:
        """Take up an evaluation."""
        if self.cycle == "planning":
            self.to_try -= 1
            self.owes = self.to_try > 0
            self.joined.append((float(payload.fitness[0]), bool(payload.feasible[0])))
        elif self.stage == 1:  # of the motion under way
            self.hit = bool(payload.t_collision[0] < NEVER)
            self.stage = 2
        else:
            self.fitness = dict(zip(self.members, map(float, payload.fitness), strict=False))
            self.joined = []
            if self.cycle == "control":
                self.cycle = ""

    def take(self, transition: str, now: int) -> list[str]:
        """Take note of a transition and return what is wrong."""
        wrong = []
        if transition in ("p11", "p12", "p15"):
            self.answered = None
        if transition == "p15":
            wrong = self.guards()
            self.predictions = []
        elif transition == "p17" or transition == "p12":
            self.stage = 0
            if transition == "p17":
                self.note_nearest()
        elif transition == "p19":
            self.cycle = ""
            self.go_on()
        if transition == "p12" and self.cycle == "sensing":  # due before these obstacles came
            wrong = self.guards()
            self.waiting.appendleft((_SEEN, self.obstacles))
        if transition == "p11" and not self.halted:
            self.compensate()
        return wrong

    def guards(self) -> list[str]:
        """Judge the limit that obstacles demand, and find the drift with which they are looked at."""
        if not self.guarded or self.obstacles is None or self.seen:
            return []
        wanted = self.limit
        if self.latest is not None:
            wanted = speed_limit(self.latest, self.obstacles.states, self.parameters)
        if not math.isclose(wanted, self.limit, rel_tol=1e-9, abs_tol=1e-9):
            return [
                f"beside these obstacles the robot may drive at {wanted:.6g} m/s, but was told {self.limit:.6g} m/s"
            ]
        if not self.was_halted:
            self.knows = True
            self.compensate()
        return []

    def compensate(self) -> None:
        """Find by how much the robot is beside its plan."""
        if self.moving is not None and self.t_latest < self.begins:
            return
        if self.latest is None or self.moving is None:
            self.drift = None  # it is not known
            return
        if not self.guarded and abs(self.latest.w) > 0.1 and abs(self.latest.v) > 0.01:
            return
        there = planned(self.moving, (self.t_latest - self.begins) * 1e-9)
        self.drift = self.latest.x - there.x, self.latest.y - there.y

    def note_nearest(self) -> None:
        """Find the nearest obstacle."""
        if self.latest is None or self.obstacles is None:
            return
        places = [pose_of(state["pose"]) for state in self.obstacles.states]
        ways = [(one.x - self.latest.x, one.y - self.latest.y) for one in places]
        if ways:
            x, y = min(ways, key=lambda way: math.hypot(*way))
            self.nearest = math.atan2(y, x), math.hypot(x, y)
        self.knows = bool(ways)
