"""RVO2, by its Python bindings pyrvo, as a planner: `parcours_navigation.adapters.pyrvo:Pyrvo`.

The library of van den Berg, Guy, Lin and Manocha (RVO2; Apache licence), which takes every agent to do half of the
avoiding, and computes in single precision. A simulation is made for each observation, so nothing is remembered.
"""

from __future__ import annotations

from parcours.elementary import sin_cos
from parcours_navigation.adapters.optional_imports import imported
from parcours_navigation.planners.orca import drive_towards
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import HEADING, RADIUS, SPEED, Answer, Command, Observation, Task, Velocity, X, Y

_LOOKAHEAD = 1.0
_ALIGN = 0.6


class Pyrvo:
    """The velocity that RVO2 chooses, followed by a unicycle, or driven as it is by a holonomic robot.

    With a map or a path it heads for a point 1 m ahead on the way; walls are polygons.

    Args:
        horizon: time for which velocities are free of collision with other agents [s].
        wall_horizon: ... with walls [s].
        margin: the robot's radius is enlarged by it [m].

    Raises:
        BadRequest: pyrvo is not installed.
    """

    def __init__(self, horizon: float = 5.0, wall_horizon: float = 1.5, margin: float = 0.05) -> None:
        self._pyrvo = imported("pyrvo", "pyrvo")
        self._horizon, self._wall_horizon, self._margin = horizon, wall_horizon, margin
        self._surroundings, self._route = Surroundings(), Route(margin)

    def reset(self, task: Task) -> None:
        """Begin a case: forget the way over a map."""
        self._route.begin()

    def observe(self, observation: Observation) -> Answer:
        """Return the speeds that turn the robot into its new velocity; at the goal, to stand."""
        task, robot, limits = observation.task, observation.robot, observation.task.limits
        self._surroundings.look(observation)
        aim = self._route.aim(observation, self._surroundings.walls, _LOOKAHEAD)
        dx, dy, distance, speed = towards(observation, aim)
        is_holonomic = task.robot.kind == "holonomic"
        if speed == 0.0:
            return Velocity(0.0, 0.0, 0.0) if is_holonomic else Command(0.0, 0.0)
        x, y, heading = float(robot[X]), float(robot[Y]), float(robot[HEADING])
        s, c = sin_cos(heading)
        radius, step = task.robot_radius + self._margin, task.period or 0.05
        far = radius + limits.speed * self._horizon + 5.0
        n = len(observation.obstacles) + 1
        setting = far, n, self._horizon, self._wall_horizon
        world = self._pyrvo.RVOSimulator(step, *setting, radius, limits.speed)
        for disc in self._surroundings.discs(observation, radius + limits.speed * self._wall_horizon):
            left, right = float(disc[X] - disc[RADIUS]) - 1e-3, float(disc[X] + disc[RADIUS]) + 1e-3
            low, high = float(disc[Y] - disc[RADIUS]) - 1e-3, float(disc[Y] + disc[RADIUS]) + 1e-3
            world.add_obstacle([(left, low), (right, low), (right, high), (left, high)])
        world.process_obstacles()
        now = float(robot[SPEED]) * c, float(robot[SPEED]) * s
        world.add_agent((x, y), *setting, radius, limits.speed, now)
        world.set_agent_pref_velocity(0, (dx * speed / distance, dy * speed / distance))
        for row in observation.obstacles:
            other_s, other_c = sin_cos(float(row[HEADING]))
            moves = float(row[SPEED]) * other_c, float(row[SPEED]) * other_s
            at, top = (float(row[X]), float(row[Y])), max(abs(float(row[SPEED])), 1e-3)
            k = world.add_agent(at, *setting, float(row[RADIUS]), top, moves)
            world.set_agent_pref_velocity(k, moves)
        world.do_step()
        chosen = world.get_agent_velocity(0)
        vx, vy = float(chosen.x), float(chosen.y)
        if is_holonomic:
            return Velocity(c * vx + s * vy, c * vy - s * vx, 0.0)
        return Command(*drive_towards(heading, vx, vy, _ALIGN, limits.yaw_rate, limits.yaw_acceleration))
