"""No agent enters a wall: one that would is put back to where it just touches, and its velocity bent.

An agent remembers how far it can go before it can touch any wall; until it has gone as far, walls cost nothing.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.others.walls import nearest
from parcours_navigation.protocol import Floats

_TRIES = 3
_GAP = 1e-9


@kernel
def room_at(walls: Floats, x: float, y: float, radius: float) -> float:
    """Return how far a disc in (x, y) [m] can go before it can touch a wall [m]; negative where it is inside one."""
    return nearest(walls, x, y)[0] - radius


@kernel
def step_off(agent: Record, obstacle: Record, walls: Floats, dx: float, dy: float) -> tuple[bool, float, float]:
    """Move the agent by (dx, dy) [m], but not into a wall; return (touched, nx, ny): the last wall's outward normal.

    In a corner, where putting it off one wall puts it into the other, it stays where it was.
    """
    #  ─────┬─────── wall         x is where it would be, and is put back along the normal to where it touches;
    #       │ ○ ← x               in a corner this is repeated for the next wall
    #       │
    x0, y0 = obstacle.x, obstacle.y
    obstacle.x, obstacle.y = x0 + dx, y0 + dy
    agent.room -= np.sqrt(dx * dx + dy * dy)
    if agent.room > 0.0:
        return False, 0.0, 0.0
    touched, nx, ny = False, 0.0, 0.0
    for _ in range(_TRIES):
        distance, wx, wy = nearest(walls, obstacle.x, obstacle.y)
        agent.room = distance - obstacle.radius
        if agent.room >= 0.0:
            return touched, nx, ny
        touched = True
        if distance > 0.0:
            nx, ny = (obstacle.x - wx) / distance, (obstacle.y - wy) / distance
        out = _GAP - agent.room
        obstacle.x += out * nx
        obstacle.y += out * ny
    obstacle.x, obstacle.y, agent.room = x0, y0, 0.0
    return True, nx, ny


@kernel
def slide(agent: Record, nx: float, ny: float, bounce: float) -> None:
    """Take out what of the agent's velocity points into a wall with the normal (nx, ny), and throw back that share."""
    into = agent.vx * nx + agent.vy * ny
    if into < 0.0:
        agent.vx -= (1.0 + bounce) * into * nx
        agent.vy -= (1.0 + bounce) * into * ny
