"""The compiled measures against naive twins on random runs, and what may not change them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours_navigation.facts import TRACK
from parcours_navigation.measures import AS_PUBLISHED, MEASURES, METRICS, PUBLISHED, measures_as_published, measures_of

Floats = NDArray[np.float64]
RADII = np.array([0.1, 0.15, 0.05])
GOAL = (0.3, 0.1)
ROBOT = 0.125


def random_run(seed: int, n: int = 200) -> tuple[NDArray[np.void], Floats]:
    """A robot that drives, turns and halts at random among obstacles, at uneven times; with odd seeds it also rests."""
    rng = np.random.default_rng(seed)
    rests = 0.3 * (seed % 2)
    track = np.zeros(n, TRACK)
    dt = rng.uniform(0.02, 0.08, n)
    track["time"] = np.cumsum(np.round(dt * 1e9)).astype(np.int64)
    v = np.cumsum(rng.normal(0, 0.05, n)) * (rng.random(n // 20).repeat(20) > rests)
    w = np.cumsum(rng.normal(0, 0.1, n)) * (rng.random(n // 20).repeat(20) > rests)
    track["v"], track["w"], track["halted"] = v, w, rng.random(n // 10).repeat(10) < 0.2
    heading = np.cumsum(w * dt)
    track["heading"] = (heading + np.pi) % (2 * np.pi) - np.pi
    track["x"], track["y"] = np.cumsum(v * np.cos(heading) * dt), np.cumsum(v * np.sin(heading) * dt)
    reach = 5.0 if seed == 5 else 2.0
    start, velocity = rng.uniform(-reach, reach, (1, 3, 2)), rng.normal(0, 0.2, (1, 3, 2))
    return track, start + velocity * (track["time"] * 1e-9)[:, None, None]


def gaps(track: NDArray[np.void], places: Floats) -> Floats:
    """Gaps to every obstacle, shape (n, 3)."""
    offset = places - np.stack([track["x"], track["y"]], -1)[:, None]
    return np.asarray(np.hypot(offset[..., 0], offset[..., 1]) - RADII - ROBOT)


def turned(angle: Floats) -> Floats:
    """The angles brought into [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def below(limit: float, gap: Floats, t: Floats) -> float:
    """Time below a limit by counting a thousand points an interval."""
    share = (np.arange(1000) + 0.5) / 1000
    dense = gap[:-1, None] + share * (gap[1:] - gap[:-1])[:, None]
    return float(np.sum(np.mean(dense < limit, 1) * np.diff(t)))


def first_contact(x: Floats, velocity: Floats, reach: float) -> float:
    """When |x + velocity t| first is `reach`, from now on, by numpy's roots; inf if never."""
    roots = np.roots([velocity @ velocity, 2 * x @ velocity, x @ x - reach * reach])
    real = [float(r.real) for r in roots if abs(r.imag) < 1e-12 and r.real >= 0.0]
    return min(real, default=math.inf)


def menger(p: Floats, q: Floats, r: Floats) -> float:
    """One over the radius of the circle through three points, by its centre."""
    matrix = np.array([q - p, r - p])
    if abs(np.linalg.det(matrix)) < 1e-15:
        return 0.0
    centre = np.linalg.solve(2 * matrix, np.array([(q - p) @ (q + p), (r - p) @ (r + p)]))
    return float(1 / np.linalg.norm(p - centre))


def naive(track: NDArray[np.void], places: Floats) -> dict[str, float]:
    """The measures, as plainly as numpy allows."""
    t, v, w = track["time"] * 1e-9, track["v"], track["w"]
    p = np.stack([track["x"], track["y"]], -1)
    dt, chords = np.diff(t), np.linalg.norm(np.diff(p, axis=0), axis=1)
    gap = gaps(track, places).min(1)
    a, yaw, middle = np.diff(v) / dt, np.diff(w) / dt, (t[1:] + t[:-1]) / 2
    jerk, yaw_jerk, between = np.diff(a) / np.diff(middle), np.diff(yaw) / np.diff(middle), np.diff(middle)
    goal = np.array(GOAL)
    relative = places - p[:, None]
    velocity = np.diff(relative, axis=0) / dt[:, None, None]
    contacts = [
        first_contact(relative[i, k], velocity[i, k], RADII[k] + ROBOT) for i in range(len(dt)) for k in range(3)
    ]
    halts, ways, stretch, way = [0.0], [0.0], 0.0, 0.0
    for i in range(len(dt)):
        stretch, way = (stretch + dt[i], way + chords[i]) if track["halted"][i] else (0.0, 0.0)
        halts.append(stretch)
        ways.append(way)
    kept = [p[0]]
    for point in p:
        if np.linalg.norm(point - kept[-1]) >= 0.05:
            kept.append(point)
    triples = list(zip(kept, kept[1:], kept[2:], strict=False))
    curvatures = np.array([menger(*triple) for triple in triples])
    weights = np.array([np.linalg.norm(q - p) + np.linalg.norm(r - q) for p, q, r in triples])
    heights = [abs(np.linalg.det(np.array([q - p, r - p]))) / ((r - p) @ (r - p)) for p, q, r in triples]
    dense = (p[:-1, None] + np.linspace(0, 1, 2001)[:, None] * np.diff(p, axis=0)[:, None]).reshape(-1, 2)
    dense_t = (t[:-1, None] + np.linspace(0, 1, 2001) * dt[:, None]).ravel() - t[0]
    near, away = np.linalg.norm(dense - goal, axis=1), np.linalg.norm(dense - p[0], axis=1)
    speed = np.abs(v[:-1, None] + (np.arange(1000) + 0.5) / 1000 * np.diff(v)[:, None]).mean(1)
    rest = (np.abs(v[:-1]) < 0.01) & (np.abs(w[:-1]) < 0.02)
    return {
        "duration": t[-1] - t[0],
        "time_to_goal": dense_t[np.argmax(near <= 0.2)] if np.any(near <= 0.2) else math.nan,
        "time_to_set_out": dense_t[np.argmax(away >= 0.1)] if np.any(away >= 0.1) else math.nan,
        "goal_distance": math.dist(p[-1], goal),
        "least_goal_distance": near.min(),
        "path_length": chords.sum(),
        "displacement": math.dist(p[0], goal),
        "mean_speed": speed @ dt / (t[-1] - t[0]),
        "time_at_rest": dt[rest].sum(),
        "mean_clearance": np.trapezoid(gap, t) / (t[-1] - t[0]),
        "least_clearance": gap.min(),
        "time_unsafe": below(0.1, gap, t),
        "time_intimate": below(0.45, gap, t),
        "time_personal": below(1.2, gap, t) - below(0.45, gap, t),
        "time_social": below(3.6, gap, t) - below(1.2, gap, t),
        "least_time_to_collision": 0.0 if gap.min() < 0 else min(contacts),
        "time_halted": dt[track["halted"][:-1] == 1].sum(),
        "longest_halt": max(halts),
        "stop_distance": max(ways),
        "heading_change": np.abs(turned(np.diff(track["heading"]))).sum(),
        "needed_turn": abs(turned(np.arctan2(*(goal - p[0])[::-1]) - track["heading"][0])),
        "mean_curvature": curvatures @ weights / weights.sum() if triples else math.nan,
        "max_curvature": curvatures.max() if triples else math.nan,
        "roughness": float(np.mean(heights)) if triples else math.nan,
        "smoothness": np.abs(a).mean(),
        "squared_acceleration": a**2 @ dt,
        "squared_yaw_acceleration": yaw**2 @ dt,
        "squared_jerk": jerk**2 @ between,
        "squared_yaw_jerk": yaw_jerk**2 @ between,
        "mean_jerk": np.abs(jerk) @ between / between.sum(),
    }


def naive_as_published(track: NDArray[np.void], places: Floats) -> dict[str, float]:
    """What published code computes, in plain numpy."""
    t, v, n = track["time"] * 1e-9, track["v"], len(track)
    p = np.stack([track["x"], track["y"]], -1)
    gap = gaps(track, places).min(1)
    floored, dt, dv = np.maximum(gap, 0.0), np.diff(t), np.abs(np.diff(v))
    unsafe = np.concatenate([[False], gap < 0.1, [False]]).astype(int)
    first, after = np.flatnonzero(np.diff(unsafe) == 1), np.flatnonzero(np.diff(unsafe) == -1)
    a, b, c = p[1:-1] - p[:-2], p[2:] - p[1:-1], p[2:] - p[:-2]
    doubled = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    la, lb, lc = (np.hypot(side[:, 0], side[:, 1]) for side in (a, b, c))
    curvature = np.divide(2 * doubled, la * lb * lc, out=np.zeros(n - 2), where=la * lb * lc > 0)
    to_goal = np.array(GOAL) - p
    lengths = np.linalg.norm(to_goal, axis=1) * np.linalg.norm(p, axis=1) + 1e-10
    with np.errstate(invalid="ignore", divide="ignore"):
        rough = float(np.mean(doubled / lc**2))
    return {
        "time_unsafe": sum(t[k - 1] - t[i] for i, k in zip(first, after, strict=True) if k < n),
        "heading_change": np.abs(np.diff(track["heading"])).sum(),
        "acceleration": np.abs(np.diff(np.abs(v))).mean(),
        "jerk": np.abs(np.diff(np.abs(v), 2)).mean(),
        "curvature": curvature.mean(),
        "normalised_curvature": (curvature * (la + lb)).mean(),
        "roughness": rough,
        "n_contacts": np.sum((gap[1:] <= 0) & (gap[:-1] > 0)),
        "mean_gap": floored.mean(),
        "least_gap": floored.min(),
        "intimate": 100 * np.mean(floored < 0.45),
        "personal": 100 * np.mean((floored >= 0.45) & (floored < 1.2)),
        "social": 100 * np.mean((floored >= 1.2) & (floored < 3.6)),
        "n_touches": np.sum(gaps(track, places) < 0.02),
        "time_at_rest": (t[-1] - t[0]) / n * np.sum((v < 0.01) & (track["w"] < 0.02)),
        "mean_acceleration": np.sum(dv / dt) / n,
        "overacceleration": np.sum(dv / dt**2) / n,
        "irregularity": np.mean(np.arccos(np.clip(np.sum(to_goal * p, 1) / lengths, -1, 1))),
        "length_ratio": (np.linalg.norm(np.diff(p, axis=0), axis=1).sum() + 1e-5) / math.dist(p[0], GOAL),
    }


LOOSE = {"time_to_goal", "time_to_set_out", "time_unsafe", "time_intimate", "time_personal", "time_social"}
LOOSE |= {"mean_speed", "least_goal_distance"}


@pytest.mark.parametrize("seed", range(12))
def test_measures_are_those_of_the_naive_twin(seed: int) -> None:
    track, places = random_run(seed)
    run = measures_of(track, places, RADII, robot_radius=ROBOT, goal=GOAL)
    for name, value in naive(track, places).items():
        # twins that count points know times to a thousandth of an interval, 0.08 s, for each of few crossings
        tolerance = {"abs": 2e-3} if name in LOOSE else {"rel": 1e-6, "abs": 1e-9}
        assert run[name] == pytest.approx(value, nan_ok=True, **tolerance), name


@pytest.mark.parametrize("seed", range(12))
def test_published_numbers_are_those_of_the_naive_twin(seed: int) -> None:
    track, places = random_run(seed)
    run = measures_as_published(track, places, RADII, robot_radius=ROBOT, goal=GOAL)
    for name, value in naive_as_published(track, places).items():
        assert run[name] == pytest.approx(value, rel=1e-7, abs=1e-9, nan_ok=True), name


def test_the_twins_cover_every_metric_and_the_random_runs_move_each() -> None:
    runs = [random_run(seed) for seed in range(12)]
    assert set(naive(*runs[0])) == {metric.name for metric in METRICS}
    assert set(naive_as_published(*runs[0])) == {metric.name for metric in AS_PUBLISHED}
    for function, layout in ((measures_of, MEASURES), (measures_as_published, PUBLISHED)):
        records = [function(track, places, RADII, robot_radius=ROBOT, goal=GOAL) for track, places in runs]
        assert layout.names is not None
        for name in layout.names:
            values = np.array([record[name] for record in records])
            assert len(np.unique(values[~np.isnan(values)])) > 1, name


def moved(angle: float, x: float, y: float, points: Floats) -> Floats:
    """The points turned by an angle about the origin, then shifted."""
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array([x, y]))


