"""Charts: what they show is what they were given, and the drawing is fit to stand in a page."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.report.distributions import histogram
from parcours.report.drawing import MARKERS, SERIES, TONES, label_ink
from parcours.report.pieces import Figure
from parcours.report.rates import intervals, shares
from parcours.verdict.statistics import wilson

SVG = "{http://www.w3.org/2000/svg}"

CHARTS: dict[str, Callable[[], Figure]] = {
    "intervals": lambda: intervals(
        "Stuck", ["(0,0,0)", "(0,0,1)"],
        {"original": [wilson(8, 100), wilson(13, 100)], "published": [wilson(42, 506), None]}, "share stuck",
    ),
    "shares": lambda: shares(
        "Outcomes", ["goal", "stuck"], {"original": [90, 10], "guarded": [99, 1]}, ["good", "bad"]
    ),
    "histogram": lambda: histogram(
        "Time left", {"original": [1.0, 2.0, np.nan, 99.0]}, [0, 5, 10], "[s]", {"published": [(0.5, 4.8)]}
    ),
}  # fmt: skip


def texts(figure: Figure) -> list[str]:
    """The texts of a drawing."""
    return ["".join(element.itertext()).strip() for element in ET.fromstring(figure.svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_is_the_same_bytes_every_time(name: str) -> None:
    assert CHARTS[name]().svg == CHARTS[name]().svg


def test_a_chart_is_the_same_bytes_in_another_process() -> None:
    program = (
        "import sys; from parcours.report.rates import shares; "
        "it = shares('Outcomes', ['goal', 'stuck'], {'original': [90, 10], 'guarded': [99, 1]}, ['good', 'bad']); "
        "assert 'matplotlib' not in sys.modules, 'a terminal shows words alone'; print(it.svg)"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    other = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert other.stdout.strip() == CHARTS["shares"]().svg


@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_is_one_svg_element_that_keeps_to_itself(name: str) -> None:
    figure = CHARTS[name]()
    root = ET.fromstring(figure.svg)
    assert root.tag == f"{SVG}svg"
    assert root.find(f".//{SVG}style") is None, "a style element would reach the whole page"
    assert root.find(f".//{SVG}metadata") is None
    addresses = set(re.findall(r"https?://[^\"]+", figure.svg))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_tells_its_numbers_in_words(name: str) -> None:
    assert re.search(r"\d", CHARTS[name]().alt)


def test_charts_ignore_the_users_own_matplotlib_settings() -> None:
    import matplotlib

    plain = CHARTS["shares"]().svg
    with matplotlib.rc_context({"font.size": 30.0, "axes.grid": False, "svg.fonttype": "path"}):
        assert CHARTS["shares"]().svg == plain
        assert matplotlib.rcParams["font.size"] == 30.0, "and leave them as they were"


def test_intervals_name_groups_and_series_and_say_what_is_not_known() -> None:
    figure = CHARTS["intervals"]()
    assert {"(0,0,0)", "(0,0,1)", "original", "published", "share stuck"} <= set(texts(figure))
    assert "original 8.0% (4.1% to 15.0%)" in figure.alt
    assert "published not known" in figure.alt


def test_dollar_signs_in_names_are_no_formulas() -> None:
    figure = shares("costs", ["a$b$", "c"], {"$x_1$": [1, 1]}, ["good", "bad"])
    assert {"a$b$", "$x_1$"} <= set(texts(figure))


def test_names_in_any_script_stay_text_and_raise_no_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = shares("t", ["目標", "c"], {"原": [1, 1]}, ["good", "bad"])
    assert {"目標", "原"} <= set(texts(figure))


def test_shares_are_percentages_of_each_series() -> None:
    assert {"90.0%", "10.0%", "99.0%"} <= set(texts(CHARTS["shares"]()))
    assert "1.0% stuck" in CHARTS["shares"]().alt, "what is too thin for a label is told in words"


def test_histogram_leaves_out_what_is_not_known_and_keeps_what_is_beyond() -> None:
    assert "original: 3 values, median 2, largest 99" in CHARTS["histogram"]().alt


@pytest.mark.parametrize(
    ("draw", "rule"),
    [
        (lambda: intervals("t", [], {}, "x"), "at least one group"),
        (lambda: intervals("t", ["a"], {"s": []}, "x"), "'s' must have one value a group, 1, but has 0"),
        (lambda: shares("t", ["a"], {"s": [-1]}, ["good"]), "not negative"),
        (lambda: shares("t", ["a"], {"s": [1]}, []), "'tones' must have one value a group"),
        (lambda: histogram("t", {"s": [1]}, [2, 1], "x"), "edges must increase"),
    ],
)
def test_a_chart_of_nonsense_is_refused(draw: Callable[[], Figure], rule: str) -> None:
    with pytest.raises(BadRequest, match=rf"chart 't': .*{rule}.*\[chart-data\]"):
        draw()


def luminance(colour: str) -> float:
    """Relative luminance of a colour (WCAG 2.1)."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("tone", TONES)
def test_labels_stand_out_from_the_colour_they_stand_on(tone: str) -> None:
    lights = sorted((luminance(TONES[tone]), luminance(label_ink(TONES[tone]))))
    assert (lights[1] + 0.05) / (lights[0] + 0.05) >= 4.5, "WCAG 2.1, level AA"


def test_series_differ_by_marker_as_well_as_by_colour() -> None:
    assert len(set(SERIES)) == len(set(MARKERS)) == len(SERIES)
    assert not set(SERIES) & set(TONES.values()), "a tone must keep its colour where series follow the page"
