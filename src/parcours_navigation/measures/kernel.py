"""Takes all MEASURES of one run, compiled, without allocation.

`table` says what each field means. An interval of no duration, two entries of the same time, counts for positions
only.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_navigation.measures.closeness import least_time_to_collision, measure_clearances
from parcours_navigation.measures.path import measure_shape, measure_way
from parcours_navigation.measures.smoothness import measure_drive, measure_halts


@kernel
def measure(
    track: Record,
    places: Record,
    radii: Record,
    robot_radius: float,
    goal_x: float,
    goal_y: float,
    goal_tolerance: float,
    t_goal: int,
    safe_distance: float,
    ground: Record,
    out: Record,
) -> None:
    """Fill `out` with the measures of one run.

    Arguments as in `one_case.measures_of`, which checks them. A track of fewer than two entries has no duration:
    integrals are 0, means NaN.
    """
    n = len(track)
    out.duration = (track[n - 1].time - track[0].time) * 1e-9 if n > 0 else 0.0
    measure_way(track, goal_x, goal_y, goal_tolerance, t_goal, out)
    measure_clearances(track, places, radii, robot_radius, safe_distance, ground, out)
    out.least_time_to_collision = least_time_to_collision(track, places, radii, robot_radius)
    measure_halts(track, out)
    measure_shape(track, out)
    measure_drive(track, out)
