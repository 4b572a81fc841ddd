"""Takes the signals of one case from its track, compiled: a row a signal, a column a sample.

The samples are the entries of the track, one every TRACK_PERIOD, and the state at the end of the case where that came
after the last entry: it stands for the sample that would have followed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import atan2, wrap
from parcours.kernels import kernel
from parcours_navigation.arena.contact import AT_REST, contact_share
from parcours_navigation.requirements.vocabulary import SIGNALS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NAMES = list(SIGNALS)
_TIME, _X, _Y, _HEADING, _SPEED, _FORWARD, _YAW_RATE, _ACCELERATION, _YAW_ACCELERATION = (
    _NAMES.index(name)
    for name in ("time", "x", "y", "heading", "speed", "forward_speed", "yaw_rate", "acceleration", "yaw_acceleration")
)
_CLEARANCE, _COLLISION, _GOAL, _ERROR, _TRAVELLED, _IMMINENT = (
    _NAMES.index(name)
    for name in ("clearance", "time_to_collision", "goal_distance", "heading_error", "travelled", "imminent")
)

# Columns of an entry of a track, as in facts.TRACK; the obstacles' x and y follow.
_ENTRY_TIME, _ENTRY_X, _ENTRY_Y, _ENTRY_HEADING, _ENTRY_V, _ENTRY_W, _ENTRY_HALTED = range(7)
_PARTS = 5  # of the way between two samples at which times to a collision are taken
_GROUND = 7  # column of the gap to the ground, where a track has one: the obstacles follow behind it
_COLUMNS = (
    (_TIME, _ENTRY_TIME), (_X, _ENTRY_X), (_Y, _ENTRY_Y), (_HEADING, _ENTRY_HEADING), (_SPEED, _ENTRY_V),
    (_FORWARD, _ENTRY_V), (_YAW_RATE, _ENTRY_W), (_IMMINENT, _ENTRY_HALTED),
)  # fmt: skip


@kernel
def _column(entries: Floats, last: Floats, n: int, column: int, out: Floats) -> None:
    """Fill out[0 .. n - 1] with a column of the samples."""
    for i in range(len(entries)):
        out[i] = entries[i, column]
    if n > len(entries):
        out[n - 1] = last[column]


@kernel
def _slope(entries: Floats, last: Floats, n: int, column: int, out: Floats) -> None:
    """Fill the change of a column since the sample before, by the time that passed [1/s]; n samples in all."""
    out[0] = 0.0
    for i in range(1, len(entries)):
        dt = (entries[i, _ENTRY_TIME] - entries[i - 1, _ENTRY_TIME]) * 1e-9
        out[i] = (entries[i, column] - entries[i - 1, column]) / dt
    k = len(entries)
    if n > k and k > 0:
        dt = (last[_ENTRY_TIME] - entries[k - 1, _ENTRY_TIME]) * 1e-9
        out[k] = (last[column] - entries[k - 1, column]) / dt


@kernel
def _clearances(
    entries: Floats, last: Floats, radii: Floats, robot_radius: float, n: int, out: Floats, aside: Floats
) -> None:  # fmt: skip
    """Fill the gap to the closest obstacle [m]; `aside` is working memory of the size of `out`."""
    first = entries.shape[1] - 2 * len(radii)
    if first > _GROUND:
        _column(entries, last, n, _GROUND, out)
    else:
        out[:n] = np.inf
    k = 0
    while k < len(radii):
        begin, same = first + 2 * k, 1
        while k + same < len(radii) and radii[k + same] == radii[k]:
            same += 1
        # Of bodies of one radius the closest has the least gap, rounding included: one root for all of them.
        for i in range(n):
            entry = entries[i] if i < len(entries) else last
            least = np.inf
            for j in range(begin, begin + 2 * same, 2):
                dx, dy = entry[j] - entry[_ENTRY_X], entry[j + 1] - entry[_ENTRY_Y]
                square = dx * dx + dy * dy
                least = square if square < least else least
            aside[i] = least
        for i in range(n):
            gap = np.sqrt(aside[i]) - radii[k] - robot_radius
            out[i] = gap if gap < out[i] else out[i]
        k += same


@kernel
def _shift(x: float, y: float, along_x: float, along_y: float, reach: float) -> float:
    """Return how far a body at (x, y) from the robot [m] is from touching it ahead, along a unit vector.

      ahead     A robot that moves causes a contact in this half. The distance to it is
      ____      - `reach` less than that to the centre for what is ahead,
     /    .     - that to the base for what is behind,
    |__o__|     - that to a corner for what is behind and aside.
    """
    ahead, aside = x * along_x + y * along_y, abs(x * along_y - y * along_x)
    if ahead >= 0.0:
        return float(np.sqrt(x * x + y * y) - reach)
    if aside <= reach:
        return float(-ahead)
    return float(np.sqrt(ahead * ahead + (aside - reach) * (aside - reach)))


@kernel
def _body_times(x0: float, y0: float, x1: float, y1: float, along_x: float, along_y: float, reach: float) -> float:
    """Return how soon a robot drives into a body that moves from (x0, y0) to (x1, y1) as seen from it [m].

    The unit is the time of that move. If they touch during it, the place where the contact begins decides who caused
    it, as in `arena.contact`: the result is negative if the robot did, and positive if the body did.
    """
    dx, dy = x1 - x0, y1 - y0
    way = np.sqrt(dx * dx + dy * dy)
    share = contact_share(x0, y0, x1, y1, reach)
    if share <= 1.0:
        return float(-((x0 + share * dx) * along_x + (y0 + share * dy) * along_y) / way)
    least, before = np.inf, _shift(x0, y0, along_x, along_y, reach)
    for k in range(1, _PARTS + 1):
        left = _shift(x0 + k / _PARTS * dx, y0 + k / _PARTS * dy, along_x, along_y, reach)
        if left < before:
            least = min(least, left / (before - left) / _PARTS)
        before = left
    return float(least)


@kernel
def _times(entries: Floats, last: Floats, radii: Floats, robot_radius: float, n: int, out: Floats) -> None:
    """Fill in how soon the robot would drive into a body or the ground [s]; infinite while it rests.

    A body that touches it already does not count.
    """
    first = entries.shape[1] - 2 * len(radii)
    out[:n] = np.inf
    for i in range(1, n):
        now = entries[i] if i < len(entries) else last
        was = entries[i - 1]
        dt = (now[_ENTRY_TIME] - was[_ENTRY_TIME]) * 1e-9
        step_x, step_y = now[_ENTRY_X] - was[_ENTRY_X], now[_ENTRY_Y] - was[_ENTRY_Y]
        step = np.sqrt(step_x * step_x + step_y * step_y)
        if step < AT_REST * dt or step == 0.0:
            continue
        if first > _GROUND and now[_GROUND] < was[_GROUND]:
            out[i] = dt * now[_GROUND] / (was[_GROUND] - now[_GROUND])
        for k in range(len(radii)):
            j, reach = first + 2 * k, robot_radius + radii[k]
            x0, y0 = was[j] - was[_ENTRY_X], was[j + 1] - was[_ENTRY_Y]
            x1, y1 = now[j] - now[_ENTRY_X], now[j + 1] - now[_ENTRY_Y]
            way = np.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
            gap = np.sqrt(x0 * x0 + y0 * y0) - reach
            if gap > 0.0 and dt * (gap - way) < out[i] * way:  # it may come sooner than others
                out[i] = min(out[i], dt * _body_times(x0, y0, x1, y1, step_x / step, step_y / step, reach))


@kernel
def _bearings(entries: Floats, last: Floats, goal_x: float, goal_y: float, n: int, out: Floats) -> None:
    """Fill the angle from the heading to the direction of the goal [rad]."""
    for i in range(len(entries)):
        bearing = atan2(goal_y - entries[i, _ENTRY_Y], goal_x - entries[i, _ENTRY_X])
        out[i] = wrap(bearing - entries[i, _ENTRY_HEADING])
    if n > len(entries):
        out[n - 1] = wrap(atan2(goal_y - last[_ENTRY_Y], goal_x - last[_ENTRY_X]) - last[_ENTRY_HEADING])


@kernel
def _goal_distances(entries: Floats, last: Floats, goal_x: float, goal_y: float, n: int, out: Floats) -> None:
    """Fill the distance to the goal [m]."""
    for i in range(len(entries)):
        dx, dy = goal_x - entries[i, _ENTRY_X], goal_y - entries[i, _ENTRY_Y]
        out[i] = np.sqrt(dx * dx + dy * dy)
    if n > len(entries):
        dx, dy = goal_x - last[_ENTRY_X], goal_y - last[_ENTRY_Y]
        out[n - 1] = np.sqrt(dx * dx + dy * dy)


@kernel
def _ways(entries: Floats, last: Floats, n: int, out: Floats) -> None:
    """Fill the length of the way so far [m]."""
    way = 0.0
    out[0] = way
    for i in range(1, len(entries)):
        dx, dy = entries[i, _ENTRY_X] - entries[i - 1, _ENTRY_X], entries[i, _ENTRY_Y] - entries[i - 1, _ENTRY_Y]
        way += np.sqrt(dx * dx + dy * dy)
        out[i] = way
    k = len(entries)
    if n > k and k > 0:
        dx, dy = last[_ENTRY_X] - entries[k - 1, _ENTRY_X], last[_ENTRY_Y] - entries[k - 1, _ENTRY_Y]
        out[k] = way + np.sqrt(dx * dx + dy * dy)


@kernel
def take(
    entries: Floats, last: Floats, radii: Floats, robot_radius: float, goal_x: float, goal_y: float, wanted: Ints,
    memory: Floats,
) -> int:  # fmt: skip
    """Fill the rows of the wanted signals, and return how many samples there are.

    Args:
        entries: of the track, times increasing, shape (n, 7 + 2 n_obstacles) or one column more: the fields of TRACK,
            the gap between robot and ground [m] if there is one, the obstacles' x, y.
        last: the state at the end of the case, laid out in the same way; counts if it is later than the last entry.
        radii: of the obstacles [m], shape (n_obstacles,).
        robot_radius, goal_x, goal_y: [m].
        wanted: 1 for the signals to take, in the order of SIGNALS.
        memory: receives them; its last row is working memory. Shape (more than len(SIGNALS), at least n + 1).
    """
    n = len(entries)
    if n == 0 or last[_ENTRY_TIME] > entries[n - 1, _ENTRY_TIME]:
        n += 1
    for signal, column in _COLUMNS:
        if wanted[signal]:
            _column(entries, last, n, column, memory[signal])
    if wanted[_TIME]:
        for i in range(n):
            memory[_TIME, i] *= 1e-9
    if wanted[_SPEED]:
        for i in range(n):
            memory[_SPEED, i] = abs(memory[_SPEED, i])
    if wanted[_IMMINENT]:
        for i in range(n):
            memory[_IMMINENT, i] = 1.0 if memory[_IMMINENT, i] > 0.0 else -1.0
    if wanted[_ACCELERATION]:
        _slope(entries, last, n, _ENTRY_V, memory[_ACCELERATION])
    if wanted[_YAW_ACCELERATION]:
        _slope(entries, last, n, _ENTRY_W, memory[_YAW_ACCELERATION])
    if wanted[_CLEARANCE]:
        _clearances(entries, last, radii, robot_radius, n, memory[_CLEARANCE], memory[-1])
    if wanted[_COLLISION]:
        _times(entries, last, radii, robot_radius, n, memory[_COLLISION])
    if wanted[_GOAL]:
        _goal_distances(entries, last, goal_x, goal_y, n, memory[_GOAL])
    if wanted[_ERROR]:
        _bearings(entries, last, goal_x, goal_y, n, memory[_ERROR])
    if wanted[_TRAVELLED]:
        _ways(entries, last, n, memory[_TRAVELLED])
    return n