def shifted(seed: int) -> tuple[tuple[np.void, np.void], tuple[np.void, np.void]]:
    """Both records of a random run, and of the same run elsewhere in the world, later in the day."""
    track, places = random_run(seed)
    there = track.copy()
    p = moved(2.5, 30.0, -7.0, np.stack([track["x"], track["y"]], -1))
    there["x"], there["y"], there["heading"] = p[:, 0], p[:, 1], turned(track["heading"] + 2.5)
    there["time"] += 3_600_000_000_000
    goal = moved(2.5, 30.0, -7.0, np.array(GOAL))
    away = (float(goal[0]), float(goal[1]))
    both = []
    for tr, pl, g in ((track, places, GOAL), (there, moved(2.5, 30.0, -7.0, places), away)):
        both.append(
            (
                measures_of(tr, pl, RADII, robot_radius=ROBOT, goal=g),
                measures_as_published(tr, pl, RADII, robot_radius=ROBOT, goal=g),
            )
        )
    return both[0], both[1]


@pytest.mark.parametrize("seed", range(4))
def test_measures_do_not_depend_on_where_in_the_world_a_run_takes_place(seed: int) -> None:
    (here, _), (there, _) = shifted(seed)
    for metric in METRICS:
        assert there[metric.name] == pytest.approx(here[metric.name], rel=1e-6, abs=1e-9, nan_ok=True), metric.name


