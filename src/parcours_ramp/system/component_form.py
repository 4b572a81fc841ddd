"""One system case, component by component: RAMP as messages on the simulated-time host, in the same world.

This is the same planner as the compiled loop: same kernels, same streams, same bits. It shows which messages passed and
which transitions were taken when, at a thousandth of the speed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours.run.faults import FaultPlan
from parcours.run.hosts.component_faults import Death
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.port import Component, Link, links
from parcours.run.trace import Trace
from parcours_navigation.arena.observing import freeze_later, measure_robot, sense
from parcours_navigation.arena.world import WORLD, advance, begin
from parcours_navigation.facts import NEVER, TRACK
from parcours_navigation.measures.one_case import measures_of
from parcours_ramp.components.model import component_model
from parcours_ramp.planner import wire
from parcours_ramp.planner.control import COMMAND_PERIOD, REPORT_PERIOD, Control
from parcours_ramp.planner.latency import late_start, none
from parcours_ramp.planner.messages import OBSTACLE_STATE, POSE, Obstacles, PlannerStep, StateReport, many, one
from parcours_ramp.planner.path_modification import PathModification
from parcours_ramp.planner.planner import Planner
from parcours_ramp.planner.service import Sensing
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation
from parcours_ramp.planner.trajectory_generator import TrajectoryGenerator
from parcours_ramp.system.planner_paced import Guard, PacedControl, PacedPlanner, paced
from parcours_ramp.system.ramp_facts import FACTS, TRANSITIONS
from parcours_ramp.system.study import SystemStudy
from parcours_ramp.system.workspace import SENSING_PERIOD, WORKSPACE, freeze, watch

_COLUMNS = len(TRACK.names or ())
_STRETCH = 500_000_000  # How long the host runs on [ns] before it is asked whether the case has ended


class WorldComponent:
    """The world as a component: sends what the sensors see, and drives the robot as commanded.

    Args:
        before: called with the time [ns] before the world goes on to it.
        sends: the channels on which it says what is sensed.
    """

    name = "World"

    def __init__(self, study: SystemStudy, number: int, before: Callable[[int], None],
                 sends: tuple[str, ...] = ("odometry",)) -> None:  # fmt: skip
        self._sends = sends
        self._study, self._origin = study, study.cases.obstacles(np.array([number]))[0]
        self._before = before
        self._late = round(study.latencies.added_sensing * 1e9)
        self.reset()

    def reset(self) -> None:
        """Put robot and obstacles where they began."""
        self.world, self.obstacles = begin_world(self._study), self._origin.copy()
        begin(self.world, self.obstacles)
        self._robot = self.world.robot
        self._next_report, self._next_sensing, self._next_command = REPORT_PERIOD, SENSING_PERIOD, 0
        self._now = -1

    def pass_to(self, now: int) -> None:
        """Go on to the time `now` [ns], if it is later."""
        if now > self._now:
            self._now = now
            self._before(now)
            advance(self.world, self.obstacles, now)

    def next_wake(self) -> int | None:
        """The next time anybody wants to know the robot's pose or the obstacles."""
        return min(self._next_report, self._next_command, self._next_sensing)

    def wake(self, now: int) -> Iterator[PlannerStep]:
        """Send the pose to Control, and the obstacles to Sensing when their message is due."""
        self.pass_to(now)
        pose = one(POSE)
        measure_robot(self._robot, pose)
        sends: list[tuple[str, object]] = [("pose", StateReport(now, pose))]
        if self._next_report <= now:
            self._next_report += REPORT_PERIOD
        if self._next_command <= now:
            self._next_command += COMMAND_PERIOD
        if self._next_sensing <= now:
            self._next_sensing += SENSING_PERIOD
            states = many(OBSTACLE_STATE, len(self.obstacles))
            sense(self.obstacles, now - self._late, states)
            sensed = Obstacles(now - self._late, states)
            sends += [(channel, sensed) for channel in self._sends]
        yield PlannerStep("", tuple(sends))

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        """Take a command (forward speed [m/s], yaw rate [rad/s])."""
        if channel == "cmd_vel" and isinstance(message, tuple):
            advance(self.world, self.obstacles, now)
            self._robot["command_v"], self._robot["command_w"] = message
            yield PlannerStep("")

    def seen(self, now: int, halted: int) -> tuple[float, ...]:
        """Return an entry of a TRACK at `now` [ns], then where the obstacles are."""
        places = zip(self.obstacles["x"].tolist(), self.obstacles["y"].tolist(), strict=True)
        pose = (self._robot[name] for name in ("x", "y", "heading", "v", "w"))
        return (now, *pose, halted, *(value for place in places for value in place))


