"""Scores of many runs: each corrected form against numbers worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.measures import BENCHMARKS, MEASURES, PUBLISHED, Runs, ScoreColumn, barn, score, sct, spl


def facts(n: int, **given: object) -> NDArray[np.void]:
    """Runs in which nothing happened for 20 s, with what is given changed."""
    array = np.zeros(n, FACTS)
    for name in ("t_goal", "t_contact", "t_goal_after"):
        array[name] = NEVER
    array["t_end"] = 20_000_000_000
    for name, value in given.items():
        array[name] = value
    return array


def measures(n: int, **given: object) -> NDArray[np.void]:
    """Measures of 20 s, 0 but for what is given."""
    array = np.zeros(n, MEASURES)
    array["duration"] = 20.0
    for name, value in given.items():
        array[name] = value
    return array


def columns(runs: Runs, benchmark: str, mode: str | None = None) -> dict[str, ScoreColumn]:
    return {column.name: column for column in score(runs, benchmark, mode)}


def test_spl_and_sct_of_runs() -> None:
    runs = Runs(
        facts(4, t_goal=[5e9, 5e9, NEVER, 5e9], t_contact=[NEVER, 4e9, NEVER, NEVER], travelled=[4.0, 3.0, 3.0, 2.0]),
        measures(4),
        shortest=np.full(4, 3.0),
        fastest=np.full(4, 4.0),
    )
    found = columns(runs, "spl")
    assert found["SPL"].values.tolist() == [0.75, 0.0, 0.0, 1.0]
    assert found["SCT"].values.tolist() == [0.8, 0.0, 0.0, 0.8]
    assert found["SPL"].mean == pytest.approx(1.75 / 4)


def test_a_run_that_ended_in_an_error_is_no_success() -> None:
    runs = Runs(facts(2, t_goal=5e9, travelled=3.0, error=[0, 4]), measures(2), shortest=np.full(2, 3.0))
    assert columns(runs, "spl")["SPL"].values.tolist() == [1.0, 0.0]


positive = st.floats(1e-3, 1e3)


@given(st.lists(st.tuples(st.booleans(), positive, positive), min_size=1, max_size=8), positive)
def test_spl_lies_between_0_and_the_success_rate_and_knows_no_unit(
    runs: list[tuple[bool, float, float]], unit: float
) -> None:
    success, shortest, travelled = (np.array(column) for column in zip(*runs, strict=True))
    values = spl(success, shortest, travelled)
    assert np.all((values >= 0) & (values <= success))
    assert spl(success, shortest * unit, travelled * unit) == pytest.approx(values)
    assert np.array_equal(sct(success, shortest, travelled), values)


def test_an_unknown_shortest_way_leaves_a_run_out_of_the_mean() -> None:
    column = ScoreColumn("SPL", "1", spl([True, True], [math.nan, 2.0], [4.0, 4.0]))
    assert column.mean == 0.5
    assert math.isnan(ScoreColumn("SPL", "1", np.array([math.nan])).mean)


def test_barn_clips_between_2_and_8_optimal_times() -> None:
    times = [1.0, 10.0, 20.0, 30.0, 40.0, 90.0]
    lengths = np.full(6, 10.0)  # at 2 m/s: 5 s
    assert barn([True] * 6, times, lengths) == pytest.approx([0.5, 0.5, 0.25, 5 / 30, 0.125, 0.125])
    assert barn([True] * 6, times, lengths, mode="2022") == pytest.approx([0.25, 0.25, 0.25, 5 / 30, 0.125, 0.125])
    assert barn([False] * 6, [math.nan] * 6, lengths).tolist() == [0.0] * 6


def test_barn_counts_from_setting_out_and_allows_100_s_and_no_contact() -> None:
    runs = Runs(
        facts(4, t_goal=[16e9, 130e9, NEVER, 16e9], t_contact=[NEVER, NEVER, NEVER, 3e9]),
        measures(4, time_to_set_out=1.0),
        shortest=np.full(4, 10.0),
    )
    found = columns(runs, "barn")
    assert found["score"].values == pytest.approx([5 / 15, 0, 0, 0])
    assert found["success"].values.tolist() == [1, 0, 0, 0]
    assert found["timeout"].values.tolist() == [0, 1, 1, 0]
    assert found["collision"].values.tolist() == [0, 0, 0, 1]
    assert found["time"].mean == pytest.approx(15.0)


def test_mrpb_is_in_percent_and_milliseconds() -> None:
    runs = Runs(facts(1), measures(1, time_unsafe=5.0, smoothness=0.3), planning_time=np.array([0.012]))
    found = {name: column.mean for name, column in columns(runs, "mrpb").items()}
    expected = {"safety": 25.0, "motion efficiency": 20.0, "smoothness": 0.3, "computational efficiency": 12.0}
    assert found == pytest.approx(expected)


def test_arena_results_exclude_each_other_and_the_goal_must_be_reached() -> None:
    runs = Runs(
        facts(4, t_goal=[9e9, 9e9, NEVER, 181e9], n_shared_contacts=[0, 2, 0, 0], n_obstacle_contacts=[2, 1, 0, 0]),
        measures(4, heading_change=3.0, path_length=[2.0, 2.0, 0.0, 2.0], mean_jerk=0.7),
    )
    found = columns(runs, "arena")
    assert found["goal reached"].values.tolist() == [1, 0, 0, 0]
    assert found["collision"].values.tolist() == [0, 1, 0, 0]
    assert found["timeout"].values.tolist() == [0, 0, 1, 1]
    assert found["angle over length"].values[0] == 1.5 and math.isnan(found["angle over length"].values[2])
    assert found["jerk"].unit == "m/s^3" and found["jerk"].mean == pytest.approx(0.7)


def test_hunavsim_in_its_corrected_form() -> None:
    runs = Runs(
        facts(2, t_goal=[9e9, NEVER], n_robot_contacts=[0, 1], n_obstacle_contacts=[0, 2], min_clearance=[0.2, -0.01]),
        measures(2, time_intimate=[5.0, 10.0], time_at_rest=3.0, goal_distance=[0.1, 0.4], mean_jerk=0.0),
    )
    found = columns(runs, "hunavsim")
    assert found["completed"].values.tolist() == [1, 0]
    assert found["time to goal"].mean == pytest.approx(9.0)
    assert found["intimate space"].values.tolist() == [25.0, 50.0]
    assert found["collisions"].values.tolist() == [0, 3]
    assert found["minimum distance to people"].values.tolist() == [0.2, -0.01]


def test_socnavbench_ratio_is_at_most_1_and_a_needed_turn_is_not_irregular() -> None:
    given = {"displacement": 2.0, "path_length": [2.0, 4.0], "heading_change": [1.5, 3.5], "needed_turn": 1.5}
    found = columns(Runs(facts(2), measures(2, **given)), "socnavbench")
    assert found["path length ratio"].values.tolist() == [1.0, 0.5]
    assert found["path irregularity"].values == pytest.approx([0.0, 0.5])


def test_bench_mr_shows_a_near_miss_that_its_mean_hides() -> None:
    runs = Runs(facts(1, min_clearance=0.001), measures(1, mean_clearance=1.2))
    assert columns(runs, "bench-mr")["least clearance"].mean == pytest.approx(0.001)
    [clearing] = [column.mean for column in score(runs, "bench-mr", "bench-mr-code") if column.name == "clearing"]
    assert clearing == pytest.approx(1.2)


@pytest.mark.parametrize(("name", "mode"), [(name, mode) for name, each in BENCHMARKS.items() for mode in each.modes])
def test_every_mode_of_every_benchmark_gives_columns_for_every_run(name: str, mode: str) -> None:
    ones = np.ones(3)
    runs = Runs(facts(3), measures(3), np.zeros(3, PUBLISHED), ones, ones, ones)
    found = score(runs, name, mode)
    assert found and all(column.values.shape == (3,) and column.unit for column in found)
    assert len({column.name for column in found}) == len(found)


@pytest.mark.parametrize(
    ("benchmark", "mode", "slug"),
    [
        ("bran", None, "did you mean 'barn'.*unknown-benchmark"),
        ("barn", "2202", "unknown-score-mode"),
        ("barn", None, "shortest.*runs-missing"),
        ("mrpb", "mrpb-2021", "published.*runs-missing"),
    ],
)
def test_what_is_unknown_or_missing_is_named(benchmark: str, mode: str | None, slug: str) -> None:
    with pytest.raises(BadRequest, match=slug):
        score(Runs(facts(2), measures(2)), benchmark, mode)


def test_arrays_of_different_lengths_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"fastest.*\(2,\).*\(3,\).*runs-shape"):
        Runs(facts(2), measures(2), fastest=np.ones(3))
    with pytest.raises(BadRequest, match="runs-shape"):
        spl([True], [1.0, 2.0], [1.0, 2.0])


def test_a_shortest_way_of_0_is_refused() -> None:
    for function in (spl, sct, lambda s, b, a: barn(s, a, b)):
        with pytest.raises(BadRequest, match="best-not-positive"):
            function([True, True], [1.0, 0.0], [1.0, 1.0])
