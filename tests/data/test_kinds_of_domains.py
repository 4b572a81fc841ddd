"""Angles, enumerations, listed values and invalid blocks: what is drawn from a block lies in it, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import Block, Domain, InputModel, cover, draw, enumeration, parse_input_model, split
from parcours.data.domains import OUTSIDE
from parcours.errors import BadDomain

EVERYTHING = """\
parcours: data/1
name: kinds
repeat: 2
parameters:
  heading: {kind: angle, unit: rad, blocks: {back: "(3*pi/4, -3*pi/4]", right: "(-3*pi/4, 0]", left: "(0, 3*pi/4]"}}
  mode: {kind: enumeration, values: {quiet: [auto, off], loud: manual}, invalid: [broken]}
  speed: {unit: m/s, values: [2, 0.5, 1], base: ["1", "2"]}
  n: {kind: integer, unit: "1", blocks: ["[0, 4]", "(4, 9]"], invalid: ["[-3, -1]", 12]}
  at: {unit: m, components: [x, y], edges: [0, 1, 2], step: 0.01}
constraints:
  ahead: {row: "mode1 != 'manual' || speed1 > 0.5"}
  apart: {pairs: "hypot(a.at.x - b.at.x, a.at.y - b.at.y) >= 0.2"}
  slow: {blocks: "heading1 != 'back' || mode2 == 'quiet'"}
groups:
  - {of: [heading, mode, speed], strength: 3}
