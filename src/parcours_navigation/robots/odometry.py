"""What a robot believes of its own way: each tick's step with a scale error and noise, added up; the truth stays apart.

After a way s [m] and turns of t [rad] in all, scale errors are way_scale * s and turn_scale * t, and noise has grown to
way_noise * sqrt(s) and sqrt(turn_noise^2 * t + turn_noise_way^2 * s), whatever the length of a tick: a random walk, as
the odometry model of Thrun, Burgard, Fox, Probabilistic Robotics (2005), section 5.4, but for variances that add up.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import TAU, log, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours.streams import uniform


@kernel
def believe(body: Record, x: float, y: float, heading: float) -> None:
    """Add to what the body believes the step that it has done since it was in a pose [m, m, rad]."""
    if body.drifts == 0:
        body.believed_x, body.believed_y, body.believed_heading = body.x, body.y, body.heading
        return
    turn = wrap(body.heading - heading)
    dx, dy = body.x - x, body.y - y
    way = np.sqrt(dx * dx + dy * dy)
    if way == 0.0 and turn == 0.0:
        return
    s, c = sin_cos(heading + 0.5 * turn)
    ahead, aside = dx * c + dy * s, dy * c - dx * s
    # Two independent normal numbers (Box and Muller, 1958), drawn in every tick with motion.
    size = np.sqrt(-2.0 * log(1.0 - uniform(body.stream)))
    one, other = sin_cos(TAU * uniform(body.stream))
    scale = 1.0 + body.way_scale
    if way > 0.0:
        scale += body.way_noise * size * one / np.sqrt(way)
    variance = body.turn_noise * body.turn_noise * abs(turn) + body.turn_noise_way * body.turn_noise_way * way
    turn = turn * (1.0 + body.turn_scale) + np.sqrt(variance) * size * other
    s, c = sin_cos(body.believed_heading + 0.5 * turn)
    ahead, aside = ahead * scale, aside * scale
    body.believed_x += ahead * c - aside * s
    body.believed_y += ahead * s + aside * c
    body.believed_heading = wrap(body.believed_heading + turn)
