"""Durations, a bound and noise: what is said of them, and with which reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.run.noise import Noise
from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import NEVER, judge, parse_bound
from parcours.verdict.timing.dependence import chance_of_runs, dependence
from parcours.verdict.timing.ranks import greatest_miss_rate

MS = 1_000_000
QUIET = Noise((10_000,) * 6000, "2 round trips")


def durations(fast: int, slow: int, at: int = 9 * MS) -> list[int]:
    """Repeats of 2 ms and of `at`, in an order that shows no dependence."""
    taken = np.array([2 * MS] * fast + [at] * slow, dtype=np.int64)
    for seed in range(100):
        shuffled = np.random.default_rng(seed).permutation(taken)
        if chance_of_runs(shuffled > 5 * MS) > 0.2:
            break
    return [int(one) for one in shuffled]


@pytest.mark.parametrize(
    ("bound", "fast", "slow", "verdict"),
    [
        ("every < 5 ms", 1, 0, Verdict.PASS),
        ("every < 5 ms", 10_000, 1, Verdict.FAIL),
        ("every <= 9 ms", 10, 1, Verdict.PASS),
        ("every < 9 ms", 10, 1, Verdict.FAIL),
        ("p99 < 5 ms", 298, 0, Verdict.INCONCLUSIVE),
        ("p99 < 5 ms", 299, 0, Verdict.PASS),
        ("p99 < 5 ms", 471, 1, Verdict.INCONCLUSIVE),
        ("p99 < 5 ms", 472, 1, Verdict.PASS),
        ("p99 < 5 ms", 280, 20, Verdict.FAIL),
        ("p95 < 5 ms", 59, 0, Verdict.PASS),
        ("p95 < 5 ms with 99 % confidence", 59, 0, Verdict.INCONCLUSIVE),
        ("p99 < 5 ms with 80 % confidence", 200, 0, Verdict.PASS),
        ("p99 < 5 ms over 200 repeats", 200, 0, Verdict.INCONCLUSIVE),
        ("p99 < 5 ms over 500 repeats", 300, 0, Verdict.INCONCLUSIVE),
        ("p99 < 5 ms over 500 repeats", 280, 20, Verdict.FAIL),
        ("every < 5 ms over 20 repeats", 19, 0, Verdict.INCONCLUSIVE),
        ("every < 5 ms over 20 repeats", 0, 1, Verdict.FAIL),
        ("p50 < 5 ms", 1, 1, Verdict.INCONCLUSIVE),
        ("p50 < 5 ms", 0, 5, Verdict.FAIL),
    ],
)
def test_a_verdict_is_what_so_many_misses_allow(bound: str, fast: int, slow: int, verdict: Verdict) -> None:
    assert judge(durations(fast, slow), parse_bound(bound)).verdict is verdict


@settings(deadline=None)
@given(n=st.integers(1, 600), misses=st.integers(0, 60), percent=st.sampled_from([50, 90, 95, 99]))
def test_a_quantile_passes_just_if_the_greatest_miss_rate_allows_it(n: int, misses: int, percent: int) -> None:
    misses = min(n, misses)
    passed = judge(durations(n - misses, misses), parse_bound(f"p{percent} < 5 ms")).passed
    rate = greatest_miss_rate(misses, n, 0.05)
    if abs(rate - (1 - percent / 100)) > 1e-9:
        assert passed == (rate < 1 - percent / 100)


@pytest.mark.parametrize(
    ("bound", "fast", "slow", "why"),
    [
        ("p99 < 5 ms", 200, 0, "which shows p98.5 with 95 % confidence, not p99: that needs 299 repeats [few-repeats]"),
        ("p99 < 5 ms over 400 repeats", 200, 0, "that needs 400 repeats [few-repeats]"),
        ("p99 < 5 ms over 400 repeats", 300, 0, "over 400 repeats, but 300 were made [few-repeats]"),
        ("p99 < 5 ms", 300, 2, "2 missed it, and with no more misses 628 repeats would pass [undecided]"),
        ("p99 < 5 ms", 280, 20, "p99 of 300 repeats is 9 ms, with 95 % confidence at least 9 ms, limit 5 ms"),
        ("every < 5 ms", 299, 0, "with 95 % confidence at most 1 % of repeats miss it; noise was not measured"),
        ("every < 5 ms", 9, 1, "1 of 10 repeats missed 5 ms, the longest took 9 ms"),
    ],
)
def test_a_reason_says_what_was_seen_and_how_much_more_is_needed(bound: str, fast: int, slow: int, why: str) -> None:
    assert why in judge(durations(fast, slow), parse_bound(bound)).why


def test_what_the_reason_says_is_shown_does_pass() -> None:
    assert judge(durations(200, 0), parse_bound("p98.5 < 5 ms")).passed
    assert not judge(durations(200, 0), parse_bound("p98.6 < 5 ms")).passed


@pytest.mark.parametrize(("bound", "worst"), [("every < 5 ms", 4_900_000), ("p99 < 5 ms", 4_900_000)])
def test_a_pass_is_refused_when_noise_exceeds_its_margin(bound: str, worst: int) -> None:
    taken = [worst] * 600
    noisy = Noise((150_000,) * 6000)
    assert judge(taken, parse_bound(bound), QUIET).passed
    refused = judge(taken, parse_bound(bound), noisy)
    assert refused.verdict is Verdict.INCONCLUSIVE
    assert refused.why.endswith("[noise]") and "150 us" in refused.why


@pytest.mark.parametrize(("bound", "slow"), [("every < 5 ms", 1), ("p99 < 5 ms", 60)])
def test_a_fail_is_refused_when_noise_exceeds_its_margin(bound: str, slow: int) -> None:
    taken = durations(300 - slow, slow, 5_100_000)
    assert judge(taken, parse_bound(bound), QUIET).verdict is Verdict.FAIL
    refused = judge(taken, parse_bound(bound), Noise((150_000,) * 6000))
    assert refused.verdict is Verdict.INCONCLUSIVE
    assert refused.why.endswith("[noise]") and "150 us" in refused.why


def test_rare_noise_speaks_against_every_but_not_against_a_quantile() -> None:
    rare = Noise((10_000,) * 5999 + (50 * MS,))
    assert judge([2 * MS] * 600, parse_bound("p99 < 5 ms"), rare).passed
    assert judge([2 * MS] * 600, parse_bound("every < 5 ms"), rare).why.endswith("but noise reached 50 ms [noise]")


def test_too_few_samples_of_noise_carry_no_verdict_and_it_says_how_many_do() -> None:
    few, bound = Noise((10_000,) * 300), parse_bound("p99 < 5 ms")
    assert "300 samples of noise are too few for it: 368 are needed" in judge(durations(600, 0), bound, few).why
    assert judge(durations(600, 0), bound, Noise((10_000,) * 368)).passed
    assert "300 samples of noise are too few for it: 1843 are needed" in judge(durations(600, 60), bound, few).why
    assert judge(durations(600, 60), bound, Noise((10_000,) * 1843)).verdict is Verdict.FAIL
    one = judge(durations(299, 1), parse_bound("every < 5 ms"), few)
    assert one.verdict is Verdict.INCONCLUSIVE and "5700 are enough [noise]" in one.why
    assert judge(durations(299, 1), parse_bound("every < 5 ms"), Noise((10_000,) * 5700)).verdict is Verdict.FAIL
    assert judge(durations(290, 10), parse_bound("every < 5 ms"), few).verdict is Verdict.FAIL, "ten are no chance"


def test_misses_that_noise_may_have_added_to_are_no_fail() -> None:
    taken = durations(293, 7)
    assert judge(taken, parse_bound("p99 < 5 ms")).verdict is Verdict.FAIL
    assert "may be due to noise: more repeats would tell [noise]" in judge(taken, parse_bound("p99 < 5 ms"), QUIET).why
    assert judge(durations(288, 12), parse_bound("p99 < 5 ms"), QUIET).verdict is Verdict.FAIL


@pytest.mark.parametrize("noise", [None, QUIET, Noise((3600 * 1000 * MS,) * 6000)])
def test_repeats_that_never_end_fail_whatever_the_noise(noise: Noise | None) -> None:
    for bound in ("every < 5 ms", "p99 < 5 ms"):
        found = judge(durations(250, 50, NEVER), parse_bound(bound), noise)
        assert found.verdict is Verdict.FAIL and "never" in found.why


def test_a_single_repeat_that_never_ends_is_no_noise() -> None:
    assert judge(durations(299, 1, NEVER), parse_bound("every < 5 ms"), Noise((9_000,) * 10)).verdict is Verdict.FAIL


def in_spells(n: int, rate: float, length: int, seed: int) -> np.ndarray:
    """Repeats of 2 ms, of which a share `rate` takes 9 ms, in spells of `length` that begin whenever they like."""
    begins = np.random.default_rng(seed).random(n + length) < rate / length
    slow = np.convolve(begins, np.ones(length), mode="full")[length : length + n] > 0
    return np.where(slow, 9 * MS, 2 * MS)


def test_misses_in_spells_are_no_more_than_one_miss_a_spell() -> None:
    spell = [2 * MS] * 290 + [9 * MS] * 10
    bound = parse_bound("p99 < 5 ms")
    assert judge(durations(290, 10), bound).verdict is Verdict.FAIL
    found = judge(spell, bound)
    assert found.verdict is Verdict.INCONCLUSIVE
    assert "spells of about 10.0" in found.why and "300 count as 30" in found.why


@pytest.mark.parametrize("length", [1, 3, 10])
def test_bursts_fail_a_bound_that_holds_in_no_more_runs_than_the_confidence_allows(length: int) -> None:
    verdicts = [judge(in_spells(600, 0.0099, length, seed), parse_bound("p99 < 5 ms")).verdict for seed in range(400)]
    assert verdicts.count(Verdict.FAIL) <= 0.05 * 400 + 2.0 * (0.05 * 0.95 * 400) ** 0.5


def test_a_bound_that_names_its_spells_is_not_passed_by_luck() -> None:
    def passes(bound: str) -> int:
        return sum(judge(in_spells(600, 0.0101, 10, seed), parse_bound(bound)).passed for seed in range(200))

    assert passes("p99 < 5 ms") > 60, "spells that did not occur cannot be seen"
    assert passes("p99 < 5 ms in spells of 10") == 0
    assert judge([2 * MS] * 2990, parse_bound("p99 < 5 ms in spells of 10")).passed


def test_a_pass_says_how_long_spells_may_be() -> None:
    assert "misses in spells of up to 10 would have shown" in judge([2 * MS] * 2990, parse_bound("p99 < 5 ms")).why


def test_independent_repeats_are_seldom_taken_for_dependent_ones() -> None:
    stream = np.random.default_rng(4)
    seen = [dependence(stream.integers(0, 1000, 300), 989).is_seen for _ in range(400)]
    assert sum(seen) <= 0.05 * 400


@pytest.mark.parametrize("given", [[[1, 2]], [-1], ["1"], [float("nan")], [True], [2**64], [2**63], [1e300]])
def test_what_is_no_row_of_durations_is_refused(given: list[object]) -> None:
    with pytest.raises(BadRequest, match=r"\[timing-durations\]"):
        judge(given, parse_bound("every < 5 ms"))  # type: ignore[arg-type]


def test_no_durations_are_no_pass() -> None:
    with pytest.raises(BadRequest, match=r"at least one repeat.*\[empty-trace\]"):
        judge([], parse_bound("every < 5 ms"))
