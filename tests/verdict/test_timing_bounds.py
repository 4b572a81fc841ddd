"""A bound in words: what it says is what is judged, and whatever it does not say is refused by name."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.verdict.timing import Bound, parse_bound
from parcours.verdict.timing.bounds import LONGEST, amount

percents = st.one_of(
    st.sampled_from([50.0, 95.0, 99.0, 99.9, 99.99]),
    st.integers(1, 9_999_999).map(lambda k: k / 100_000),
)
bounds = st.builds(
    Bound,
    limit=st.one_of(st.integers(1, LONGEST), st.integers(1, 1000).map(lambda k: k * 1_000_000)),
    percent=st.none() | percents,
    strict=st.booleans(),
    repeats=st.integers(0, 10**6),
    confidence=st.sampled_from([50.0, 80.0, 95.0, 99.0, 99.9]),
    spell=st.integers(1, 1000),
)


@given(bounds)
def test_a_bound_written_down_and_read_is_the_same_bound(bound: Bound) -> None:
    assert parse_bound(str(bound)) == bound


@pytest.mark.parametrize(
    ("text", "bound"),
    [
        ("every < 20 ms", Bound(20_000_000)),
        ("every<=5us", Bound(5_000, strict=False)),
        ("p99 < 20 ms over 200 repeats", Bound(20_000_000, 99.0, repeats=200)),
        ("p95 <= 5 ms", Bound(5_000_000, 95.0, strict=False)),
        ("  p99.9 < 0.5 µs over 1 repeat with 99.5% confidence ", Bound(500, 99.9, repeats=1, confidence=99.5)),
        ("p99 < 5 ms over 3000 repeats in spells of 10", Bound(5_000_000, 99.0, repeats=3000, spell=10)),
        ("p50 < 1.25 s", Bound(1_250_000_000, 50.0)),
        ("p50 < 7 ns", Bound(7, 50.0)),
    ],
)
def test_a_bound_is_read_as_it_stands(text: str, bound: Bound) -> None:
    assert parse_bound(text) == bound


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mean < 5 ms", r"a mean hides missed deadlines.*\[timing-bound-statistic\]"),
        ("max < 5 ms", r"grows with n: write `every < ...`.*\[timing-bound-statistic\]"),
        ("median <= 5 ms", r"write `p50 < ...`.*\[timing-bound-statistic\]"),
        ("p99 > 5 ms", r"it reads STATISTIC < LIMIT UNIT.*\[timing-bound\]"),
        ("p99 < 5", r"units are ns, us, ms, s \[timing-bound\]"),
        ("p99 < 5 h", r"\[timing-bound\]"),
        ("p99 < -5 ms", r"\[timing-bound\]"),
        ("p99 < ٥ ms", r"\[timing-bound\]"),
        ("p99 < 5 ms or so", r"\[timing-bound\]"),
        ("every < 5 ms over many repeats", r"\[timing-bound\]"),
        ("", r"timing bound '': .*\[timing-bound\]"),
        ("x" * 10_000, r"x\.\.\.': .*\[timing-bound\]"),
        ("p100 < 5 ms", r"below 100 %, but 100 % given; write `every`.*\[timing-bound-range\]"),
        ("p0 < 5 ms", r"above 0 %.*\[timing-bound-range\]"),
        ("every < 0 ms", r"at least 1 ns.*\[timing-bound-range\]"),
        ("every < 0.5 ns", r"whole number of nanoseconds, but 0.5 ns.*\[timing-bound-range\]"),
        ("every < 9999999 s", r"at most 1e15 ns.*\[timing-bound-range\]"),
        ("p99 < 5 ms over 0 repeats", r"at least 1 repeat.*\[timing-bound-range\]"),
        ("p99 < 5 ms in spells of 0", r"at least 1 repeat.*\[timing-bound-range\]"),
        ("p99 < 5 ms with 100 % confidence", r"below 100 %.*\[timing-bound-range\]"),
        ("p99 < 5 ms with 40 % confidence", r"at least 50 %.*\[timing-bound-range\]"),
    ],
)
def test_what_is_no_bound_is_refused_with_the_way_to_say_it(text: str, message: str) -> None:
    with pytest.raises(BadRequest, match=message):
        parse_bound(text)


@given(st.text(max_size=60))
def test_any_text_is_a_bound_or_refused(text: str) -> None:
    try:
        assert parse_bound(str(parse_bound(text))) == parse_bound(text)
    except BadRequest as error:
        assert re.fullmatch(r"timing-bound(-range|-statistic)?", error.slug)


def test_a_strict_limit_is_missed_by_a_duration_that_equals_it() -> None:
    assert parse_bound("every < 5 ms").last == 4_999_999
    assert parse_bound("every <= 5 ms").last == 5_000_000


def test_shares_are_those_a_reader_computes() -> None:
    bound = parse_bound("p99.9 < 5 ms with 99.9 % confidence")
    assert (bound.quantile, bound.error) == (0.999, 0.001)


@given(st.integers(1, LONGEST))
def test_an_amount_of_time_loses_no_digit(time: int) -> None:
    assert parse_bound(f"every < {amount(time)}").limit == time
