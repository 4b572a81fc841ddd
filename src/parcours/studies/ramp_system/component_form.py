"""One system case, component by component: RAMP as messages on the simulated-time host, in the same world.

Without latencies this is the same planner as the compiled loop: same kernels, same streams, same bits. It shows which
messages passed and which transitions were taken when, at a thousandth of the speed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours.arena.world import WORLD, advance, begin
from parcours.kernels import Record
from parcours.planners.ramp.control import COMMAND_PERIOD, REPORT_PERIOD, Control
from parcours.planners.ramp.messages import OBSTACLE_STATE, POSE, Obstacles, Report, Step, many, one
from parcours.planners.ramp.path_modification import PathModification
from parcours.planners.ramp.planner import Planner
from parcours.planners.ramp.sensing import Sensing
from parcours.planners.ramp.trajectory_evaluation import TrajectoryEvaluation
from parcours.planners.ramp.trajectory_generator import TrajectoryGenerator
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.port import Link, links
from parcours.run.trace import Trace
from parcours.studies.ramp_components.model import component_model
from parcours.studies.ramp_system.closed_loop import SENSING_PERIOD
from parcours.studies.ramp_system.study import SystemStudy


class World:
    """The world as a component: sends what the sensors see, and drives the robot as commanded.

    Args:
        world: WORLD with robot and goal set.
        obstacles: array of OBSTACLE.
    """

    name = "World"

    def __init__(self, world: Record, obstacles: Record) -> None:
        self._origin = world.copy(), obstacles.copy()
        self.reset()

    def reset(self) -> None:
        """Put robot and obstacles where they began."""
        origin, obstacles = self._origin
        self.world = np.zeros(1, WORLD).view(np.recarray)[0]
        self.world.robot = origin.robot
        self.world.goal_x, self.world.goal_y, self.world.goal_tolerance = (
            origin.goal_x, origin.goal_y, origin.goal_tolerance,
        )  # fmt: skip
        self.obstacles = obstacles.copy()
        begin(self.world, self.obstacles)
        self._next_report, self._next_sensing, self._next_command = REPORT_PERIOD, SENSING_PERIOD, 0
        self.track: list[tuple[int, float, float, float]] = []

    def next_wake(self) -> int | None:
        """The next time anybody wants to know the robot's pose or the obstacles."""
        return min(self._next_report, self._next_command, self._next_sensing)

    def wake(self, now: int) -> Iterator[Step]:
        """Send the pose to Control, and the obstacles to Sensing when their message is due."""
        advance(self.world, self.obstacles, now)
        robot = self.world.robot
        pose = one(POSE)
        pose.x, pose.y, pose.heading, pose.v, pose.w = robot.x, robot.y, robot.heading, robot.v, robot.w
        sends: list[tuple[str, object]] = [("pose", Report(now, pose))]
        if self._next_report <= now:
            self._next_report += REPORT_PERIOD
        if self._next_command <= now:
            self._next_command += COMMAND_PERIOD
            self.track.append((now, float(robot.x), float(robot.y), float(robot.heading)))
        if self._next_sensing <= now:
            self._next_sensing += SENSING_PERIOD
            states = many(OBSTACLE_STATE, len(self.obstacles))
            for k in range(len(states)):
                seen, body = states[k].pose, self.obstacles[k]
                seen.x, seen.y, seen.heading = body["x"], body["y"], body["heading"]
                seen.v, seen.w, states[k].radius = body["v"], body["w"], body["radius"]
            sends.append(("odometry", Obstacles(now, states)))
        yield Step("", tuple(sends))

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take a command (forward speed [m/s], yaw rate [rad/s])."""
        if channel == "cmd_vel" and isinstance(message, tuple):
            advance(self.world, self.obstacles, now)
            self.world.robot.command_v, self.world.robot.command_w = message
            yield Step("")


def system_links() -> tuple[Link, ...]:
    """Return the links of the component model, with the world at its ends and what Table I leaves out."""
    inner = [
        Link(link.channel, "World" if link.channel == "odometry" else link.sender, link.receiver, 8, link.kind)
        for link in links(component_model())
    ]
    return (
        *inner,
        Link("imminent_collision", "Planner", "Control", 8),
        Link("speed_limit", "Planner", "Control", 8),
        Link("pose", "World", "Control", 8),
        Link("cmd_vel", "Control", "World", 8),
    )


def run_components(study: SystemStudy, number: int, seconds: float) -> tuple[World, Trace]:
    """Run one case of the study for that long [s] and return the world with the robot's track, and the trace.

    The study's latencies are not applied: every message arrives at once and no work takes time.
    """
    setting = study.setting()
    world = np.zeros(1, WORLD).view(np.recarray)[0]
    robot = world.robot
    robot.heading, robot.v, robot.command_v = setting.robot_heading, setting.robot_speed, setting.robot_speed
    parameters = study.parameters
    robot.v_max, robot.w_max = parameters.v_max, parameters.w_max
    robot.a_max, robot.alpha_max, robot.radius = (
        parameters.a_max,
        parameters.alpha_max,
        parameters.robot_radius,
    )
    world.goal_x, world.goal_y, world.goal_tolerance = setting.goal_x, setting.goal_y, setting.goal_tolerance
    body = World(world, study.cases.obstacles(np.array([number]))[0])
    start = one(POSE)
    start.heading, start.v = setting.robot_heading, setting.robot_speed
    goal = float(setting.goal_x), float(setting.goal_y)
    seed = study.cases.seed
    components = (
        body,
        Sensing(),
        TrajectoryGenerator(parameters),
        TrajectoryEvaluation(parameters),
        PathModification(parameters, seed, number),
        Planner(parameters, seed, number, start, goal),
        Control(parameters),
    )
    host = SimulatedHost(components, system_links())
    host.run(round(seconds * 1e9))
    trace = host.trace(study.cases.id(number))
    host.close()
    return body, trace
