"""Motion that looks at nobody: constant velocity, waypoints, random walk, recorded track. One tick each."""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours.streams import between
from parcours_navigation.others.agent import FOREVER, GO_ON
from parcours_navigation.others.wall_contact import slide, step_off
from parcours_navigation.protocol import Floats

_NS = 1e-9


@kernel
def step_constant(agent: Record, obstacle: Record, walls: Floats, dt: float) -> None:
    """Move on at constant velocity; at walls and bounds it stands, or is thrown back."""
    dx, dy = agent.vx * dt, agent.vy * dt
    bounce = 1.0 if agent.ends == GO_ON else -1.0
    x, y = obstacle.x + dx, obstacle.y + dy
    touched = False
    if (x < agent.x_low and dx < 0.0) or (x > agent.x_high and dx > 0.0):
        agent.vx, dx, touched = -agent.vx, 0.0, True
    if (y < agent.y_low and dy < 0.0) or (y > agent.y_high and dy > 0.0):
        agent.vy, dy, touched = -agent.vy, 0.0, True
    at_wall, nx, ny = step_off(agent, obstacle, walls, dx, dy)
    if at_wall:
        slide(agent, nx, ny, 1.0)
    if (touched or at_wall) and bounce < 0.0:
        agent.vx = agent.vy = 0.0


@kernel
def next_waypoint(agent: Record, ways: Floats, now: int) -> bool:
    """Turn to the next waypoint, after the pause at this one; return whether there is one."""
    agent.until = now + int(ways[agent.at, 0] * 1e9)
    agent.at += 1
    if agent.at == agent.first + agent.count:
        if agent.ends == GO_ON:
            agent.at = agent.first
        else:
            agent.at -= 1
            agent.until = FOREVER
            return False
    return True


@kernel
def step_waypoints(agent: Record, obstacle: Record, ways: Floats, walls: Floats, now: int, dt: float) -> None:
    """Move straight towards the waypoint, and round the corner where it is reached within the tick."""
    left = agent.speed * dt if now > agent.until else 0.0
    x, y = obstacle.x, obstacle.y
    corners = 0
    while left > 0.0 and corners <= agent.count:
        dx, dy = ways[agent.at, 1] - x, ways[agent.at, 2] - y
        distance = np.sqrt(dx * dx + dy * dy)
        if distance > left:
            x += left * dx / distance
            y += left * dy / distance
            break
        x, y = ways[agent.at, 1], ways[agent.at, 2]
        left -= distance
        corners += 1
        if not next_waypoint(agent, ways, now) or now < agent.until:
            break
    x0, y0 = obstacle.x, obstacle.y
    step_off(agent, obstacle, walls, x - x0, y - y0)
    agent.vx, agent.vy = (obstacle.x - x0) / dt, (obstacle.y - y0) / dt


@kernel
def step_walk(agent: Record, obstacle: Record, walls: Floats, now: int, dt: float) -> None:
    """Turn towards the drawn heading and go on; where a bound or a wall is in the way, stand and turn away from it.

    At drawn times a new speed and a new heading are drawn.
    """
    if now > agent.until:
        agent.pace = between(agent.stream, agent.slowest, agent.fastest)
        agent.want = wrap(obstacle.heading + between(agent.stream, -agent.turn, agent.turn))
        agent.until = now + int(between(agent.stream, agent.least, agent.most) * 1e9)
    turned = wrap(agent.want - obstacle.heading)
    turned = min(max(turned, -agent.turn_rate * dt), agent.turn_rate * dt)
    s, c = sin_cos(obstacle.heading + 0.5 * turned)
    obstacle.heading = wrap(obstacle.heading + turned)
    obstacle.w = turned / dt
    agent.vx, agent.vy = agent.pace * c, agent.pace * s
    x0, y0 = obstacle.x, obstacle.y
    x, y = x0 + agent.vx * dt, y0 + agent.vy * dt
    away_x, away_y = agent.vx, agent.vy
    blocked = False
    if (x < agent.x_low and away_x < 0.0) or (x > agent.x_high and away_x > 0.0):
        away_x, blocked = -away_x, True
    if (y < agent.y_low and away_y < 0.0) or (y > agent.y_high and away_y > 0.0):
        away_y, blocked = -away_y, True
    if not blocked:
        blocked, nx, ny = step_off(agent, obstacle, walls, x - x0, y - y0)
        if blocked:
            into = away_x * nx + away_y * ny
            if into < 0.0:
                away_x -= 2.0 * into * nx
                away_y -= 2.0 * into * ny
            obstacle.x, obstacle.y = x0, y0
            agent.room = 0.0
    if blocked:
        if agent.pace > 0.0:
            agent.want = atan2(away_y, away_x)
        agent.vx = agent.vy = 0.0


@kernel
def step_track(agent: Record, obstacle: Record, ways: Floats, now: int) -> None:
    """Put the agent where its track is now, interpolated linearly between two rows; walls do not stop it."""
    time = (now - agent.start) * _NS
    last = agent.first + agent.count - 1
    while agent.at < last and ways[agent.at + 1, 0] <= time:
        agent.at += 1
    k = agent.at
    if agent.count == 1 or (agent.ends != GO_ON and (time < ways[agent.first, 0] or k == last)):
        obstacle.x, obstacle.y = ways[k, 1], ways[k, 2]
        agent.vx = agent.vy = 0.0
        return
    if k == last:
        k -= 1
    lasts = ways[k + 1, 0] - ways[k, 0]
    agent.vx, agent.vy = (ways[k + 1, 1] - ways[k, 1]) / lasts, (ways[k + 1, 2] - ways[k, 2]) / lasts
    obstacle.x = ways[k, 1] + agent.vx * (time - ways[k, 0])
    obstacle.y = ways[k, 2] + agent.vy * (time - ways[k, 0])
