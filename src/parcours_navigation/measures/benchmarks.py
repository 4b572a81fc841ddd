"""The scores of published benchmarks over many runs, corrected, or as their code computes them.

A new benchmark is one function and one entry of BENCHMARKS.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import require_known
from parcours_navigation.measures.scores import Benchmark, Runs, ScoreColumn, Values, require_positive, sct, spl

DYNABARN_PATH = -31.0
"""The path length that BARN's runner computes for every moving-obstacle world: goal -20 minus start 11 [m]."""

_BARN_CLIPS = {"present": (2.0, 8.0), "2022": (4.0, 8.0), "dynabarn-2022": (2.0, 8.0)}


def barn(
    success: ArrayLike, taken: ArrayLike, shortest: ArrayLike, mode: str = "present", top_speed: float = 2.0
) -> Values:
    """Return the BARN challenge's score of each run, S OT / clip(AT, low OT, high OT), shape (n,).

    Args:
        success: S, truth values, shape (n,).
        taken: AT, from setting out to the goal [s], shape (n,); where it failed, anything.
        shortest: length of the world's path [m], shape (n,); OT is this at `top_speed`.
        mode: "present" clips to 2..8 OT (at most 0.5), "2022" to 4..8 OT (at most 0.25); "dynabarn-2022" takes the
            path length for -31 m, so that every success scores 0.125.
        top_speed: [m/s].

    Raises:
        BadRequest: the mode is unknown, or a path length is not positive.

    >>> [barn([True, True], [12.0, 30.0], [10.0, 10.0], mode).round(3).tolist() for mode in ("present", "2022")]
    [[0.417, 0.167], [0.25, 0.167]]
    """
    require_known(mode, list(_BARN_CLIPS), "BARN mode", slug="unknown-score-mode")
    low, high = _BARN_CLIPS[mode]
    lengths = np.asarray(shortest, np.float64)
    require_positive("BARN", lengths)
    if mode == "dynabarn-2022":
        lengths = np.full_like(lengths, DYNABARN_PATH)
    best = lengths / top_speed
    # numpy's clip with low > high gives high, as in the published code
    score = best / np.clip(np.asarray(taken, np.float64), low * best, high * best)
    return np.where(np.asarray(success, bool), score, 0.0)


Table = dict[str, Values]
"""Columns of a benchmark: "name [unit]" -> one value a run."""


def _spl_and_sct(runs: Runs, mode: str) -> Table:
    """Return SPL, and SCT where the fastest times are known."""
    found = {"SPL [1]": spl(runs.success, runs.needed("shortest"), runs.facts["travelled"])}
    return found if runs.fastest is None else found | {"SCT [1]": sct(runs.success, runs.fastest, runs.time_to_goal)}


def _barn(runs: Runs, mode: str) -> Table:
    """Return the columns of BARN's report."""
    taken = runs.time_to_goal - runs.measures["time_to_set_out"]
    timely = runs.success & ~(taken >= 100.0)
    return {
        "score [1]": barn(timely, taken, runs.needed("shortest"), mode, runs.top_speed),
        "success [1]": timely,
        "collision [1]": runs.touched,
        "timeout [1]": ~timely & ~runs.touched,
        "time [s]": np.where(timely, taken, np.nan),
    }


def _mrpb(runs: Runs, mode: str) -> Table:
    """Return MRPB's four metrics; the computing time where it is known."""
    m = runs.measures
    unsafe = runs.needed("published")["time_unsafe"] if mode == "mrpb-2021" else m["time_unsafe"]
    found = {
        "safety [%]": 100.0 * _ratio(unsafe, m["duration"]),
        "motion efficiency [s]": m["duration"],
        "smoothness [m/s^2]": m["smoothness"],
    }
    if runs.planning_time is not None:
        found["computational efficiency [ms]"] = 1e3 * runs.planning_time
    return found