def system_links() -> tuple[Link, ...]:
    """Return the links of the component model, with the world at its ends and what Table I leaves out."""
    inner = [
        Link(link.channel, "World" if link.channel == "odometry" else link.sender, link.receiver, 8, link.kind)
        for link in links(component_model())
    ]
    return (
        *inner, Link("imminent_collision", "Planner", "Control", 8), Link("speed_limit", "Planner", "Control", 8),
        Link("pose", "World", "Control", 8), Link("cmd_vel", "Control", "World", 8),
    )  # fmt: skip


class Witness:
    """A component that takes part in nothing, and keeps the facts of the case: after every command, and at its end."""

    name = "Witness"

    def __init__(self, setting: Record, world: WorldComponent, planner: Planner, control: Control) -> None:
        self._world, self._planner, self._control = world, planner, control
        self._limit, self._extension = int(setting.limit), int(setting.extension)
        self._goal = float(setting.goal_x), float(setting.goal_y)
        self._tolerance = float(setting.goal_tolerance)
        self.reset()

    def reset(self) -> None:
        """Forget everything seen."""
        self._work = one(WORKSPACE)
        self._seen_control, self._seen_world = self._work.control, self._work.world
        self._facts = one(FACTS)
        self._facts.t_goal_after = NEVER
        self._frozen = False
        self._next = 0
        self._entries: list[tuple[float, ...]] = []
        self._judged = 0
        self.ended: int | None = None
        """The time [ns] from which nothing counts any more."""

    def next_wake(self) -> int | None:
        """The next command: what is due at the same time has been done before."""
        return self._next

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        """Do nothing."""
        return iter(())

    def wake(self, now: int) -> Iterator[PlannerStep]:
        """Look at robot and controller."""
        self._next += COMMAND_PERIOD
        if self.ended is not None:
            return
        work, facts, body = self._work, self._facts, self._world
        robot, halted = body.world["robot"], self._control._state["halt"]
        self._seen_control["halt"], self._seen_world["robot"] = halted, robot
        watch(work, now, facts)
        if self._frozen and work["t_moving"] > facts["t_end"] + 1_000_000_000:
            facts["moved_after"] = 1
        self._entries.append(body.seen(now, halted))
        self._judged += not self._frozen
        yield from ()

    def before(self, now: int) -> None:
        """See whether the case ends before the world goes on to the time `now` [ns], or was observed long enough."""
        body = self._world
        if self.ended is not None:
            return
        if not self._frozen and (now >= self._limit or body.world["t_goal"] != NEVER):
            advance(body.world, body.obstacles, min(now, self._limit))
            work = self._work
            work.world, work.planner, work.control = body.world, self._planner.state, self._control._state
            freeze(work, body.obstacles, self._facts)
            self._frozen = True
            if body.world["t_goal"] != NEVER:
                self.ended = now
        if now >= self._limit + self._extension:
            self.ended = now
        if self.ended is None and self._frozen:
            advance(body.world, body.obstacles, now)
            if body.world["t_goal"] != NEVER:
                self._facts.t_goal_after, self._facts.moved_after = body.world.t_goal, 1
                self.ended = now
        if self.ended is not None:
            freeze_later(body.world, self._facts)

    def facts(self, number: int, trace: Trace) -> NDArray[np.void]:
        """Return the facts of the case, array of FACTS of shape (1,), once it has ended."""
        facts = np.zeros(1, FACTS)
        facts[0] = self._facts
        taken = Counter(
            event.transition for event in trace.events if event.kind == "take" and event.time < cast(int, self.ended)
        )
        facts["number"], facts["n_track"] = number, len(self._entries)
        facts["n_late_cycles"] = sum(time < cast(int, self.ended) for time in getattr(self._planner, "late", ()))
        facts["n_planning_cycles"], facts["n_control_cycles"] = taken["p11"], taken["p12"]
        facts["transitions"] = [taken[name] for name in TRANSITIONS]
        track, places = self.track()
        facts["measures"] = measures_of(
            track[: self._judged], places[: self._judged], self._world.obstacles["radius"],
            robot_radius=float(self._world.world.robot.radius), goal=self._goal, goal_tolerance=self._tolerance,
            t_goal=int(self._facts.t_goal),
        )  # fmt: skip
        return facts

    def track(self) -> tuple[NDArray[np.void], NDArray[np.float64]]:
        """Return the robot's track, array of TRACK of shape (n,), and the obstacles' places, (n, n_obstacles, 2)."""
        return as_track(self._entries)


