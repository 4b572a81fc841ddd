"""Intervals that are looked at after every case hold the true rate at all times at once, as often as they say."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import binom

from parcours.errors import BadRequest
from parcours.verdict.sequential import bounds_at_any_time, log_evidence, rate_at_any_time

ROOT = Path(__file__).parents[2]


def ever_outside(rate: float, n_cases: int, concentration: float) -> float:
    """Return the exact probability that a rate is ever outside of its intervals: a walk over all counts, no draws."""
    counts = np.arange(n_cases + 1)
    alive, outside = np.zeros(n_cases + 1), 0.0
    alive[0] = 1.0
    for n in range(1, n_cases + 1):
        alive[1:] = alive[1:] * (1.0 - rate) + alive[:-1] * rate
        alive[0] *= 1.0 - rate
        out = log_evidence(rate, counts[: n + 1], n, concentration) >= np.log(20.0)
        outside += alive[: n + 1][out].sum()
        alive[: n + 1][out] = 0.0
    return float(outside)


@pytest.mark.parametrize(("rate", "concentration"), [(0.5, 100.0), (0.07, 10.0), (0.02, 100.0), (0.9, 100.0)])
def test_the_exact_probability_of_ever_being_wrong_is_at_most_what_was_promised(
    rate: float, concentration: float
) -> None:
    wrong = ever_outside(rate, 800, concentration)
    assert 0.001 < wrong <= 0.05  # and it is used: intervals are not wider than they need be by far


def test_ends_are_where_the_evidence_reaches_twenty_and_nothing_within_is_spoken_against() -> None:
    rng = np.random.default_rng(3)
    n = rng.integers(1, 100_000, 60)
    count = rng.binomial(n, rng.choice([0.0, 1e-4, 0.03, 0.5, 0.97, 1.0], 60))
    for concentration in (1.0, 100.0, 5000.0):
        low, high = bounds_at_any_time(count, n, 0.95, concentration)
        assert ((low <= count / n) & (count / n <= high) & (low >= 0.0) & (high <= 1.0)).all()
        within = low[:, None] + (high - low)[:, None] * np.linspace(1e-6, 1.0 - 1e-6, 200)
        spoken = log_evidence(within, count[:, None], n[:, None], concentration)
        assert (spoken < np.log(20.0) + 1e-6).all()
        sharp = [(low, count > 0), (high, count < n)]
        for ends, inner in sharp:
            at = log_evidence(ends[inner], count[inner], n[inner], concentration)
            assert at == pytest.approx(np.log(20.0), abs=1e-6)


def test_the_evidence_has_an_expectation_of_one_at_every_time() -> None:
    for n in (1, 7, 300):
        counts = np.arange(n + 1)
        chances = binom.pmf(counts, n, 0.3)
        assert float((chances * np.exp(log_evidence(0.3, counts, n, 50.0))).sum()) == pytest.approx(1.0, abs=1e-9)


def test_the_closed_form_is_that_of_the_package_confseq() -> None:
    for (
        rate,
        count,
        n,
        v_opt,
        theirs,
    ) in (  # beta_binomial_log_mixture of confseq 0.0.11, which pip does not build
        (0.1, 20, 100, 9.0, 2.5864723598885284),
        (0.3, 20, 100, 40.0, 1.311188150160305),
        (0.07, 70, 905, 100.0, -0.6121267956685301),
    ):
        variance = rate * (1.0 - rate)
        log20 = 2.0 * np.log(20.0)
        concentration = v_opt / (log20 + np.log1p(log20)) / variance - 1.0  # Howard et al., proposition 3
        assert float(log_evidence(rate, count, n, concentration)) == pytest.approx(theirs, abs=1e-3)


def test_without_a_case_nothing_is_known_and_nonsense_is_refused() -> None:
    assert (rate_at_any_time(0, 0).low, rate_at_any_time(0, 0).high) == (0.0, 1.0)
    with pytest.raises(BadRequest, match="counts"):
        rate_at_any_time(3, 2)


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_stopping", ROOT / "bench" / "bench_stopping.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["bench_stopping"] = module
    spec.loader.exec_module(module)
    return module


def test_campaigns_that_end_by_a_rule_are_right_where_ordinary_intervals_are_not(bench: ModuleType) -> None:
    for rates in ((0.05,), (0.0, 0.05, 0.1)):  # drawn like coin tosses, and spread over blocks
        ours = bench.simulated("contacts < 5%", rates, 8_192, 2_000, naive=False)
        assert ours.right >= ours.always_right >= 0.95
    assert bench.simulated("contacts < 5%", (0.05,), 8_192, 2_000, naive=True).right < 0.8
