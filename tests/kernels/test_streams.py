"""The random streams in compiled code against a twin in whole numbers of Python, and against what chance allows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.streams import below, between, lognormal, mix, start, uniform

WORD = 2**64
GOLDEN = 0x9E3779B97F4A7C15

words = st.integers(0, WORD - 1)


def twin_mix(word: int) -> int:
    """Scramble a word as Steele, Lea and Flood print it."""
    word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9 % WORD
    word = (word ^ (word >> 27)) * 0x94D049BB133111EB % WORD
    return word ^ (word >> 31)


def twin_start(seed: int, case: int, purpose: int) -> int:
    inner = twin_mix((seed + GOLDEN) % WORD) ^ ((case * 0x94D049BB133111EB + GOLDEN) % WORD)
    return twin_mix(twin_mix(inner) ^ ((purpose * 0xBF58476D1CE4E5B9 + GOLDEN) % WORD))


def stream_of(seed: int, case: int, purpose: int) -> NDArray[np.uint64]:
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(seed), np.uint64(case), np.uint64(purpose))
    return stream


def drawn(seed: int, case: int, purpose: int, n: int) -> NDArray[np.float64]:
    stream = stream_of(seed, case, purpose)
    return np.array([uniform(stream) for _ in range(n)])


def test_the_words_are_those_of_the_published_generator() -> None:
    # First outputs of SplitMix64 from state 1234567, as printed in the reference implementations' test vectors.
    state, expected = 1234567, [6457827717110365317, 3203168211198807973, 9817491932198370423]
    for word in expected:
        state = (state + GOLDEN) % WORD
        assert twin_mix(state) == word
        assert int(mix(np.uint64(state))) == word


@given(words, words, st.integers(0, 100))
def test_a_stream_is_the_whole_number_twin_s(seed: int, case: int, purpose: int) -> None:
    stream = stream_of(seed, case, purpose)
    state = twin_start(seed, case, purpose)
    assert int(stream[0]) == state
    for _ in range(3):
        state = (state + GOLDEN) % WORD
        assert uniform(stream) == (twin_mix(state) >> 11) * 2.0**-53


def test_uniform_numbers_fill_the_unit_interval_evenly() -> None:
    numbers = drawn(1, 2, 3, 20_000)
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    counts = np.histogram(numbers, bins=20, range=(0.0, 1.0))[0]
    # Chi-square with 19 degrees of freedom exceeds 43.8 once in a thousand seeds; this seed is fixed.
    assert float(((counts - 1000.0) ** 2 / 1000.0).sum()) < 43.8


@pytest.mark.parametrize(
    ("one", "two"),
    [((7, 0, 1), (7, 0, 2)), ((7, 0, 1), (7, 1, 1)), ((7, 0, 1), (8, 0, 1)), ((0, 1, 2), (0, 2, 1))],
)
def test_streams_of_another_purpose_case_or_seed_are_unrelated(
    one: tuple[int, int, int], two: tuple[int, int, int]
) -> None:
    first, second = drawn(*one, 4000), drawn(*two, 4000)
    assert not np.isin(first, second).any()
    for lag in range(3):
        related = np.corrcoef(first[: 4000 - lag], second[lag:])[0, 1]
        assert abs(related) < 4.0 / math.sqrt(4000)


@given(words, st.integers(1, 12))
def test_below_gives_whole_numbers_under_its_bound(seed: int, n: int) -> None:
    stream = stream_of(seed, 0, 0)
    assert all(0 <= below(stream, n) < n for _ in range(20))


def test_below_gives_every_number_alike() -> None:
    stream = stream_of(5, 0, 0)
    counts = np.bincount([below(stream, 6) for _ in range(12_000)], minlength=6)
    assert float(((counts - 2000.0) ** 2 / 2000.0).sum()) < 20.5  # once in a thousand seeds; this one is fixed


@given(words, st.floats(-10.0, 10.0), st.floats(0.001, 10.0))
def test_between_stays_between(seed: int, low: float, width: float) -> None:
    stream = stream_of(seed, 0, 0)
    assert all(low <= between(stream, low, low + width) <= low + width for _ in range(5))


def test_lognormal_numbers_have_the_given_median_and_spread() -> None:
    stream = stream_of(9, 0, 0)
    logs = np.log([lognormal(stream, 0.034, 0.66) for _ in range(20_000)])
    assert abs(float(np.median(logs)) - math.log(0.034)) < 4 * 1.2533 * 0.66 / math.sqrt(20_000)
    assert abs(float(logs.std()) - 0.66) < 4 * 0.66 / math.sqrt(2 * 20_000)
