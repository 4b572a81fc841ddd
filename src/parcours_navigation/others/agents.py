"""All agents under one clock: put them at the start, and move them by one tick.

Once a tick, after the world's clock has gone on to `now`, `step_agents` brings every agent from now - dt to now and
writes where it is into its OBSTACLE record: x, y, heading, v, w, now. People decide every 50 ms (DECISION), from one
picture of all places, so their order does not matter; between decisions social force keeps its acceleration and ORCA
its velocity; contact is felt, and places are integrated, at every tick.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.others.agent import CONSTANT, DECISION, FORCE, FOREVER, TRACK, WALK, WAYPOINTS
from parcours_navigation.others.people import decide_people
from parcours_navigation.others.social_force import contact
from parcours_navigation.others.walking import step_constant, step_track, step_walk, step_waypoints
from parcours_navigation.others.wall_contact import room_at, slide, step_off
from parcours_navigation.protocol import Floats

_STANDING = 1e-9


@kernel
def begin_agents(agents: Record, ways: Floats, obstacles: Record, walls: Floats) -> None:
    """Put all agents at the start: time 0, and nobody has moved yet.

    Args:
        agents: array of AGENT, shape (n,); what they are must be set.
        ways: rows of waypoints (pause, x, y) [s, m, m] and tracks (t, x, y), shape (m, 3).
        obstacles: array of OBSTACLE; of those of agents x0, y0 and radius must be set.
        walls: those of `walls.nearest`.
    """
    for k in range(len(agents)):
        agent = agents[k]
        obstacle = obstacles[agent.obstacle]
        obstacle.x, obstacle.y, obstacle.heading = obstacle.x0, obstacle.y0, wrap(agent.heading)
        obstacle.heading0, obstacle.speed, obstacle.turn = obstacle.heading, agent.top, 0.0
        obstacle.start, obstacle.stop, obstacle.announced = 0, FOREVER, 0
        obstacle.v = obstacle.w = 0.0
        obstacle.now = 0
        obstacle.touching = 0
        obstacle.apart = -1
        agent.vx = agent.vy = agent.ax = agent.ay = agent.push_x = agent.push_y = 0.0
        agent.n_close = 0
        agent.at, agent.until = agent.first, agent.start
        agent.want, agent.pace = obstacle.heading, agent.speed
        agent.stream[0] = agent.seed
        agent.room = room_at(walls, obstacle.x, obstacle.y, obstacle.radius)
        if agent.kind == TRACK:
            step_track(agent, obstacle, ways, 0)
            _show(agent, obstacle)


@kernel
def _show(agent: Record, obstacle: Record) -> None:
    """Write speed and heading of the agent's velocity into its OBSTACLE; who stands keeps the heading."""
    square = agent.vx * agent.vx + agent.vy * agent.vy
    if square > _STANDING * _STANDING:
        obstacle.heading = atan2(agent.vy, agent.vx)
        obstacle.v = np.sqrt(square)
    else:
        obstacle.v = 0.0


@kernel
def _set_out(agent: Record) -> None:
    """Give an agent at constant velocity that velocity."""
    s, c = sin_cos(agent.heading)
    agent.vx, agent.vy = agent.speed * c, agent.speed * s


@kernel
def _feel_contact(agent: Record, obstacles: Record, robot_x: float, robot_y: float, robot_radius: float) -> None:
    """Set the acceleration by bodies in contact, those of the robot and of whom the last decision found close."""
    me = obstacles[agent.obstacle]
    push_x, push_y = 0.0, 0.0
    for m in range(agent.n_close):
        other = obstacles[agent.close[m]]
        px, py = contact(agent.stiffness, other.x - me.x, other.y - me.y, me.radius + other.radius)
        push_x += px
        push_y += py
    if agent.yields > 0.0:
        px, py = contact(agent.stiffness, robot_x - me.x, robot_y - me.y, me.radius + robot_radius)
        push_x += px
        push_y += py
    agent.push_x, agent.push_y = push_x, push_y


@kernel
def _step_person(agent: Record, obstacle: Record, walls: Floats, dt: float) -> None:
    """Integrate what the person decided: velocity first, then the place; no wall is entered."""
    agent.vx += (agent.ax + agent.push_x) * dt
    agent.vy += (agent.ay + agent.push_y) * dt
    square = agent.vx * agent.vx + agent.vy * agent.vy
    if square > agent.top * agent.top:
        share = agent.top / np.sqrt(square)
        agent.vx *= share
        agent.vy *= share
    touched, nx, ny = step_off(agent, obstacle, walls, agent.vx * dt, agent.vy * dt)
    if touched:
        slide(agent, nx, ny, 0.0)


@heap_kernel
def step_agents(
    agents: Record,
    ways: Floats,
    obstacles: Record,
    walls: Floats,
    robot_x: float,
    robot_y: float,
    robot_vx: float,
    robot_vy: float,
    robot_radius: float,
    now: int,
    dt: float,
) -> None:
    """Move every agent by one tick, to `now`.

    Args:
        agents: array of AGENT, shape (n,).
        ways: those given to `begin_agents`.
        obstacles: array of OBSTACLE; those without an agent are avoided, but not moved.
        walls: those of `walls.nearest`.
        robot_x, robot_y: where the robot is at the beginning of the tick [m].
        robot_vx, robot_vy: its velocity then, in the world's frame [m/s].
        robot_radius: [m].
        now: end of the tick [ns].
        dt: length of the tick [s]; people decide at ticks that begin at a multiple of DECISION.

    An agent whose OBSTACLE was stopped for good (`stop` is not after now) stays where it is.
    """
    before = now - int(dt * 1e9 + 0.5)
    if before % DECISION == 0:
        robot = np.empty(5)
        robot[0], robot[1], robot[2], robot[3], robot[4] = robot_x, robot_y, robot_vx, robot_vy, robot_radius
        decide_people(agents, ways, obstacles, walls, robot, before)
    for k in range(len(agents)):
        if agents[k].kind == FORCE:  # before anybody moves: the order of agents must not matter
            _feel_contact(agents[k], obstacles, robot_x, robot_y, robot_radius)
    for k in range(len(agents)):
        agent = agents[k]
        obstacle = obstacles[agent.obstacle]
        obstacle.now = now
        if before >= obstacle.stop or (before < agent.start and agent.kind != TRACK):
            agent.vx = agent.vy = 0.0
            obstacle.v = obstacle.w = 0.0
            continue
        if agent.kind >= FORCE:
            _step_person(agent, obstacle, walls, dt)
        elif agent.kind == CONSTANT:
            if before < agent.start + int(dt * 1e9 + 0.5):
                _set_out(agent)
            step_constant(agent, obstacle, walls, dt)
        elif agent.kind == WAYPOINTS:
            step_waypoints(agent, obstacle, ways, walls, now, dt)
        elif agent.kind == WALK:
            step_walk(agent, obstacle, walls, now, dt)
            obstacle.v = np.sqrt(agent.vx * agent.vx + agent.vy * agent.vy)
            continue
        else:
            step_track(agent, obstacle, ways, now)
        _show(agent, obstacle)
