"""Behaviours of navground as planners: `parcours_navigation.adapters.navground:HL`, and so on.

navground (J. Guzzi, IDSIA; MIT licence) computes in single precision. A behaviour is made afresh for each case, so no
case depends on another one.
"""

from __future__ import annotations

from typing import Any, ClassVar

from parcours.elementary import sin_cos
from parcours.errors import BadRequest, one_of
from parcours_navigation.adapters.optional_imports import imported
from parcours_navigation.planners.route import Route
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import (
    HEADING,
    RADIUS,
    SPEED,
    YAW_RATE,
    Answer,
    Command,
    Observation,
    Task,
    Velocity,
    X,
    Y,
)

_LOOKAHEAD = 1.0


class Navground:
    """A behaviour by the name under which navground registers it: "ORCA", "HL", "HRVO", "SocialForce", or a plugin's.

    Walls are given to it as static discs, obstacles as neighbours. With a map or a path it heads for a point 1 m ahead
    on the way.

    Args:
        behavior: the registered name.
        margin: navground's `safety_margin` [m].
        horizon: how far it looks [m].
        properties: properties of the behaviour by name, such as `tau` of HL.

    Raises:
        BadRequest: navground is not installed, or it knows no such behaviour.
    """

    def __init__(self, behavior: str, margin: float = 0.03, horizon: float = 5.0, **properties: Any) -> None:
        self._core = imported("navground.core", "navground")
        self._kinematics = imported("navground.core.kinematics", "navground")
        self._name, self._margin, self._horizon, self._properties = behavior, margin, horizon, properties
        if behavior not in self._core.Behavior.types:
            where = f"navground behaviour {behavior!r}"
            known = [name for name in self._core.Behavior.types if name]
            raise BadRequest(where, "must be registered", one_of(behavior, known), slug="no-adapter")
        self._surroundings, self._route = Surroundings(), Route(margin)
        self._behavior: Any = None

    def reset(self, task: Task) -> None:
        """Make a new behaviour, with the kinematics of the task's robot."""
        made = self._core.Behavior.make_type(self._name)
        made.kinematics, made.radius = self._moving(task), task.robot_radius
        made.safety_margin, made.horizon, made.optimal_speed = self._margin, self._horizon, task.limits.speed
        for name, value in self._properties.items():
            made.set(name, value)
        made.prepare()
        self._behavior = made
        self._route.begin()

    def observe(self, observation: Observation) -> Answer:
        """Return the speeds that the behaviour asks for; at the goal, to stand."""
        core, made, task, robot = self._core, self._behavior, observation.task, observation.robot
        self._surroundings.look(observation)
        aim = self._route.aim(observation, self._surroundings.walls, _LOOKAHEAD)
        x, y, heading = float(robot[X]), float(robot[Y]), float(robot[HEADING])
        is_holonomic = task.robot.kind == "holonomic"
        near = 0.5 * task.goal_tolerance
        if (task.goal[0] - x) ** 2 + (task.goal[1] - y) ** 2 <= near * near:
            return Velocity(0.0, 0.0, 0.0) if is_holonomic else Command(0.0, 0.0)
        made.pose = core.Pose2((x, y), heading)
        made.twist = core.Twist2((float(robot[SPEED]), 0.0), float(robot[YAW_RATE]), core.Frame.relative)
        made.target = core.Target.Point((aim.x, aim.y), near if aim.is_goal else 0.0)
        if (state := made.environment_state) is not None:
            state.neighbors = [self._neighbor(k, row) for k, row in enumerate(observation.obstacles)]
            state.static_obstacles = [
                core.Disc((float(row[X]), float(row[Y])), float(row[RADIUS]))
                for row in self._surroundings.discs(observation, self._horizon)
            ]
        twist = made.compute_cmd(task.period or 0.05, core.Frame.relative)
        ahead, left, turning = map(float, (*twist.velocity, twist.angular_speed))
        return Velocity(ahead, left, turning) if is_holonomic else Command(ahead, turning)

    def _neighbor(self, k: int, row: Any) -> Any:
        s, c = sin_cos(float(row[HEADING]))
        velocity = float(row[SPEED]) * c, float(row[SPEED]) * s
        return self._core.Neighbor((float(row[X]), float(row[Y])), float(row[RADIUS]), velocity, k + 1)

    def _moving(self, task: Task) -> Any:
        """Return navground's kinematics for the robot."""
        speed, yaw_rate, robot = task.limits.speed, task.limits.yaw_rate, task.robot
        if robot.kind == "holonomic":
            return self._kinematics.OmnidirectionalKinematics(speed, yaw_rate)
        if robot.kind == "differential" and robot.track_width > 0.0:
            return self._kinematics.TwoWheelsDifferentialDriveKinematics(speed, robot.track_width, yaw_rate)
        if robot.kind == "car" and robot.wheelbase > 0.0:
            return self._kinematics.BicycleKinematics(speed, 0.0, robot.wheelbase, robot.steering)
        return self._kinematics.AheadKinematics(speed, yaw_rate)


class _Named(Navground):
    behavior: ClassVar[str]

    def __init__(self) -> None:
        super().__init__(self.behavior)


class ORCA(_Named):
    """Optimal reciprocal collision avoidance, by navground."""

    behavior = "ORCA"


class HL(_Named):
    """The human-like behaviour of Guzzi, Giusti, Gambardella, Theraulaz, Di Caro (ICRA 2013), by navground."""

    behavior = "HL"


class HRVO(_Named):
    """Hybrid reciprocal velocity obstacles, by navground."""

    behavior = "HRVO"


class SocialForce(_Named):
    """Helbing and Molnar's social force, by navground."""

    behavior = "SocialForce"
