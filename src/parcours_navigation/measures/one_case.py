"""The measures of one case, from its track, which is checked first."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest
from parcours_navigation.facts import NEVER
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.published import measure_as_published
from parcours_navigation.measures.table import MEASURES, PUBLISHED
from parcours_navigation.outcomes import GOAL_TOLERANCE

SAFE_DISTANCE = 0.1
"""Gap below which time counts as unsafe unless said otherwise [m]."""


def measures_of(
    track: NDArray[np.void],
    places: ArrayLike,
    radii: ArrayLike,
    *,
    robot_radius: float,
    goal: tuple[float, float],
    goal_tolerance: float = GOAL_TOLERANCE,
    t_goal: int = NEVER,
    safe_distance: float = SAFE_DISTANCE,
    until: int | None = None,
) -> np.void:
    """Return the measures of one run, a record of MEASURES.

    Args:
        track: array of TRACK, shape (n,), times not decreasing.
        places: centres of the obstacles at the same entries [m], shape (n, n_obstacles, 2).
        radii: of the obstacles [m], shape (n_obstacles,).
        robot_radius: [m].
        goal: (x, y) [m].
        goal_tolerance: distance to the goal that counts as reached [m].
        t_goal: when the world saw the goal reached, as in the facts [ns], since a track may end a moment before; if
            NEVER, it is taken from the track.
        safe_distance: gap below which time is unsafe [m].
        until: only entries up to this time count [ns]; all if None. Give t_end of the facts to leave out what was
            watched beyond the end.

    Raises:
        BadRequest: the shapes do not fit, or times decrease.

    Example: 1 m in 2 s past an obstacle, 0.3 m to the side.

    >>> from parcours_navigation.facts import TRACK
    >>> track = np.zeros(41, TRACK)
    >>> track["time"] = np.arange(41) * 50_000_000
    >>> track["x"], track["v"] = np.linspace(0.0, 1.0, 41), 0.5
    >>> run = measures_of(track, np.tile([0.5, 0.3], (41, 1, 1)), [0.1], robot_radius=0.125, goal=(1.1, 0.0))
    >>> print(*(f"{run[name]:.3f}" for name in ("path_length", "time_to_goal", "least_clearance", "time_unsafe")))
    1.000 1.800 0.075 0.500
    """
    track, spots, sizes = _checked(track, places, radii, until)
    out = np.zeros((), MEASURES)
    x, y = goal
    radius, reach, safe = float(robot_radius), float(goal_tolerance), float(safe_distance)
    measure(track, spots, sizes, radius, float(x), float(y), reach, int(t_goal), safe, np.zeros(0), out[()])
    return cast(np.void, out[()])


def measures_as_published(
    track: NDArray[np.void],
    places: ArrayLike,
    radii: ArrayLike,
    *,
    robot_radius: float,
    goal: tuple[float, float],
    safe_distance: float = SAFE_DISTANCE,
    until: int | None = None,
) -> np.void:
    """Return what published benchmark code computes of one run, a record of PUBLISHED; arguments as in `measures_of`.

    Example: a turn on the spot by 0.08 rad, across the cut of the angle.

    >>> from parcours_navigation.facts import TRACK
    >>> track = np.zeros(2, TRACK)
    >>> track["time"], track["heading"] = [0, 50_000_000], [3.1, -3.1]
    >>> run = measures_as_published(track, np.zeros((2, 0, 2)), [], robot_radius=0.125, goal=(1.0, 0.0))
    >>> print(round(run["heading_change"], 3))
    6.2
    """
    track, spots, sizes = _checked(track, places, radii, until)
    out = np.zeros((), PUBLISHED)
    x, y = goal
    measure_as_published(track, spots, sizes, float(robot_radius), float(x), float(y), float(safe_distance), out[()])
    return cast(np.void, out[()])


def _checked(
    track: NDArray[np.void], places: ArrayLike, radii: ArrayLike, until: int | None
) -> tuple[NDArray[np.void], NDArray[np.float64], NDArray[np.float64]]:
    """Return track, places and radii up to `until`, or raise BadRequest if they do not fit together."""
    spots, sizes = np.asarray(places, dtype=np.float64), np.asarray(radii, dtype=np.float64)
    if sizes.ndim != 1 or spots.shape != (len(track), len(sizes), 2):
        rule = f"shape must be (entries, obstacles, 2) = ({len(track)}, {sizes.size}, 2), but it is {spots.shape}"
        remedy = "give one place for each entry of the track and each radius"
        raise BadRequest("obstacle places", rule, remedy, slug="places-shape")
    times = track["time"]
    steps = np.flatnonzero(times[1:] < times[:-1])
    if steps.size:
        i = int(steps[0])
        rule = f"times must not decrease, but {times[i + 1]} ns follows {times[i]} ns"
        raise BadRequest("track", rule, "sort the entries", slug="track-order")
    n = len(track) if until is None else int(np.searchsorted(times, until, side="right"))
    return track[:n], np.ascontiguousarray(spots[:n]), np.ascontiguousarray(sizes)