def _arena(runs: Runs, mode: str) -> Table:
    """Return Arena's results and metrics."""
    m, f = runs.measures, runs.facts
    if mode == "arena-evaluation":
        p = runs.needed("published")
        late = m["duration"] >= 180.0
        hit = ~late & (p["n_contacts"] >= 3)
        reached = ~late & ~hit
        angle, curvature, rough = p["heading_change"], p["curvature"], p["roughness"]
        last = {"acceleration [m/s]": p["acceleration"], "jerk [m/s]": p["jerk"]}
    else:
        hit = _contacts(f) >= 3
        reached = runs.arrived & ~hit & (f["t_goal"] < 180e9)
        late = ~hit & ~reached
        angle, curvature, rough = m["heading_change"], m["mean_curvature"], m["roughness"]
        last = {"acceleration [m/s^2]": m["smoothness"], "jerk [m/s^3]": m["mean_jerk"]}
    return {
        "goal reached [1]": reached,
        "collision [1]": hit,
        "timeout [1]": late,
        "time [s]": m["duration"],
        "path length [m]": m["path_length"],
        "angle over length [rad/m]": _ratio(angle, m["path_length"]),
        "curvature [1/m]": curvature,
        "roughness [1]": rough,
        **last,
    }


def _hunavsim(runs: Runs, mode: str) -> Table:
    """Return HuNavSim's metrics that need no social force."""
    m, f = runs.measures, runs.facts
    if mode == "hunav-evaluator":
        p = runs.needed("published")
        completed = m["goal_distance"] - runs.goal_tolerance < 0.3
        time, mean_gap, least_gap = m["duration"], p["mean_gap"], p["least_gap"]
        zones = [p["intimate"], p["personal"], p["social"]]
        touches, rest = p["n_touches"], p["time_at_rest"]
        acceleration, jerk = p["mean_acceleration"], p["overacceleration"]
    else:
        completed = runs.arrived
        time, mean_gap, least_gap = runs.time_to_goal, m["mean_clearance"], f["min_clearance"]
        times = (m["time_intimate"], m["time_personal"], m["time_social"])
        zones = [100.0 * _ratio(t, m["duration"]) for t in times]
        touches = _contacts(f)
        rest, acceleration, jerk = m["time_at_rest"], m["smoothness"], m["mean_jerk"]
    return {
        "completed [1]": completed,
        "time to goal [s]": time,
        "path length [m]": m["path_length"],
        "cumulative heading changes [rad]": m["heading_change"],
        "average closest person [m]": mean_gap,
        "minimum distance to people [m]": least_gap,
        "intimate space [%]": zones[0],
        "personal space [%]": zones[1],
        "social space [%]": zones[2],
        "collisions [1]": touches,
        "time not moving [s]": rest,
        "minimum distance to target [m]": m["least_goal_distance"],
        "final distance to target [m]": m["goal_distance"],
        "average acceleration [m/s^2]": acceleration,
        "average overacceleration [m/s^3]": jerk,
    }


def _socnavbench(runs: Runs, mode: str) -> Table:
    """Return SocNavBench's two metrics of the path."""
    m = runs.measures
    if mode == "socnavbench-code":
        p = runs.needed("published")
        return {"path length ratio [1]": p["length_ratio"], "path irregularity [rad]": p["irregularity"]}
    ratio, unneeded = _ratio(m["displacement"], m["path_length"]), m["heading_change"] - m["needed_turn"]
    irregularity = _ratio(np.maximum(unneeded, 0.0), m["path_length"])
    return {"path length ratio [1]": ratio, "path irregularity [rad/m]": irregularity}


def _bench_mr(runs: Runs, mode: str) -> Table:
    """Return Bench-MR's metrics of the path."""
    m = runs.measures
    found = {
        "path length [m]": m["path_length"],
        "angle over length [rad/m]": _ratio(m["heading_change"], m["path_length"]),
        "max curvature [1/m]": m["max_curvature"],
        "clearing [m]": m["mean_clearance"],
    }
    if mode == "bench-mr-code":
        return found
    return found | {"least clearance [m]": runs.facts["min_clearance"], "mean jerk [m/s^3]": m["mean_jerk"]}


def _contacts(facts: NDArray[np.void]) -> NDArray[np.int64]:
    """Return all contacts of each run, no matter who caused them."""
    return np.asarray(facts["n_robot_contacts"] + facts["n_shared_contacts"] + facts["n_obstacle_contacts"])


def _ratio(above: Values, below: Values) -> Values:
    """Return above / below, NaN where below is 0."""
    shares: Values = np.divide(above, below, out=np.full(above.shape, np.nan), where=below > 0.0)
    return shares


