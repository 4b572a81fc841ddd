"""The defects of published metric code, number by number, beside what the corrected form says of the same run."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from parcours_navigation.facts import FACTS, NEVER, TRACK
from parcours_navigation.measures import Runs, barn, measures_as_published, measures_of, score


def track(seconds: float, hertz: float) -> NDArray[np.void]:
    """A robot that stands at the origin."""
    n = round(seconds * hertz) + 1
    entries = np.zeros(n, TRACK)
    entries["time"] = np.round(np.arange(n) / hertz * 1e9).astype(np.int64)
    return entries


def scores(
    entries: NDArray[np.void],
    benchmark: str,
    mode: str | None,
    gap: ArrayLike = (),
    goal: tuple[float, float] = (9.0, 0.0),
) -> dict[str, float]:
    """The scores of one run beside an obstacle at this gap along x; without obstacle if there is none."""
    places = np.zeros((len(entries), 1 if np.size(gap) else 0, 2))
    radii = np.full(places.shape[1], 0.1)
    if np.size(gap):
        places[:, 0, 0] = entries["x"] + 0.225 + np.asarray(gap)
    facts = np.zeros(1, FACTS)
    for name in ("t_goal", "t_contact"):
        facts[name] = NEVER
    one = measures_of(entries, places, radii, robot_radius=0.125, goal=goal)
    two = measures_as_published(entries, places, radii, robot_radius=0.125, goal=goal)
    runs = Runs(facts, np.array([one]), np.array([two]))
    return {column.name: float(column.values[0]) for column in score(runs, benchmark, mode)}


@pytest.mark.parametrize("seconds", [0.1, 5.0, 31.0, 99.0])
def test_barn_scores_every_success_among_moving_obstacles_0_125(seconds: float) -> None:
    assert barn([True], [seconds], [20.0], mode="dynabarn-2022").tolist() == [0.125]
    assert barn([False], [seconds], [20.0], mode="dynabarn-2022").tolist() == [0.0]


def test_mrpb_drops_the_interval_still_open_at_the_end() -> None:
    run = track(20.0, 10.0)
    gap = np.where(run["time"] < 10e9, 1.0, 0.05)
    assert scores(run, "mrpb", "mrpb-2021", gap)["safety"] == 0.0
    assert scores(run, "mrpb", None, gap)["safety"] == pytest.approx(50.0, abs=0.5)


def test_mrpb_drops_violations_of_one_sample() -> None:
    run = track(20.0, 10.0)
    gap = np.where(np.arange(len(run)) % 2 == 0, 0.05, 0.15)
    assert scores(run, "mrpb", "mrpb-2021", gap)["safety"] == 0.0
    assert scores(run, "mrpb", None, gap)["safety"] == pytest.approx(50.0)


def test_mrpb_agrees_about_a_closed_interval_but_for_its_two_crossings() -> None:
    run = track(20.0, 10.0)
    gap = np.where((run["time"] >= 5e9) & (run["time"] <= 10e9), 0.0, 0.2)
    assert scores(run, "mrpb", "mrpb-2021", gap)["safety"] == pytest.approx(25.0)
    assert scores(run, "mrpb", None, gap)["safety"] == pytest.approx(25.5)


def test_arena_counts_6_2_rad_for_a_turn_across_the_cut() -> None:
    run = track(0.1, 10.0)
    run["heading"], run["x"] = [3.1, -3.1], [0.0, 1.0]
    assert scores(run, "arena", "arena-evaluation")["angle over length"] == pytest.approx(6.2)
    assert scores(run, "arena", None)["angle over length"] == pytest.approx(2 * math.pi - 6.2)


def test_arena_s_acceleration_and_jerk_depend_on_the_sampling() -> None:
    values = {}
    for hertz in (10.0, 20.0):
        run = track(10.0, hertz)
        run["v"] = 0.1 * (run["time"] * 1e-9) ** 2 / 2
        for mode in ("arena-evaluation", "corrected"):
            found = scores(run, "arena", mode)
            values[mode, hertz] = (found["acceleration"], found["jerk"])
    assert values["arena-evaluation", 10.0] == pytest.approx((0.5 / 10, 0.1 / 100))
    assert values["arena-evaluation", 20.0] == pytest.approx((0.5 / 20, 0.1 / 400))
    assert values["corrected", 10.0] == pytest.approx((0.5, 0.1)) == values["corrected", 20.0]


def test_arena_calls_any_end_before_180_s_the_goal() -> None:
    run = track(20.0, 10.0)
    assert scores(run, "arena", "arena-evaluation")["goal reached"] == 1.0
    assert scores(run, "arena", None)["goal reached"] == 0.0
    assert scores(track(180.0, 10.0), "arena", "arena-evaluation")["timeout"] == 1.0


def test_arena_misses_contact_in_the_first_sample_and_takes_three_for_a_collision() -> None:
    run = track(1.0, 10.0)
    thrice = np.where(np.isin(np.arange(11), [0, 3, 5]), -0.01, 0.1)
    assert scores(run, "arena", "arena-evaluation", thrice)["collision"] == 0.0
    assert scores(run, "arena", "arena-evaluation", np.roll(thrice, 1))["collision"] == 1.0


def test_arena_s_roughness_is_lost_by_a_rest() -> None:
    run = track(10.0, 10.0)
    t = run["time"] * 1e-9
    run["x"], run["y"] = np.cos(t), np.sin(t)
    assert scores(run, "arena", "arena-evaluation")["roughness"] == pytest.approx(math.tan(0.05) / 2, rel=1e-6)
    run["x"][-20:], run["y"][-20:] = run["x"][-20], run["y"][-20]
    assert math.isnan(scores(run, "arena", "arena-evaluation")["roughness"])
    assert scores(run, "arena", None)["roughness"] > 0.0


def test_hunavsim_finds_a_jerk_of_5_in_constant_acceleration_at_10_hz() -> None:
    run = track(10.0, 10.0)
    run["v"] = 0.5 * run["time"] * 1e-9
    name = "average overacceleration"
    # 100 intervals of 5.0 m/s^3 each, divided by 101 samples
    assert scores(run, "hunavsim", "hunav-evaluator")[name] == pytest.approx(5.0 * 100 / 101)
    assert scores(run, "hunavsim", None)[name] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("turn", "published"), [(-1.0, 10.0), (1.0, 0.0)])
def test_hunavsim_takes_turning_clockwise_for_not_moving(turn: float, published: float) -> None:
    run = track(10.0, 10.0)
    run["w"] = turn
    assert scores(run, "hunavsim", "hunav-evaluator")["time not moving"] == pytest.approx(published)
    assert scores(run, "hunavsim", None)["time not moving"] == 0.0


def test_hunavsim_completes_0_3_m_outside_the_goal_and_times_runs_that_never_arrive() -> None:
    run = track(10.0, 10.0)
    found = scores(run, "hunavsim", "hunav-evaluator", goal=(0.49, 0.0))
    assert found["completed"] == 1.0 and found["time to goal"] == pytest.approx(10.0)
    assert scores(run, "hunavsim", "hunav-evaluator", goal=(0.51, 0.0))["completed"] == 0.0
    honest = scores(run, "hunavsim", None, goal=(0.49, 0.0))
    assert honest["completed"] == 0.0 and math.isnan(honest["time to goal"])


def test_hunavsim_counts_a_collision_at_every_sample() -> None:
    run = track(10.0, 10.0)
    assert scores(run, "hunavsim", "hunav-evaluator", 0.019 + 0 * run["v"])["collisions"] == 101.0
    assert scores(run, "hunavsim", "hunav-evaluator", 0.021 + 0 * run["v"])["collisions"] == 0.0


@pytest.mark.parametrize(
    ("x", "y", "published"), [(3.5, 4.9, 0.713), (8.5, 0.8, 0.089), (-1.5, 8.3, 1.458), (-7.5, 5.1, 2.321)]
)
def test_socnavbench_s_irregularity_of_one_straight_line_depends_on_the_origin(
    x: float, y: float, published: float
) -> None:
    run = track(10.0, 10.0)
    run["x"], run["y"] = x + np.linspace(0.0, 5.0, 101), y
    found = scores(run, "socnavbench", "socnavbench-code", goal=(x + 5.0, y))
    assert round(found["path irregularity"], 3) == published
    assert scores(run, "socnavbench", None, goal=(x + 5.0, y))["path irregularity"] == pytest.approx(0.0, abs=1e-9)


def test_socnavbench_s_ratio_is_the_inverse_of_its_docstring() -> None:
    run = track(10.0, 10.0)
    t = np.linspace(0.0, 1.0, 101)
    run["x"], run["y"] = t, np.minimum(t, 1.0 - t)
    length = math.sqrt(2.0)
    assert scores(run, "socnavbench", "socnavbench-code", goal=(1.0, 0.0))["path length ratio"] == pytest.approx(
        length, abs=2e-5
    )
    assert scores(run, "socnavbench", None, goal=(1.0, 0.0))["path length ratio"] == pytest.approx(1 / length)


def test_bench_mr_averages_a_near_miss_away() -> None:
    run = track(20.0, 10.0)
    gap = np.where(np.arange(len(run)) == 100, 0.001, 2.0)
    assert scores(run, "bench-mr", "bench-mr-code", gap)["clearing"] > 1.98
