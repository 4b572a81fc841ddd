"""Table VII, and the ten message blocks of section IV-C, as the studies' data files hold them."""

from __future__ import annotations

import math
from importlib.resources import files

import numpy as np
import pytest

from parcours.data import InputModel, count, cover, draw, read_input_model, select
from parcours.study.finding import find


def of_study(name: str) -> InputModel:
    return read_input_model(find(name).files["data"])  # type: ignore[attr-defined]


TABLE_7 = [
    ("x", "m", "[0.5, 2]", ["[0.5, 1]", "(1, 1.5]", "(1.5, 2]"]),
    ("y", "m", "[0.5, 2]", ["[0.5, 1]", "(1, 1.5]", "(1.5, 2]"]),
    ("v", "m/s", "(0, 0.5)", ["[0, 0.25]", "(0.25, 0.5]"]),
    ("w", "rad/s", "(-1.5708, 1.5708)", ["[-1.5708, 0]", "(0, 1.5708]"]),
    ("ds", "s", "[0, 10]", ["[0, 10]"]),
    ("dm", "s", "[0, 10]", ["[0, 10]"]),
]


@pytest.mark.parametrize("obstacle", [1, 2, 3])
def test_each_obstacle_has_the_parameters_ranges_and_blocks_of_table_7(obstacle: int) -> None:
    model = of_study("ramp_system")
    domains = model.domains[6 * (obstacle - 1) : 6 * obstacle]
    shown = [(d.name, d.unit, str(d.stated), [str(b) for b in d.blocks]) for d in domains]
    assert shown == [(f"{name}{obstacle}", *rest) for name, *rest in TABLE_7]
    assert domains[3].span.high == math.pi / 2 and domains[3].span.low == -math.pi / 2


def test_an_obstacle_has_twelve_blocks_and_three_obstacles_fill_eighteen_columns() -> None:
    model = of_study("ramp_system")
    assert sum(model.sizes[:6]) == 12  # section V-D: "the input-domains consist of 12 total blocks"
    assert len(model.names) == 18


def test_where_range_and_blocks_disagree_on_an_end_the_blocks_decide() -> None:
    v, w = of_study("ramp_system").domains[2:4]
    assert [v.block_of(value) for value in (0.0, 0.25, 0.5)] == [0, 0, 1]
    assert [w.block_of(value) for value in (-math.pi / 2, 0.0, math.pi / 2)] == [0, 0, 1]
    assert v.stated is not None and 0.0 not in v.stated and math.pi / 2 not in (w.stated or ())


def test_obstacles_stand_apart_and_off_the_robot() -> None:
    model = of_study("ramp_system")
    cases = np.arange(3000)
    values = draw(model, select("each_choice", model.sizes, cases, seed=1), cases, seed=1)
    centres = values.reshape(3000, 3, 6)[:, :, :2]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.linalg.norm(centres[:, i] - centres[:, j], axis=1).min() >= 0.2 - 1e-12
    assert np.linalg.norm(centres, axis=2).min() >= 0.225


def test_the_wider_variant_reaches_further() -> None:
    path = str(files("parcours_navigation") / "cases" / "domains.yaml")
    model = read_input_model(path, {"robot_radius": 0.21, "obstacle_radius": 0.21, "least_distance": 0.42})
    cases = np.arange(500)
    centres = draw(model, select("each_choice", model.sizes, cases), cases).reshape(500, 3, 6)[:, :, :2]
    assert np.linalg.norm(centres[:, 0] - centres[:, 1], axis=1).min() >= 0.42 - 1e-12


def test_each_choice_needs_three_rows_and_hits_all_blocks_of_all_obstacles() -> None:
    model = of_study("ramp_system")
    assert [count(name, model.sizes) for name in ("each_choice", "base_choice", "all_combinations")] == [
        3,
        19,
        46656,
    ]
    rows = select("each_choice", model.sizes, seed=905)
    assert cover(model, draw(model, rows, np.arange(3), seed=905)).is_complete


def test_ramp_messages_have_the_ten_blocks_of_the_paper() -> None:
    model = of_study("ramp_components")
    assert dict(zip(model.names, model.sizes, strict=True)) == {
        "motion": 3, "path": 1, "trajectory": 2, "population": 1, "odometry": 3,
    }  # fmt: skip
    assert sum(model.sizes) == 10 and count("each_choice", model.sizes) == 3
    whole = [domain.name for domain in model.domains if domain.kind == "integer"]
    assert whole == ["path", "population"]