def as_track(entries: list[tuple[float, ...]]) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """Return the track and the places that `World.seen` has noted, as `Witness.track` does."""
    track = np.array([entry[:_COLUMNS] for entry in entries], TRACK)
    places = np.array([entry[_COLUMNS:] for entry in entries])
    return track, places.reshape(len(track), -1, 2)


@dataclass(frozen=True, slots=True)
class ComponentRun:
    """What a case leaves behind that ran component by component.

    Attributes:
        acted: for those that always have something to do (Planner, Control, Sensing), when they last did [ns].
    """

    facts: NDArray[np.void] | None  # array of FACTS, shape (1,); None if the case was not run to its end
    track: NDArray[np.void]  # array of TRACK, shape (n,), one entry a command
    places: NDArray[np.float64]  # of the obstacles at the same times [m], shape (n, n_obstacles, 2)
    trace: Trace  # every message and transition
    deaths: tuple[Death, ...] = ()  # the components that died of a fault
    strikes: int = 0  # how many messages and components a fault struck
    acted: tuple[tuple[str, int], ...] = ()


def begin_world(study: SystemStudy) -> Record:
    """Return a fresh WORLD with the study's robot at its start."""
    setting, parameters = study.setting(), study.parameters
    world = np.zeros(1, WORLD).view(np.recarray)[0]
    robot = world.robot
    robot.heading, robot.v, robot.command_v = setting.robot_heading, setting.robot_speed, setting.robot_speed
    robot.v_max, robot.w_max = parameters.v_max, parameters.w_max
    robot.a_max, robot.alpha_max, robot.radius = parameters.a_max, parameters.alpha_max, parameters.robot_radius
    world.solid = setting.solid
    world.goal_x, world.goal_y, world.goal_tolerance = setting.goal_x, setting.goal_y, setting.goal_tolerance
    return world


def start_pose(study: SystemStudy) -> Record:
    """Return the POSE in which the study's robot begins, as its planner knows it."""
    setting, start = study.setting(), one(POSE)
    start.heading, start.v = setting.robot_heading, setting.told_speed
    return start


def run_components(
    study: SystemStudy, number: int, seconds: float | None = None, *, recording: bool = True,
    faults: FaultPlan | None = None,
) -> ComponentRun:  # fmt: skip
    """Run one case of the study to its end, or for that long [s] if given.

    Its latencies are the study's (`PacedPlanner`); with `latency.none()`, the planner does its work at once, and
    its guard belongs to it. Without `recording` the
    trace stays empty, and what the facts count of cycles and transitions stays 0; that is faster by a tenth. Under a
    plan of `faults`, a component that raises has died, and the case goes on.

    Raises:
        BadRequest: a fault names what RAMP does not have.
        HostFailure: a component raised, without a plan of faults, or never came to an end.
    """
    setting, parameters = study.setting(), study.parameters
    is_timeless, has_guard = study.latencies == none(), study.parameters.schedule == "guarded"
    sends = ("odometry", "sensed") if has_guard and not is_timeless else ("odometry",)
    body = WorldComponent(study, number, lambda now: witness.before(now), sends)
    goal = float(setting.goal_x), float(setting.goal_y)
    seed = study.cases.seed
    stream = np.zeros(1, np.uint64)
    opens = late_start(stream, np.uint64(seed), np.uint64(number)) if setting.starts_late else 0
    guards: tuple[Guard, ...] = ()
    if is_timeless:
        planner = Planner(parameters, seed, number, start_pose(study), goal)
        control = Control(parameters, opens)
    else:
        planner = PacedPlanner(parameters, seed, number, start_pose(study), goal, study.latencies, body.pass_to)
        planner.expected = (control := PacedControl(parameters, opens, body.pass_to)).expect
        guards = (Guard(planner, control, study.latencies),)
    witness = Witness(setting, body, planner, control)
    components: tuple[Component, ...] = (
        body, *guards, Sensing(), TrajectoryGenerator(parameters), TrajectoryEvaluation(parameters),
        PathModification(parameters, seed, number), planner, control, witness,
    )  # fmt: skip
    host = SimulatedHost(
        components, paced(system_links()) if guards else system_links(), recording=recording, faults=faults, codec=wire,
        transport=guards[0].transport if guards else None,
    )  # fmt: skip
    if seconds is not None:
        host.run(round(seconds * 1e9))
    else:
        until = 0
        while witness.ended is None:
            until += _STRETCH
            host.run(until - 1)
    trace = host.trace(study.cases.id(number))
    deaths, strikes = host.deaths, host.strikes
    acted = tuple((name, host.acted(name)) for name in ("Planner", "Control", "Sensing"))
    host.close()
    return ComponentRun(
        None if seconds is not None else witness.facts(number, trace), *witness.track(), trace, deaths, strikes, acted
    )
