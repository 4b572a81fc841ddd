"""People by social force: the accelerations that a person feels.

The equation of motion and the driving term are those of Helbing and Molnar, Social force model for pedestrian dynamics
(Physical Review E 51, 1995, eqs. 1 to 3 and 12); interaction and walls are measured ones: Moussaid, Helbing, Garnier,
Johansson, Combe, Theraulaz, Experimental study of the behavioural mechanisms underlying self-organization in human
crowds (Proceedings of the Royal Society B 276, 2009). A group is held together as in Moussaid, Perozo, Garnier,
Helbing, Theraulaz, The walking behaviour of pedestrian social groups (PLoS ONE 5, 2010). Bodies in contact are pushed
apart by the spring of Helbing, Farkas, Vicsek, Simulating dynamical features of escape panic (Nature 407, 2000), at
every tick, without its friction.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, exp
from parcours.kernels import Record, kernel

TWO_PEOPLE = 0.5
"""Sum of the radii of two people of the experiment, whose distances are between centres [m]; bodies that are wider
together are taken to be nearer by the rest. Ours."""

_SAME = 1e-9
_FADED = 12.0


@kernel
def _fading(x: float) -> float:
    """Return exp(-x), and 0 where that is below 6e-6: of 4.5 m/s2 nobody feels so little, and exp takes time."""
    return exp(-x) if x < _FADED else 0.0


@kernel
def interaction(agent: Record, dx: float, dy: float, dvx: float, dvy: float, reach: float) -> tuple[float, float]:
    """Return the acceleration (x, y) [m/s2] that a person feels from somebody (dx, dy) [m] away.

    (dvx, dvy) is the person's velocity less the other's [m/s], `reach` the sum of their radii [m].
    """
    #   o ─ ─ ─ ─▸ t    t is the direction of interaction, lambda (v_i - v_j) + e; the person slows down against t and
    #    \ theta        turns aside at right angles to it, away from the other: both fade with the distance, and with
    #     \             theta, the sooner the faster they near each other (B = gamma |t|)
    #      ● e
    distance = np.sqrt(dx * dx + dy * dy)
    if distance < _SAME:
        return -agent.strength, 0.0
    ex, ey = dx / distance, dy / distance
    tx, ty = agent.ahead * dvx + ex, agent.ahead * dvy + ey
    length = np.sqrt(tx * tx + ty * ty)
    if length < _SAME:
        return 0.0, 0.0
    tx, ty = tx / length, ty / length
    b = agent.range * length
    distance = max(distance - max(reach - TWO_PEOPLE, 0.0), 0.0)
    if distance > _FADED * b:
        return 0.0, 0.0
    theta = atan2(tx * ey - ty * ex, tx * ex + ty * ey) + b * agent.side
    slow, aside = agent.slowing * b * theta, agent.turning * b * theta
    slowing = agent.strength * _fading(distance / b + slow * slow)
    turning = agent.strength * _fading(distance / b + aside * aside)
    if theta < 0.0:
        turning = -turning
    return -slowing * tx + turning * ty, -slowing * ty - turning * tx


@kernel
def contact(stiffness: float, dx: float, dy: float, reach: float) -> tuple[float, float]:
    """Return the acceleration (x, y) [m/s2] by which a body (dx, dy) [m] away pushes if nearer than `reach`."""
    square = dx * dx + dy * dy
    if square >= reach * reach:
        return 0.0, 0.0
    distance = np.sqrt(square)
    if distance < _SAME:
        return stiffness * reach, 0.0
    push = stiffness * (reach - distance) / distance
    return -push * dx, -push * dy


@kernel
def wall_force(agent: Record, dx: float, dy: float, radius: float) -> tuple[float, float]:
    """Return the acceleration (x, y) [m/s2] away from a wall whose nearest point is (dx, dy) [m] away.

    It fades with the distance from the body's border: `radius` is the body's, with the wall's thickness [m].
    """
    distance = np.sqrt(dx * dx + dy * dy)
    if distance < _SAME:
        return 0.0, 0.0
    size = agent.wall_strength * _fading(max((distance - radius) / agent.wall_range, -3.0)) / distance
    return -size * dx, -size * dy


@kernel
def drive_force(agent: Record, wish_x: float, wish_y: float) -> tuple[float, float]:
    """Return the acceleration (x, y) [m/s2] that takes on the wanted velocity [m/s] within the time `relax`."""
    return (wish_x - agent.vx) / agent.relax, (wish_y - agent.vy) / agent.relax


@kernel
def group_force(agent: Record, dx: float, dy: float, size: int) -> tuple[float, float]:
    """Return the pull (x, y) [m/s2] towards the middle of a group of that size, which is (dx, dy) [m] away.

    Members nearer to it than half a metre for each companion feel nothing.
    """
    distance = np.sqrt(dx * dx + dy * dy)
    if distance <= 0.5 * (size - 1) or distance < _SAME:
        return 0.0, 0.0
    return agent.cohesion * dx / distance, agent.cohesion * dy / distance
