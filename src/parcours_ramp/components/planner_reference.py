"""Planner once more, in plain Python, as far as its messages show it: what it was told -> what it must say.

It follows the conversations of each instance, and what waits behind them. Time is simulated. What only the planner
knows (paths of its members, what it draws by lot) is learned from what it says first, and must stay.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from parcours.run.trace import Trace
from parcours_ramp.components.guard_reference import meets
from parcours_ramp.components.motion_reference import SAMPLE, Pose, planned, pose_of
from parcours_ramp.components.planner_knowledge import PlannerTold
from parcours_ramp.planner.messages import MAX_KNOTS
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.path_modification import OPERATORS
from parcours_ramp.planner.route import HYBRID, TRANSITION

_NEAR = 1e-5  # corners are looked up in a table [m]


def judge_planner(
    trace: Trace, parameters: Parameters, begin: Pose | None = None, goal: tuple[float, float] | None = None
) -> str:
    """Return the first thing that a Planner of the trace did otherwise; empty if nothing.

    Args:
        begin: where the robot is before the first report, if that is known.
        goal: where it is to go [m], if that is known.
    """
    found: dict[str, _Planner] = {}
    for position, event in enumerate(trace.events):
        if event.component.partition("#")[0] != "Planner":
            continue
        known = found.setdefault(event.component, _Planner(parameters, begin, goal))
        for wrong in known.observe(event):
            return f"event {position}, {event.channel or event.transition} of {event.component}: {wrong}"
    return ""


class _Planner(PlannerTold):
    """What one Planner says, against what it was told."""

    # What it says.

    def opens(self, payload: Any, cycle: str) -> str:
        if payload.tag.cycle != cycle:
            return f"this belongs to its {cycle} cycle, but says {payload.tag.cycle}"
        if self.serial and payload.tag.serial < self.serial:
            return f"conversations are counted, but {payload.tag.serial} follows {self.serial}"
        self.cycle, self.serial = cycle, payload.tag.serial
        return ""

    def sends_speed_limit(self, limit: Any, now: int) -> list[str]:
        again = limit == self.limit
        self.limit = float(limit)
        return ["it says a limit again that holds already"] if again else []

    def sends_imminent_collision(self, imminent: Any, now: int) -> list[str]:
        was, self.halted = self.halted, bool(imminent)
        self.t_next = -1  # a report that waits may hasten the next control cycle
        if not self.guarded:
            return []
        if was == self.halted:
            return [f"imminent collision is {was} already"]
        stays = self.hit or not self.rested
        return ["it ends a halt in which the robot has not rested, or still meets somebody"] if was and stays else []

    def sends_modification_request(self, payload: Any, now: int) -> list[str]:
        wrong = self.opens(payload, "planning")
        asked = payload.modification
        direction, distance = float(asked["direction"]), float(asked["distance"])
        towards, away = self.nearest
        dx = distance * math.cos(direction) - away * math.cos(towards)
        dy = distance * math.sin(direction) - away * math.sin(towards)
        if self.latest is not None and not _same(dx, dy):
            wrong = wrong or f"the nearest obstacle is {away:.6g} m away towards {towards:.6g} rad"
        wrong = wrong or self.leads(asked["first"])
        moves = OPERATORS[int(asked["operator"])] == "move"
        if self.halted and self.knows and not moves:
            wrong = wrong or "halted, it must ask for `move`"
        if moves and not self.knows:
            wrong = wrong or "without obstacles it may not ask for `move`"
        return [wrong]

    def sends_best_trajectory(self, best: Any, now: int) -> list[str]:
        wrong = []
        id, fittest = int(best["id"]), max(self.fitness, key=self.fitness.__getitem__, default=0)
        if self.fitness and len(self.fitness) == len(self.members):
            better = [fitness for fitness, _ in self.joined if fitness > self.fitness[fittest]]
            is_new = id not in self.members and float(best["fitness"]) in better
            if id != fittest and not is_new and list(self.fitness.values()).count(self.fitness[fittest]) == 1:
                wrong.append(f"trajectory {fittest} is the fittest, but it is to follow {id}")
        member = self.members.get(id)
        if member is not None and not self.joined:
            wrong += self.committed(best, member, now)
        if int(best["lag"]) != self.lag:
            wrong.append(f"the robot is {self.lag} ns late, but it allows for {int(best['lag'])} ns")
        if int(best["begins"]) > now or ((not self.guarded or self.halted) and int(best["begins"]) != now):
            wrong.append(f"it begins at {int(best['begins'])} ns, but now is {now} ns")
        self.dragged = None if self.drift is None else max(map(abs, self.drift)) > 0.01
        self.moving, self.begins, self.t_control, self.drift = best, int(best["begins"]), now, (0.0, 0.0)
        self.t_next = -1
        self.n_commitments += 1
        self.cycle, self.serial, self.stage = "control", 0, 0
        return wrong

    def committed(self, best: Any, member: Any, now: int) -> list[str]:
        begins = int(member["begins"])
        if self.t_next >= 0:
            begins = self.t_next
        if not self.guarded or self.halted or begins > now:
            begins = now
        wrong = []
        if self.t_next >= 0 and int(best["begins"]) != begins:
            wrong.append(f"it must begin at {begins} ns, but begins at {int(best['begins'])} ns")
        if self.drift is not None:
            for seconds in (0.0, 0.5 * float(member["duration"])):
                one, other = planned(member, seconds), planned(best, seconds)
                if not _same(one.x + self.drift[0] - other.x, one.y + self.drift[1] - other.y):
                    wrong.append(f"it must be moved by {self.drift[0]:.6g}, {self.drift[1]:.6g} m onto the robot")
        return wrong

    def sends_trajectory_request(self, payload: Any, now: int) -> list[str]:
        if payload.obstacles is not None:
            wrong = self.opens(payload, "sensing")
            k = len(self.predictions)
            wanted, given = self.obstacles, payload.obstacles
            if wanted is not None and (given.stamp != wanted.stamp or len(given.states) != 1
                                       or given.states[0].tobytes() != wanted.states[k].tobytes()):  # fmt: skip
                wrong = wrong or f"obstacle {k} of the list must be predicted now"
            return [wrong]
        wrong = self.opens(payload, self.cycle)
        starts = [pose_of(start) for start in payload.starts]
        kinds = [int(kind) for kind in payload.kinds]
        if any(start != starts[0] for start in starts):
            return ["its ways must begin in one state"]
        for k, path in enumerate(payload.paths):
            if not _same(float(path["x"][0]) - starts[k].x, float(path["y"][0]) - starts[k].y):
                wrong = wrong or f"way {k} must begin where it starts"
            wrong = wrong or self.leads(path)
        if self.cycle == "planning" and self.entered is not None:
            wrong = wrong or self.entered_as(payload.paths[0], starts[0], kinds[0])
        if self.cycle == "planning" and self.to_try:
            wrong = wrong or _as_modified(payload.paths[0], kinds[0], self.paths[len(self.paths) - self.to_try])
        if self.cycle == "control":
            wrong = wrong or self.adapted(payload, starts[0], kinds, now)
        return [wrong]

    def adapted(self, payload: Any, start: Pose, kinds: list[int], now: int) -> str:
        """Judge where the population is to begin: at rest where the robot stands, or on the motion under way."""
        if self.halted:
            if self.latest is None:
                return ""
            self.rested = True
            period = self.parameters.halted_period if self.guarded else self.parameters.control_period
            self.t_next = now + round(period * 1e9)
            at_rest = abs(self.latest.v) < 0.01 and abs(self.latest.w) < 0.01
            right = start == self.latest._replace(v=0.0, w=0.0) and set(kinds) == {HYBRID} and at_rest
            self.entered = start, HYBRID, start
            return "" if right else f"halted, its ways must begin at rest where the robot stands, not at {start}"
        self.rested = False
        latest, first = self.latest_switch(), self.first_switch()
        ats = [k for k in range(first, latest + 1) if _agrees(planned(self.moving, k * SAMPLE), start)]
        if not ats:
            return (
                f"its ways must begin on the motion under way, 0.1 s apart until {latest * SAMPLE:g} s, not at {start}"
            )
        early = [k for k in ats if k != latest]
        if TRANSITION in kinds or latest not in ats:
            self.t_next = self.begins + early[0] * 100_000_000 if len(early) == 1 else -1
        else:
            self.t_next = self.begins + latest * 100_000_000 if not early else -1
        if len(kinds) > 1 and (not early if TRANSITION in kinds else latest not in ats):
            return "its ways are switches if, and only if, it leaves the motion under way before it must"
        if self.dragged and len(kinds) < self.parameters.population:
            return "the motion under way was moved onto the robot, so that all members need new ways"
        at, moving = (self.t_next - self.begins) // 100_000_000, self.moving
        goes_on = float(moving["rest_length"]) == 0.0 or float(moving["curve_end"]) > at * SAMPLE + 1e-6
        goes_on = goes_on and self.t_next >= 0 and self.dragged is False and at < int(moving["n"])
        if goes_on and len(kinds) != self.parameters.population - 1:
            return "the member that is followed goes on, so that all others need new ways"
        anchor = planned(self.moving, latest * SAMPLE)
        is_known = TRANSITION in kinds or len(kinds) > 1  # the member that is followed needs no switch
        self.entered = (start, max(kinds), anchor) if is_known else None
        return next((wrong for one in zip(payload.paths, kinds, strict=True) if (wrong := _leads_by(*one, anchor))), "")

    def entered_as(self, path: Any, start: Pose, kind: int) -> str:
        """Judge how a candidate is entered: as the population, since the last control cycle."""
        assert self.entered is not None
        wanted, wanted_kind, anchor = self.entered
        if kind != wanted_kind or not _agrees(start, wanted):
            return f"a candidate must be entered as the population is, from {wanted} by kind {wanted_kind}"
        return _leads_by(path, kind, anchor)

    def leads(self, path: Any) -> str:
        """Judge where a path leads: by the arena to the goal; one path of the first ones leads straight ahead."""
        n, begin = int(path["n"]), self.begin
        points = [(float(path["x"][k]), float(path["y"][k])) for k in range(n)]
        if self.goal is not None and points[-1] != self.goal:
            return f"its paths must lead to the goal, {self.goal}, but one leads to {points[-1]}"
        if not self.stray and begin is not None:
            ahead = begin.x + math.cos(begin.heading), begin.y + math.sin(begin.heading)
            for x, y in points[2 if n > 2 and self.cycle != "planning" else 1 : -1]:
                inside = 0.0 <= x <= self.parameters.arena and 0.0 <= y <= self.parameters.arena
                if not inside and not _same(x - ahead[0], y - ahead[1]):
                    return f"its paths must stay in the arena, but one leads by {x:.6g}, {y:.6g} m"
        return ""

    def first_switch(self) -> int:
        return int((self.t_control - self.begins) * 1e-9 / SAMPLE + 0.999) + 2

    def latest_switch(self) -> int:
        longest = int(self.parameters.control_period / SAMPLE + 0.5)
        if not self.guarded:
            return longest
        most = self.parameters.alpha_max * SAMPLE
        slow = (
            k for k in range(longest, self.first_switch() - 1, -1) if abs(planned(self.moving, k * SAMPLE).w) <= most
        )
        return next(slow, longest)

    def sends_evaluation_request(self, payload: Any, now: int) -> list[str]:
        wrong = [self.opens(payload, self.cycle)]
        if bool(payload.halted) != self.halted:
            wrong.append(f"halted is {payload.halted}, but the last it told Control is {self.halted}")
        if self.latest is not None and payload.heading != self.latest.heading:
            wrong.append(f"the robot's heading is {self.latest.heading}, but it says {payload.heading}")
        if self.drift is not None and not _same(payload.drift[0] - self.drift[0], payload.drift[1] - self.drift[1]):
            wrong.append(f"the robot is {self.drift} m beside its plan, but it says {payload.drift}")
        wrong.append(self.passed_on(payload.predictions))
        if payload.window is not None:
            return [*wrong, *self.looks(payload, now)]
        if self.cycle == "planning":
            return [
                *wrong,
                self.carried(payload.trajectories[0], self.answered[0] if self.answered is not None else None),
            ]
        return [*wrong, *self.populated(payload.trajectories)]

    def passed_on(self, predictions: Any) -> str:
        """Judge predictions; the last answer may have come unseen, in the place of a prompt."""
        wanted = len(self.obstacles.states) if self.obstacles is not None else 0
        pairs = zip(self.predictions, predictions, strict=False)
        if len(predictions) != wanted or any(one.tobytes() != other.tobytes() for one, other in pairs):
            return "it must pass on the predictions that it was given"
        self.predictions = list(predictions)
        return ""

    def carried(self, given: Any, answered: Any) -> str:
        if answered is not None and any(given[name] != answered[name] for name in ("n", "duration", "first_heading")):
            return "it must pass on the trajectory that it was given"
        if self.t_next >= 0 and int(given["begins"]) != self.t_next:
            return f"it would begin at {self.t_next} ns, but says {int(given['begins'])} ns"
        return ""

    def populated(self, trajectories: Any) -> list[str]:
        ids = [int(one["id"]) for one in trajectories]
        wrong = []
        most = self.parameters.population
        if len(set(ids)) != len(ids) or len(ids) != most:
            wrong.append(f"the population has {most} members, each with an id of its own, but these are {ids}")
        if self.fitness and len(self.fitness) == len(self.members):
            best = max(self.fitness, key=self.fitness.__getitem__)
            new = [id for id in ids if id not in self.members]
            if len(new) > len(self.joined):
                wrong.append(f"{new} are new, but only {len(self.joined)} candidates were looked at")
            if best not in ids and not any(fitness > self.fitness[best] for fitness, _ in self.joined):
                wrong.append(f"the fittest, {best}, may not be replaced")
        is_first = self.n_commitments == 1  # later ones depend on which members have been dragged since
        if self.cycle == "control" and self.answered is not None and self.stage == 2 and is_first:
            wrong += self.renewed(trajectories)
        late = [int(one["begins"]) for one in trajectories if self.t_next >= 0 and int(one["begins"]) != self.t_next]
        if late:
            wrong.append(
                f"all must begin at the next control cycle, at {self.t_next} ns, but {late[0]} ns is among them"
            )
        self.members = dict(zip(ids, trajectories.copy(), strict=True))
        self.fitness = {}
        return wrong

    def renewed(self, trajectories: Any) -> list[str]:
        """Judge a population after a control cycle: all but the best follow the ways that were generated."""
        answered = [float(one["duration"]) for one in self.answered]
        durations = [float(one["duration"]) for one in trajectories]
        followed = [k for k, one in enumerate(trajectories) if int(one["id"]) == int(self.moving["id"])]
        others = [durations[:k] + durations[k + 1 :] for k in followed]
        if any(one == answered[: len(one)] for one in (durations, *others)):  # a tester may answer more than was asked
            return []
        return ["all but the member that is followed must have the trajectories that were generated, each its own"]

    def looks(self, payload: Any, now: int) -> list[str]:
        """Judge what the guard is to look at, and what it has seen already in these obstacles."""
        self.stage = 1
        [moving] = payload.trajectories
        if self.moving is None:
            self.moving, self.begins = moving, int(moving["begins"])
        wrong = []
        begins, first, last, margin, _ = payload.window
        if int(moving["begins"]) != self.begins or float(moving["duration"]) != float(self.moving["duration"]):
            wrong.append("it must look at the motion under way")
        parameters = self.parameters
        wanted: tuple[float, ...]
        if parameters.looks_ahead:
            since = max(int((now - self.begins) * 1e-9 / SAMPLE), 0)
            ahead = round(parameters.guard_horizon / SAMPLE) + 1
            wanted = self.begins, since, since + ahead, parameters.guard_margin, parameters.may_leave
        else:
            n = min(round(parameters.control_period / SAMPLE) + 1, int(moving["n"]))
            wanted = now, 0, n, 0.0, parameters.may_leave
        if tuple(payload.window) != wanted:
            wrong.append(f"(begin, samples, margin, leave) must be {wanted}, but is {tuple(payload.window)}")
        if self.guarded and self.cycle == "sensing" and self.obstacles is not None and not wrong:
            found = meets(moving, begins, first, last, margin, payload.drift, self.obstacles, parameters)
            if found and not self.halted:
                wrong.append(f"within {last - first - 1} samples it meets an obstacle, but the robot is not halted")
            if found is False and self.halted and not self.was_halted:
                wrong.append("it meets nobody, but the robot is halted")
        return wrong


def _same(dx: float, dy: float) -> bool:
    return math.hypot(dx, dy) <= _NEAR


def _leads_by(path: Any, kind: int, anchor: Pose) -> str:
    """Judge whether a switch leads by where the population begins at the latest; MAX_KNOTS may leave no room."""
    is_switch = kind == TRANSITION and int(path["n"]) < MAX_KNOTS
    if is_switch and not _same(float(path["x"][1]) - anchor.x, float(path["y"][1]) - anchor.y):
        return f"its ways must lead by {anchor.x:.6g}, {anchor.y:.6g} m, where they would begin at the latest"
    return ""


def _agrees(one: Pose, other: Pose) -> bool:
    return bool(np.allclose(one[:4], other[:4], atol=1e-4))


def _as_modified(path: Any, kind: int, modified: Any) -> str:
    """Compare a way with the path that it was made of: but for where it begins it is that path."""
    skip = 2 if kind == TRANSITION and int(path["n"]) == int(modified["n"]) + 1 else 1
    n = int(path["n"])
    for name in ("x", "y"):
        if path[name][skip:n].tolist() != modified[name][1 : int(modified["n"])].tolist():
            return "its way must be the modified path, from where the population begins"
    return ""