BENCHMARKS = {
    "spl": Benchmark(
        _spl_and_sct,
        {"corrected": "as defined; success is the goal reached without contact"},
        "Anderson et al. 2018; Yokoyama, Ha and Batra, IROS 2021",
    ),
    "barn": Benchmark(
        _barn,
        {
            "present": "clip(AT, 2 OT, 8 OT): at most 0.5",
            "2022": "clip(AT, 4 OT, 8 OT): at most 0.25",
            "dynabarn-2022": "path length is goal minus start, -31 m, in every moving-obstacle world: 0.125 for every"
            " success, whatever the time",
        },
        "BARN challenge, run.py and report_test.py",
    ),
    "mrpb": Benchmark(
        _mrpb,
        {
            "corrected": "unsafe time with its crossings interpolated and open stretches included",
            "mrpb-2021": "an unsafe stretch still open at the end of the log, or of one sample, counts nothing",
        },
        "Wen et al., MRPB 1.0, ICRA 2021, metrics.cpp",
    ),
    "arena": Benchmark(
        _arena,
        {
            "corrected": "the goal must be reached; SI units; headings wrapped; curvature of points 0.05 m apart",
            "arena-evaluation": "any run under 180 s with fewer than 3 collisions is GOAL_REACHED; acceleration and"
            " jerk are not divided by dt; heading differences are not wrapped; a rest makes roughness NaN",
        },
        "Arena-Rosnav, evaluation scripts",
    ),
    "hunavsim": Benchmark(
        _hunavsim,
        {
            "corrected": "time to goal only if reached; contacts of the world; rest by |w|; jerk of the acceleration",
            "hunav-evaluator": "time to goal is the log's length; completed within the goal radius + 0.3 m; every"
            " sample within 0.02 m is a collision; turning clockwise on the spot is not moving;"
            " overacceleration is |a| / dt",
        },
        "Perez-Higueras et al., HuNavSim, RA-L 2023, hunav_evaluator",
    ),
    "socnavbench": Benchmark(
        _socnavbench,
        {
            "corrected": "ratio is displacement over length; irregularity is unneeded turning over length",
            "socnavbench-code": "ratio is length over displacement; irregularity is the angle from the position vector"
            " to the goal, so it depends on the origin of the map",
        },
        "Biswas et al., SocNavBench, THRI 2022, cost_functions.py",
    ),
    "bench-mr": Benchmark(
        _bench_mr,
        {
            "corrected": "least clearance and jerk beside the rest",
            "bench-mr-code": "clearing is the mean, so a near miss is averaged away; jerk is compiled out",
        },
        "Heiden et al., Bench-MR, RA-L 2021",
    ),
}
"""The benchmarks by name."""


def score(runs: Runs, benchmark: str, mode: str | None = None) -> tuple[ScoreColumn, ...]:
    """Return the columns of a benchmark for the runs.

    `mode` is one of its modes: by default the first, which is free of the known defects. Raises BadRequest if benchmark
    or mode is unknown, or the runs lack an array that is needed.

    >>> from parcours_navigation.facts import FACTS, NEVER
    >>> from parcours_navigation.measures import MEASURES
    >>> facts, measures = np.zeros(2, FACTS), np.zeros(2, MEASURES)
    >>> facts["t_goal"], facts["t_contact"], facts["travelled"] = [9_000_000_000, NEVER], NEVER, 4.0
    >>> [column] = score(Runs(facts, measures, shortest=np.array([3.0, 3.0])), "spl")
    >>> column.values.tolist(), column.mean
    ([0.75, 0.0], 0.375)
    """
    require_known(benchmark, list(BENCHMARKS), "benchmark", slug="unknown-benchmark")
    chosen = BENCHMARKS[benchmark]
    names = list(chosen.modes)
    if mode is not None:
        require_known(mode, names, f"mode of {benchmark}", slug="unknown-score-mode")
    found = chosen.score(runs, mode or names[0])
    heads = (head.removesuffix("]").split(" [") for head in found)
    return tuple(
        ScoreColumn(name, unit, values.astype(np.float64))
        for (name, unit), values in zip(heads, found.values(), strict=True)
    )
