"""Curves over a dial: what is drawn, what is said of it, and what is refused."""

from __future__ import annotations

import re

import pytest

from parcours.errors import BadRequest
from parcours.report.curves import curves
from parcours.verdict.statistics import Rate, wilson

AT = (0.0, 0.5, 1.0)


def rates(*counts: int) -> tuple[Rate, ...]:
    return tuple(wilson(count, 100) for count in counts)


PANELS: dict[str, dict[str, dict[str, tuple[Rate, ...]]]] = {
    "stuck": {
        "sensing": {"old": rates(10, 20, 30), "new": rates(0, 0, 1)},
        "stop": {"old": rates(10, 10, 10), "new": rates(0, 0, 0)},
    },
    "contact": {
        "sensing": {"old": rates(5, 5, 5), "new": rates(1, 1, 1)},
        "stop": {"old": rates(5, 50, 95), "new": rates(1, 2, 3)},
    },
}


def test_every_rate_is_said_in_words() -> None:
    figure = curves("Delays", AT, PANELS, "added delay [s]", "100 cases a point")
    assert figure.alt.startswith("added delay [s]. stuck, sensing, old: 10.0% at 0, 20.0% at 0.5, 30.0% at 1; ")
    assert figure.alt.count(" at 1") == 8
    assert "contact, stop, new: 1.0% at 0, 2.0% at 0.5, 3.0% at 1" in figure.alt
    assert figure.note == "100 cases a point"


def test_a_panel_is_drawn_for_each_thing_and_dial_and_a_legend_for_each_series() -> None:
    svg = curves("Delays", AT, PANELS, "added delay [s]").svg
    assert len(re.findall(r'<g id="axes_\d+">', svg)) == 4
    assert len(re.findall(r'<g id="legend_\d+">', svg)) == 1
    # a band for each curve
    assert len(re.findall(r'<g id="FillBetweenPolyCollection_\d+">', svg)) == 8
    for word in ("sensing", "stop", "stuck", "contact", "old", "new", "added delay"):
        assert word in svg


def height(svg: str, which: int = 1) -> float:
    """Return how high a band is at its left end [pt]."""
    band = svg[svg.index(f"FillBetweenPolyCollection_{which}") :]
    points = re.findall(r"[ML] ([\d.]+) -?([\d.]+)", band[band.index(' d="') : band.index('z\n"')])
    left = min(float(x) for x, _ in points)
    ys = [float(y) for x, y in points if float(x) == left]
    return max(ys) - min(ys)


def test_a_band_is_as_high_as_its_interval_on_the_scale_of_its_row() -> None:
    few, many = (wilson(10, 20),) * 2, (wilson(1000, 2000),) * 2
    svg = curves("", (0.0, 1.0), {"stuck": {"stop": {"few": few, "many": many}}}, "s").svg
    wide, narrow = (rates[0].high - rates[0].low for rates in (few, many))
    assert height(svg, 1) / height(svg, 2) == pytest.approx(wide / narrow, rel=1e-3)


def test_panels_of_a_row_share_a_scale_that_holds_all_of_them() -> None:
    panels = {"contact": {"sensing": {"old": rates(1, 1)}, "stop": {"old": rates(95, 95)}}}
    svg = curves("", (0.0, 1.0), panels, "s").svg
    boxes = re.findall(r'<g id="patch_\d+">\s*<path d="M \S+ (\S+)\s*L \S+ \S+\s*L \S+ (\S+)', svg)
    bottom, top = map(float, boxes[1])
    marks = re.findall(r'<use xlink:href="#m\w+" x="(?!0")\S+" y="(\S+)" style="fill: var\(--c0', svg)
    drawn = [float(y) for y in marks[:-1]]  # the last is the legend's
    assert len(drawn) >= 4 and top <= min(drawn) < max(drawn) <= bottom


def test_the_same_numbers_give_the_same_bytes() -> None:
    assert curves("Delays", AT, PANELS, "s").svg == curves("Delays", AT, PANELS, "s").svg


@pytest.mark.parametrize(
    ("at", "panels", "complaint"),
    [
        (AT, {}, "at least one group"),
        ((0.0, 1.0, 1.0), PANELS, "settings must increase"),
        ((0.0, 1.0), PANELS, r"one rate a setting, 2, but has 3"),
        (AT, {**PANELS, "contact": {"sensing": PANELS["contact"]["sensing"]}}, "'contact' has others"),
        (AT, {"stuck": {"stop": {"old": rates(1, 2, 3)}, "sensing": {"new": rates(1, 2, 3)}}}, "'stuck' has others"),
        (AT, {"stuck": {}}, "'stuck' has others"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    at: tuple[float, ...], panels: dict[str, dict[str, dict[str, tuple[Rate, ...]]]], complaint: str
) -> None:
    with pytest.raises(BadRequest, match=rf"{complaint}.*\[chart-data\]"):
        curves("Delays", at, panels, "s")


def test_a_long_label_is_broken_so_that_it_fits_beside_its_panel() -> None:
    words = "collision that was caused by the robot"
    figure = curves("", AT, {words: PANELS["stuck"]}, "s")
    assert words in figure.alt and words not in figure.svg and "collision that" in figure.svg