def test_of_the_published_numbers_two_depend_on_it() -> None:
    (_, here), (_, there) = shifted(3)
    differ = {
        metric.name
        for metric in AS_PUBLISHED
        if there[metric.name] != pytest.approx(here[metric.name], rel=1e-6, abs=1e-9, nan_ok=True)
    }
    assert differ == {"irregularity", "heading_change"}


INTEGRALS = [
    *("duration", "path_length", "time_to_goal", "time_to_set_out", "mean_speed", "needed_turn", "time_halted"),
    *("mean_clearance", "time_unsafe", "time_intimate", "squared_acceleration", "squared_yaw_acceleration"),
]


@pytest.mark.parametrize("seed", range(4))
def test_entries_put_between_change_no_integral(seed: int) -> None:
    track, places = random_run(seed)
    dense = np.repeat(track, 2)[:-1]
    for name in ("x", "y", "v", "w"):
        dense[name][1::2] = (track[name][1:] + track[name][:-1]) / 2
    dense["time"][1::2] = (track["time"][1:] + track["time"][:-1]) // 2
    dense["heading"][1::2] = track["heading"][:-1] + turned(np.diff(track["heading"])) / 2
    between = np.repeat(places, 2, axis=0)[:-1]
    between[1::2] = (places[1:] + places[:-1]) / 2
    one = measures_of(track, places[:, :1], RADII[:1], robot_radius=ROBOT, goal=GOAL)
    two = measures_of(dense, between[:, :1], RADII[:1], robot_radius=ROBOT, goal=GOAL)
    for name in INTEGRALS:
        assert two[name] == pytest.approx(one[name], rel=5e-3, abs=2e-3, nan_ok=True), name
    # jerk, and what counts samples, do depend on the sampling
    assert two["squared_jerk"] != pytest.approx(one["squared_jerk"], rel=0.1)