"""
MODEL = parse_input_model(EVERYTHING, "kinds.yaml")


def test_a_file_says_every_kind_of_domain() -> None:
    assert MODEL.names == (
        "heading1", "mode1", "speed1", "n1", "at1.x", "at1.y", "heading2", "mode2", "speed2", "n2", "at2.x", "at2.y",
    )  # fmt: skip
    heading, mode, speed, n, x = MODEL.domains[:5]
    assert heading.labels == ("back", "right", "left") and mode.labels == ("quiet", "loud", "broken")
    assert [mode.values[int(v)] for v in (0, 1, 2, 3)] == ["auto", "off", "manual", "broken"]
    assert speed.labels == ("0.5", "1", "2") and speed.bases == (1, 2)
    assert n.labels == ("[0, 4]", "(4, 9]", "[-3, -1]", "12") and x.step == 0.01
    assert MODEL.sizes[:6] == (3, 2, 3, 2, 2, 2)
    assert [str(c) for c in MODEL.constraints] == [
        "ahead: mode1 != 'manual' || speed1 > 0.5",
        "apart(1, 2): hypot(at1.x - at2.x, at1.y - at2.y) >= 0.2",
        "slow: heading1 != 'back' || mode2 == 'quiet'",
    ]
    assert [group.inputs for group in MODEL.groups] == [
        ("heading1", "mode1", "speed1"),
        ("heading2", "mode2", "speed2"),
    ]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.data())
def test_what_is_drawn_from_a_block_lies_in_that_block(seed: int, data: st.DataObject) -> None:
    rows = np.array([[data.draw(st.integers(0, len(d.choices) - 1)) for d in MODEL.domains]])
    rows[0, [1, 2, 7]] = [0, 1, 0]  # so that no rule is broken
    values = draw(MODEL, rows, np.array([5]), seed=seed)
    assert [d.block_of(v) for d, v in zip(MODEL.domains, values[0], strict=True)] == rows[0].tolist()
    assert -math.pi < values[0, 0] <= math.pi


@given(
    st.lists(st.floats(0.001, 1.0), min_size=2, max_size=6), st.floats(-3.1, 3.1), st.sampled_from(["left", "right"])
)
def test_blocks_of_a_circle_hold_every_angle_once_however_often_it_turns(
    shares: list[float], start: float, closed: str
) -> None:
    edges = [start + 2 * math.pi * sum(shares[:i]) / sum(shares) for i in range(len(shares))] + [start + 2 * math.pi]
    circle = split("w", "rad", edges, closed="left" if closed == "left" else "right", kind="angle")
    angles = np.linspace(-math.pi, math.pi, 101)
    found = circle.blocks_of(angles)
    assert (found != OUTSIDE).all()
    ends = np.array([end + turn for end in edges for turn in (0.0, -2 * math.pi)])
    inner = angles[np.abs(angles[:, np.newaxis] - ends).min(axis=1) > 1e-6][1:-1]
    assert (circle.blocks_of(inner + 4 * math.pi) == circle.blocks_of(inner)).all()
    held = [[a in b or a + 2 * math.pi in b for b in circle.blocks] for a in inner]
    assert [row.index(True) for row in held] == circle.blocks_of(inner).tolist()
    assert circle.block_of(math.pi) == circle.block_of(-math.pi)


def test_the_block_across_pi_holds_both_sides_of_it() -> None:
    back = MODEL.domains[0]
    assert [back.block_of(a) for a in (3.0, math.pi, -math.pi, -3.0)] == [0, 0, 0, 0]
    assert [back.block_of(a) for a in (3 * math.pi / 4, -3 * math.pi / 4)] == [2, 0]
    values = draw(MODEL, np.repeat([[0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1]], 200, axis=0), np.arange(200), seed=1)[:, 0]
    assert (values > 0).any() and (values < 0).any()


def test_angles_that_overlap_on_the_circle_are_refused() -> None:
    with pytest.raises(BadDomain, match="blocks-edge"):
        Domain("w", "rad", (Block(-math.pi, 0.0), Block(0.0, math.pi, low_closed=False)), "angle")
    with pytest.raises(BadDomain, match="blocks-circle"):
        Domain("w", "rad", (Block(0.0, 7.0),), "angle")


def test_listed_values_may_stand_apart_but_intervals_may_not() -> None:
    sizes = Domain("size", "kB", (Block(10, 10), Block(100, 100)))
    assert [sizes.block_of(v) for v in (10, 50, 100)] == [0, OUTSIDE, 1]
    with pytest.raises(BadDomain, match="blocks-gap"):
        Domain("size", "kB", (Block(10, 10), Block(20, 100)))


def test_enumerations_hold_every_name_once() -> None:
    mode = enumeration("mode", ["auto", "off"])
    assert [mode.block_of(v) for v in (0, 1, 0.5, 2)] == [0, 1, OUTSIDE, OUTSIDE]
    with pytest.raises(BadDomain, match="values-double"):
        enumeration("mode", ["auto", "auto"])
    with pytest.raises(BadDomain, match="values-blocks"):
        Domain("mode", "1", (Block(0, 0),), "enumeration", values=("auto", "off"))


def test_coverage_counts_the_blocks_of_negative_tests_too() -> None:
    domain = Domain("n", "1", (Block(0, 9),), "integer", invalid=(Block(-1, -1, name="none"),))
    coverage = cover(InputModel("m", (domain,)), np.array([[3.0], [40.0]]))
    assert coverage.counts == ((1, 0),) and coverage.outside == (1,)
    assert coverage.uncovered == ("n = none",)


@pytest.mark.parametrize(
    ("old", "new", "slug"),
    [
        ("kind: angle, ", "kind: circle, ", "choice"),
        ('"(3*pi/4, -3*pi/4]"', '"[3*pi/4, -3*pi/4]"', "blocks-edge"),
        ("off]", "auto]", "values-double"),
        ("[broken]", "[off]", "values-double"),
        ("invalid: [broken]", "edges: [0, 1]", "blocks-or-edges"),
        ('base: ["1", "2"]', "base: fast", "block-base"),
        ("12]}", "9]}", "blocks-invalid"),
        ("[x, y]", "[x, x]", "components"),
        ("step: 0.01", "step: 0", "step"),
        ("'manual'", "'manuel'", "enum-value"),
        ("'back'", "'bakc'", "enum-value"),
        ("b.at.y", "b.at.z", "unknown-name"),
        ("of: [heading, mode", "of: [heading, mood", "group"),
        ("strength: 3", "strength: 4", "group"),
        ("strength: 3", "strength: 9", "value"),
        ("slow: {blocks", "slow: {row: x, blocks", "constraint-scope"),
    ],
)
def test_each_fault_of_the_new_keys_is_found(old: str, new: str, slug: str) -> None:
    assert old in EVERYTHING
    with pytest.raises(BadDomain) as caught:
        parse_input_model(EVERYTHING.replace(old, new, 1), "kinds.yaml")
    assert f"[{slug}]" in str(caught.value) and "kinds.yaml:" in str(caught.value)
