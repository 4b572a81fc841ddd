"""The metrics of one run, as data: name, unit, definition and source of each; the two record layouts follow from it.

MEASURES holds each metric in SI units as it is defined; PUBLISHED holds what published benchmark code computes for the
same run, its defects included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPACING = 0.05
"""Least distance between the points that carry a curvature [m]: nearer samples are skipped, so rest has none."""

REST_SPEED = 0.01
"""Below this speed [m/s] the robot does not move (HuNavSim)."""

REST_TURN = 0.02
"""Below this yaw rate [rad/s] the robot does not turn (HuNavSim)."""

SET_OUT = 0.1
"""Distance from the start at which the robot has set out [m] (BARN)."""

INTIMATE, PERSONAL, SOCIAL = 0.45, 1.2, 3.6
"""Outer gaps of the proxemic zones [m] (HuNavSim)."""

TOUCH = 0.02
"""Gap below which HuNavSim's evaluator counts a collision [m]; its README says 0.01 m."""


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of one run."""

    name: str  # field of the record
    unit: str  # SI unit; "1" for a share or a count
    definition: str  # how it is computed, in words
    source: str  # the benchmark or paper it comes from; "ours" if from none


METRICS = (
    Metric("duration", "s", "last entry minus first entry of the track", "MRPB: motion efficiency"),
    Metric(
        "time_to_goal",
        "s",
        "until the world, else the chords, first met the goal tolerance; NaN if never",
        "BARN, HuNavSim",
    ),
    Metric("time_to_set_out", "s", "until the robot is first 0.1 m from its start; NaN if never", "BARN"),
    Metric("goal_distance", "m", "from the last entry to the goal", "HuNavSim"),
    Metric("least_goal_distance", "m", "least distance from the chords to the goal", "HuNavSim"),
    Metric("path_length", "m", "sum of the chords", "Arena, HuNavSim, Bench-MR"),
    Metric("displacement", "m", "from the first entry to the goal", "SocNavBench"),
    Metric("mean_speed", "m/s", "integral of |v| over the duration", "HuNavSim"),
    Metric(
        "time_at_rest", "s", "where |v| < 0.01 m/s and |w| < 0.02 rad/s, each entry held until the next", "HuNavSim"
    ),
    Metric("mean_clearance", "m", "integral of the closest gap over the duration", "HuNavSim, Bench-MR"),
    Metric("least_clearance", "m", "least of the closest gaps at the entries; the exact one is in FACTS", "HuNavSim"),
    Metric("time_unsafe", "s", "closest gap below the safety distance, open intervals included", "MRPB"),
    Metric("time_intimate", "s", "closest gap below 0.45 m", "HuNavSim (Hall)"),
    Metric("time_personal", "s", "closest gap from 0.45 to 1.2 m", "HuNavSim (Hall)"),
    Metric("time_social", "s", "closest gap from 1.2 to 3.6 m", "HuNavSim (Hall)"),
    Metric(
        "least_time_to_collision",
        "s",
        "least over the entries of the time to contact if both went on with their mean velocity of the interval that"
        " follows; 0 in overlap, inf if they never met",
        "ours",
    ),
    Metric("time_halted", "s", "imminent collision signalled, each entry held until the next", "ours"),
    Metric("longest_halt", "s", "the longest stretch of it", "ours"),
    Metric("stop_distance", "m", "most way covered in one such stretch", "ours"),
    Metric("heading_change", "rad", "sum of |heading change|, each brought into [-pi, pi)", "HuNavSim: CHC"),
    Metric("needed_turn", "rad", "|angle| from the first heading to the goal", "SocNavBench"),
    Metric(
        "mean_curvature",
        "1/m",
        "Menger curvature 4 A / (a b c) of consecutive points at least 0.05 m apart, weighted by (a + b) / 2; NaN with"
        " fewer than three such points",
        "Arena, Bench-MR",
    ),
    Metric("max_curvature", "1/m", "the greatest of them; NaN likewise", "Bench-MR"),
    Metric("roughness", "1", "mean of 2 A / c^2 over the same triples; 0 where c is 0; NaN likewise", "Arena"),
    Metric("smoothness", "m/s^2", "mean over the intervals of |change of v| / dt", "MRPB"),
    Metric("squared_acceleration", "m^2/s^3", "integral of a^2, a constant in each interval", "ours"),
    Metric("squared_yaw_acceleration", "rad^2/s^3", "the same of w", "ours"),
    Metric("squared_jerk", "m^2/s^5", "integral of j^2, j the slope of a between the middles of intervals", "ours"),
    Metric("squared_yaw_jerk", "rad^2/s^5", "the same of w", "ours"),
    Metric("mean_jerk", "m/s^3", "mean of |j| over the time between the first and last middle", "HuNavSim"),
)
"""What `measure` fills in, in the order of MEASURES."""

AS_PUBLISHED = (
    Metric("time_unsafe", "s", "last minus first unsafe sample of each stretch that ended before the log", "MRPB"),
    Metric("heading_change", "rad", "sum of |difference of headings in [-pi, pi)|, not wrapped", "Arena"),
    Metric("acceleration", "m/s", "mean |change of |v|| from sample to sample, not divided by dt", "Arena"),
    Metric("jerk", "m/s", "mean |second difference of |v||, not divided by dt", "Arena"),
    Metric("curvature", "1/m", "mean of 4 A / (a b c) over all consecutive samples, 0 where a b c = 0", "Arena"),
    Metric("normalised_curvature", "1", "mean of the same times (a + b)", "Arena"),
    Metric("roughness", "1", "mean of 2 A / c^2 over all consecutive samples; NaN if the robot ever rests", "Arena"),
    Metric("n_contacts", "1", "samples in contact whose predecessor was not; contact in the first is missed", "Arena"),
    Metric("mean_gap", "m", "mean over samples of the closest gap, at least 0", "HuNavSim: CP_avg"),
    Metric("least_gap", "m", "least of them", "HuNavSim: CP_min"),
    Metric("intimate", "%", "samples with that gap below 0.45 m", "HuNavSim"),
    Metric("personal", "%", "samples with that gap in [0.45, 1.2) m", "HuNavSim"),
    Metric("social", "%", "samples with that gap in [1.2, 3.6) m", "HuNavSim"),
    Metric("n_touches", "1", "pairs of sample and person with a gap below 0.02 m", "HuNavSim: collisions"),
    Metric("time_at_rest", "s", "duration times the share of samples with v < 0.01 and w < 0.02, signed", "HuNavSim"),
    Metric("mean_acceleration", "m/s^2", "sum of |change of v| / dt, divided by samples, not intervals", "HuNavSim"),
    Metric("overacceleration", "m/s^3", "sum of |change of v| / dt^2, divided by samples: an acceleration", "HuNavSim"),
    Metric("irregularity", "rad", "mean angle from the position vector, not the heading, to the goal", "SocNavBench"),
    Metric("length_ratio", "1", "length / displacement, the inverse of its docstring", "SocNavBench"),
)
"""What `measure_as_published` fills in, in the order of PUBLISHED."""

_DOUBLE = {
    "duration", "time_to_goal", "time_to_set_out", "displacement", "time_at_rest", "time_halted", "longest_halt",
    "needed_turn",
}  # fmt: skip
"""Metrics that are multiples of the track's period, or given: a rule may ask for such a number to its last digit."""

MEASURES = np.dtype([(metric.name, "f8" if metric.name in _DOUBLE else "f4") for metric in METRICS])
"""The metrics of one run as they are defined, in single precision (seven digits) unless their values are round: double
precision would take a third more of a campaign's folder for digits that no sensor and no rule can tell apart."""

PUBLISHED = np.dtype([(metric.name, "f8") for metric in AS_PUBLISHED])
"""The metrics of one run as published code computes them."""
