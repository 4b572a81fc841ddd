"""What people decide, all from the same picture of who is where: social force sets accelerations, ORCA velocities.

A body is a row of BODY numbers. The robot is looked at apart, so that it is never left out for nearer ones.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.others.agent import CLOSE, DECISION, FORCE, ORCA, STAND
from parcours_navigation.others.half_planes import half_plane, new_velocity, wall_plane
from parcours_navigation.others.neighbours import Integers, fill_grid, nearest_bodies, table_size
from parcours_navigation.others.social_force import drive_force, group_force, interaction, wall_force
from parcours_navigation.others.walking import next_waypoint
from parcours_navigation.others.walls import FOUND, foot, walls_within
from parcours_navigation.protocol import Floats

BODY = 7
"""Numbers of a body: x, y, vx, vy, radius [m, m/s, m]; 1 if it avoids by ORCA as well, else 0; group, or -1."""

MOST = 32
"""Nobody looks at more of the others than this."""

WALLS = 32
"""Nobody looks at more walls than this."""

_SLOW_DOWN = 0.5
_OVERLAP = 0.1
_SOON = 0.25
_ONE = 1e-9


@kernel
def picture(agents: Record, obstacles: Record, now: int, bodies: Floats) -> float:
    """Fill in the bodies, shape (n_obstacles, BODY), as they are at `now` [ns]; return how far anybody looks [m]."""
    for i in range(len(obstacles)):
        obstacle = obstacles[i]
        s, c = sin_cos(obstacle.heading)
        bodies[i, 0], bodies[i, 1] = obstacle.x, obstacle.y
        bodies[i, 2], bodies[i, 3] = obstacle.v * c, obstacle.v * s
        bodies[i, 4], bodies[i, 5], bodies[i, 6] = obstacle.radius, 0.0, -1.0
    farthest = 0.0
    for k in range(len(agents)):
        agent = agents[k]
        i = agent.obstacle
        bodies[i, 6] = agent.group
        if agent.kind >= FORCE:
            farthest = max(farthest, agent.reach)
        if now >= obstacles[i].stop or now < agent.start:
            continue  # one that was stopped, or waits, avoids nobody
        bodies[i, 2], bodies[i, 3] = agent.vx, agent.vy
        bodies[i, 5] = 1.0 if agent.kind == ORCA else 0.0
    return farthest


@kernel
def middles(bodies: Floats, sums: Floats) -> None:
    """Add up, for each group, the places of its members and their number, shape (>= n_groups, 3)."""
    sums[:] = 0.0
    for i in range(len(bodies)):
        group = int(bodies[i, 6])
        if group >= 0:
            sums[group, 0] += bodies[i, 0]
            sums[group, 1] += bodies[i, 1]
            sums[group, 2] += 1.0


@kernel
def wish(agent: Record, ways: Floats, x: float, y: float, now: int) -> tuple[float, float]:
    """Return the velocity (x, y) [m/s] that the person wants, and turn to the next goal where one is reached."""
    if agent.count == 0:
        s, c = sin_cos(agent.heading)
        return agent.speed * c, agent.speed * s
    dx, dy = ways[agent.at, 1] - x, ways[agent.at, 2] - y
    if dx * dx + dy * dy <= agent.arrive * agent.arrive and now >= agent.until:
        next_waypoint(agent, ways, now)
        dx, dy = ways[agent.at, 1] - x, ways[agent.at, 2] - y
    if now < agent.until:
        return 0.0, 0.0
    distance = np.sqrt(dx * dx + dy * dy)
    is_last = agent.ends == STAND and agent.at == agent.first + agent.count - 1
    speed = min(agent.speed, distance / _SLOW_DOWN) if is_last else agent.speed
    if distance < _ONE:
        return 0.0, 0.0
    return speed * dx / distance, speed * dy / distance


@kernel
def decide_force(
    agent: Record, i: int, bodies: Floats, robot: Floats, found: Integers, n: int, walls: Floats, n_walls: int,
    sums: Floats, wish_x: float, wish_y: float,
) -> None:  # fmt: skip
    """Set the acceleration of a person by social force.

    `found` are the n bodies looked at, `walls` rows of FOUND, `robot` x, y, vx, vy, radius, `sums` those of `middles`.
    """
    x, y, radius = bodies[i, 0], bodies[i, 1], bodies[i, 4]
    ax, ay = drive_force(agent, wish_x, wish_y)
    for m in range(n):
        j = found[m]
        dx, dy = bodies[j, 0] - x, bodies[j, 1] - y
        reach = radius + bodies[j, 4]
        fx, fy = interaction(agent, dx, dy, agent.vx - bodies[j, 2], agent.vy - bodies[j, 3], reach)
        ax += fx
        ay += fy
        soon = reach + _SOON
        if agent.n_close < CLOSE and dx * dx + dy * dy < soon * soon:
            agent.close[agent.n_close] = j
            agent.n_close += 1
    if agent.yields > 0.0:
        dx, dy = robot[0] - x, robot[1] - y
        if dx * dx + dy * dy < agent.reach * agent.reach:
            fx, fy = interaction(agent, dx, dy, agent.vx - robot[2], agent.vy - robot[3], radius + robot[4])
            ax += agent.yields * fx
            ay += agent.yields * fy
    for m in range(n_walls):
        wx, wy = foot(walls[m, 0], walls[m, 1], walls[m, 2], walls[m, 3], x, y)
        fx, fy = wall_force(agent, wx - x, wy - y, radius + walls[m, 4])
        ax += fx
        ay += fy
    if agent.group >= 0:
        size = sums[agent.group, 2]
        fx, fy = group_force(agent, sums[agent.group, 0] / size - x, sums[agent.group, 1] / size - y, int(size))
        ax += fx
        ay += fy
    agent.ax, agent.ay = ax, ay


@kernel
def decide_orca(
    agent: Record, i: int, bodies: Floats, robot: Floats, found: Integers, n: int, walls: Floats, n_walls: int,
    planes: Floats, scratch: Floats, wish_x: float, wish_y: float,
) -> None:  # fmt: skip
    """Set the velocity of a person by ORCA; arguments as those of `decide_force`, and room for all half-planes."""
    x, y, radius = bodies[i, 0], bodies[i, 1], bodies[i, 4] + agent.margin
    vx, vy = agent.vx, agent.vy
    k = 0
    for m in range(n_walls):
        ax, ay, bx, by = walls[m, 0] - x, walls[m, 1] - y, walls[m, 2] - x, walls[m, 3] - y
        nx, ny, b = wall_plane(ax, ay, bx, by, bodies[i, 4] + walls[m, 4], agent.wall_horizon, vx, vy)
        planes[k, 0], planes[k, 1], planes[k, 2] = nx, ny, b
        k += 1
    for m in range(-1, n):
        if m >= 0:
            j = found[m]
            ox, oy, ovx, ovy, reach = bodies[j, 0], bodies[j, 1], bodies[j, 2], bodies[j, 3], radius + bodies[j, 4]
            share = 1.0
            if bodies[j, 5] > 0.0:  # it keeps the margin, and does half the avoiding, too
                share, reach = 0.5, reach + agent.margin
        else:
            ox, oy, ovx, ovy, reach, share = robot[0], robot[1], robot[2], robot[3], radius + robot[4], agent.yields
            far = agent.reach
            if share <= 0.0 or (ox - x) * (ox - x) + (oy - y) * (oy - y) >= far * far:
                continue
        ux, uy, nx, ny = half_plane(ox - x, oy - y, vx - ovx, vy - ovy, reach, agent.horizon, _OVERLAP)
        planes[k, 0], planes[k, 1] = nx, ny
        planes[k, 2] = (vx + share * ux) * nx + (vy + share * uy) * ny
        k += 1
    s, c = sin_cos(agent.tilt)
    x, y = new_velocity(planes, scratch, k, n_walls, c * wish_x - s * wish_y, s * wish_x + c * wish_y, agent.top)
    most = agent.acceleration * (DECISION * 1e-9)
    dx, dy = x - vx, y - vy
    change = np.sqrt(dx * dx + dy * dy)
    if change > most:
        x, y = vx + dx * most / change, vy + dy * most / change
    agent.vx, agent.vy = x, y


@heap_kernel
def decide_people(agents: Record, ways: Floats, obstacles: Record, walls: Floats, robot: Floats, now: int) -> None:
    """Let all people decide at `now` [ns]. `robot` is x, y, vx, vy, radius [m, m/s, m]."""
    people = 0
    for k in range(len(agents)):
        if agents[k].kind >= FORCE:
            people += 1
    if people == 0:
        return
    n_bodies = len(obstacles)
    bodies, sums = np.empty((n_bodies, BODY)), np.empty((len(agents), 3))
    heads, cells = np.empty(table_size(n_bodies), np.int64), np.empty((n_bodies, 3), np.int64)
    found, squares = np.empty(MOST, np.int64), np.empty(MOST)
    near = np.empty((WALLS, FOUND))
    planes, scratch = np.empty((WALLS + MOST + 1, 3)), np.empty((WALLS + MOST + 1, 3))
    cell = max(0.5 * picture(agents, obstacles, now, bodies), 1e-3)
    fill_grid(bodies, cell, heads, cells)
    middles(bodies, sums)
    for k in range(len(agents)):
        agent = agents[k]
        i = agent.obstacle
        if agent.kind < FORCE:
            continue
        agent.ax = agent.ay = 0.0
        agent.n_close = 0
        if now >= obstacles[i].stop or now < agent.start:
            agent.vx = agent.vy = 0.0
            continue
        wish_x, wish_y = wish(agent, ways, bodies[i, 0], bodies[i, 1], now)
        n = nearest_bodies(bodies, cell, heads, cells, i, agent.reach, min(agent.nearest, MOST), found, squares)
        if agent.kind == FORCE:
            far = 10.0 * agent.wall_range
        else:
            far = agent.top * agent.wall_horizon
        n_walls = 0
        if agent.room < far:
            n_walls = walls_within(walls, bodies[i, 0], bodies[i, 1], far + bodies[i, 4], near)
        if agent.kind == FORCE:
            decide_force(agent, i, bodies, robot, found, n, near, n_walls, sums, wish_x, wish_y)
        else:
            decide_orca(agent, i, bodies, robot, found, n, near, n_walls, planes, scratch, wish_x, wish_y)
