"""The table of metrics is the layout of the record and the table of the page; what does not fit together is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_navigation.facts import TRACK
from parcours_navigation.measures import AS_PUBLISHED, BENCHMARKS, MEASURES, METRICS, PUBLISHED, measures_of

Floats = NDArray[np.float64]


def test_every_field_of_the_layout_is_a_metric_with_a_definition() -> None:
    for layout, metrics in ((MEASURES, METRICS), (PUBLISHED, AS_PUBLISHED)):
        assert layout.names == tuple(metric.name for metric in metrics)
        assert all(metric.unit and metric.definition and metric.source for metric in metrics)


@pytest.mark.parametrize(
    ("places", "radii", "slug"),
    [(np.zeros((3, 1, 2)), [0.1, 0.1], "places-shape"), (np.zeros((2, 1, 2)), [0.1], "places-shape")],
)
def test_shapes_that_do_not_fit_are_refused(places: Floats, radii: list[float], slug: str) -> None:
    with pytest.raises(BadRequest, match=slug):
        measures_of(np.zeros(3, TRACK), places, radii, robot_radius=0.125, goal=(1.0, 0.0))


def test_times_that_decrease_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"0 ns follows 50000000 ns.*track-order"):
        track = np.zeros(3, TRACK)
        track["time"] = [50_000_000, 0, 100_000_000]
        measures_of(track, np.zeros((3, 0, 2)), [], robot_radius=0.125, goal=(1.0, 0.0))


def rows(page: str, heading: str) -> list[list[str]]:
    """The body of the last table of a section of docs/metrics.md."""
    section = page.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.replace(r"\|", "|").strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines[1:]]


def test_the_tables_of_the_page_are_those_of_the_code() -> None:
    page = (Path(__file__).parents[3] / "docs/metrics.md").read_text(encoding="utf-8")
    for heading, metrics in (("One run", METRICS), ("What published code computes", AS_PUBLISHED)):
        expected = [[f"`{each.name}`", each.unit, each.definition, each.source] for each in metrics]
        assert rows(page, heading) == expected
    modes = [
        [f"`{name}`", f"`{mode}`", text, each.source]
        for name, each in BENCHMARKS.items()
        for mode, text in each.modes.items()
    ]
    assert rows(page, "Many runs") == modes
