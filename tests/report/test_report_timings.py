"""Fig. 5a and its table: they show the durations, limits and verdicts they were given."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.report.cells import value_of
from parcours.report.pieces import Figure, Marked
from parcours.report.terminal import to_text
from parcours.report.timings import TimingCase, timing_figure, timing_table
from parcours.run.noise import Noise
from parcours.verdict.timing import NEVER, judge, parse_bound

SVG = "{http://www.w3.org/2000/svg}"
NOISE = Noise(tuple(range(10_000, 50_000, 10)), "2 round trips")


def case(name: str, limit: str, middle: float = 2.0, extra: tuple[int, ...] = ()) -> TimingCase:
    """300 repeats about `middle` [ms], and some more."""
    drawn = np.random.default_rng(7).normal(middle, 0.1 * middle, 300) * 1e6
    durations = (*(int(time) for time in drawn), *extra)
    bound = parse_bound(limit)
    return TimingCase(name, durations, bound, judge(durations, bound, NOISE))


CASES = (
    case("ITP1", "p99 < 50 ms"),
    case("ITP1", "p99 < 5 ms"),
    case("ITP5", "p99 < 100 ms", 8.0),
    case("ITP5", "p99 < 6 ms", 8.0),
    case("ITP6", "p99 < 10 ms", 8.0, (NEVER,)),
)


def texts(figure: Figure) -> set[str]:
    return {"".join(element.itertext()).strip() for element in ET.fromstring(figure.svg).iter(f"{SVG}text")}


def test_the_figure_names_every_interaction_its_p99_and_the_noise() -> None:
    figure = timing_figure("Fig. 5a", CASES, NOISE)
    assert {"ITP1", "ITP5", "ITP6", "noise", "p50", "p95", "p99", "greatest"} <= texts(figure)
    assert {"limit: pass", "limit: fail", "limit: inconclusive"} <= texts(figure)
    assert "limit: error" not in texts(figure), "the legend explains what is there"
    assert "p99 0.0496 ms" in texts(figure)


def test_the_figure_tells_its_numbers_in_words() -> None:
    alt = timing_figure("Fig. 5a", CASES, NOISE).alt
    assert re.search(r"ITP1: n 600, p50 \d\.\d+ ms, p95 .*limits 5 \.\. 50 ms, 2 pass\.", alt)
    assert re.search(r"ITP5: .*limits 6 \.\. 100 ms, 1 pass, 1 fail\.", alt)
    assert re.search(r"ITP6: n 301, .*max never, 1 never ended; limits 10 ms, 1 inconclusive\.", alt)
    assert "noise: 4000 samples" in alt


def test_the_figure_is_the_same_bytes_every_time_and_keeps_to_itself() -> None:
    figure = timing_figure("Fig. 5a", CASES, NOISE)
    assert figure.svg == timing_figure("Fig. 5a", CASES, NOISE).svg
    root = ET.fromstring(figure.svg)
    assert root.find(f".//{SVG}style") is None and root.find(f".//{SVG}metadata") is None


def test_a_single_duration_and_no_duration_that_ended_are_drawn() -> None:
    bound = parse_bound("every < 5 ms")
    for durations in ((2_000_000,), (NEVER, NEVER)):
        figure = timing_figure("t", [TimingCase("ITP1", durations, bound, judge(durations, bound))])
        assert "ITP1" in texts(figure) and "nan" not in figure.svg


def test_a_density_is_highest_where_durations_are() -> None:
    two = tuple([1_000_000] * 100 + [10_000_000] * 300)
    figure = timing_figure(
        "t", [TimingCase("ITP1", two, parse_bound("p50 < 5 ms"), judge(two, parse_bound("p50 < 5 ms")))]
    )
    assert "p50 10 ms" in figure.alt


def test_a_chart_of_no_case_or_of_no_time_is_refused() -> None:
    bound = parse_bound("every < 5 ms")
    with pytest.raises(BadRequest, match=r"\[chart-data\]"):
        timing_figure("t", [])
    with pytest.raises(BadRequest, match=r"ITP1 has one of 0; .*\[chart-data\]"):
        timing_figure("t", [TimingCase("ITP1", (0,), bound, judge([0], bound))])


def test_the_table_has_a_row_an_interaction_and_counts_misses_of_each_cases_own_limit() -> None:
    table = timing_table("Table VIII", CASES)
    rows = {row[0]: dict(zip((column.name for column in table.columns), row, strict=True)) for row in table.rows}
    assert list(rows) == ["ITP1", "ITP5", "ITP6"]
    assert rows["ITP1"]["n"] == 600 and rows["ITP1"]["count"] == 0
    slow = sum(time >= 6_000_000 for time in CASES[3].durations)
    assert rows["ITP5"]["count"] == slow > 0
    assert rows["ITP6"]["limits"] == "10 ms" and value_of(rows["ITP6"]["max"]) == "never"
    assert "never" in to_text(table)


def test_a_verdict_of_the_table_is_toned_by_the_worst_and_says_why() -> None:
    verdicts = [row[-1] for row in timing_table("Table VIII", CASES).rows]
    assert [verdict.tone for verdict in verdicts if isinstance(verdict, Marked)] == ["good", "bad", "poor"]
    assert [value_of(verdict) for verdict in verdicts] == ["2 pass", "1 pass, 1 fail", "1 inconclusive"]
    failed = verdicts[1]
    assert isinstance(failed, Marked) and failed.why == CASES[3].judgement.why
