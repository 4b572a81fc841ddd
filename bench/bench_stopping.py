"""Prints how often campaigns that end by a rule are right about the rate: by our rules, and by ordinary intervals.

python bench/bench_stopping.py [--campaigns 10000]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from parcours.study.stopping import parse_rule
from parcours.verdict.sequential import bounds_at_any_time

SHARD = 256  # cases between two looks

# what is asked, the true rates of the blocks that cases go through in turn, and how many cases there are at most
CASES: tuple[tuple[str, tuple[float, ...], int], ...] = (
    ("stuck ± 0.5%", (0.07,), 80_000),
    ("stuck ± 2%", (0.5,), 20_000),
    ("stuck ± 2%", (0.0, 0.02, 0.3), 20_000),
    ("stuck ± 1%", (0.003,), 20_000),
    ("contacts < 5%", (0.05,), 20_000),
    ("contacts < 5%", (0.045,), 40_000),
    ("contacts < 1e-3", (0.001,), 40_000),
    ("contacts < 1e-3", (0.0005,), 40_000),
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of synthetic campaigns under one rule."""

    right: float  # share whose interval at the end holds the true rate
    always_right: float  # share whose interval holds it at every look
    cases: float  # mean number of cases


def wilson_bounds(count: NDArray[np.float64], n: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the ends of ordinary 95 % intervals (Wilson's)."""
    z = NormalDist().inv_cdf(0.975)
    half = z * np.sqrt(count * (n - count) / n + z * z / 4)
    return (count + z * z / 2 - half) / (n + z * z), (count + z * z / 2 + half) / (n + z * z)


def simulated(text: str, rates: tuple[float, ...], most: int, campaigns: int, *, naive: bool) -> Outcome:
    """Return what became of campaigns with that rule, looked at every SHARD cases."""
    rule, rng = parse_rule(text), np.random.default_rng(1)
    looks = most // SHARD
    # of the cases of a shard, each block has about the same number; which has one more goes round
    shares = [np.diff([(k * SHARD + len(rates) - 1 - b) // len(rates) for k in range(looks + 1)])
              for b in range(len(rates))]  # fmt: skip
    counts = sum(rng.binomial(n, p, (campaigns, looks)) for n, p in zip(shares, rates, strict=True))
    seen = np.cumsum(counts, axis=1, dtype=np.float64)
    n, true = np.arange(1, looks + 1) * float(SHARD), float(np.mean(rates))
    values, places = np.unique(seen + n * 1e7, return_inverse=True)  # each (count, n) once
    count_of, n_of = values % 1e7, values // 1e7
    if naive:
        lows, highs = wilson_bounds(count_of, n_of)
    else:
        lows, highs = bounds_at_any_time(count_of, n_of, rule.confidence, rule.concentration)
    low, high = (ends[places.reshape(seen.shape)] for ends in (lows, highs))
    met = 0.5 * (high - low) <= rule.limit if rule.relation == "±" else (high < rule.limit) | (low > rule.limit)
    met[:, -1] = True
    at, row = met.argmax(axis=1), np.arange(campaigns)
    holds = (low <= true) & (true <= high)
    return Outcome(float(holds[row, at].mean()), float(holds.all(axis=1).mean()), float(n[at].mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=10_000)
    campaigns = parser.parse_args().campaigns
    print(f"{campaigns} synthetic campaigns, looked at every {SHARD} cases; 95 % is promised\n")
    print(f"{'rule':18} {'true rates':18} {'right at the end':>18} {'at every look':>14} {'cases':>8}"
          f"   {'by Wilson: end':>15} {'every look':>11} {'cases':>8}")  # fmt: skip
    for text, rates, most in CASES:
        ours, plain = (simulated(text, rates, most, campaigns, naive=naive) for naive in (False, True))
        print(f"{text:18} {', '.join(f'{rate:g}' for rate in rates):18} {ours.right:18.2%} {ours.always_right:14.2%} "
              f"{ours.cases:8.0f}   {plain.right:15.2%} {plain.always_right:11.2%} {plain.cases:8.0f}")  # fmt: skip


if __name__ == "__main__":
    main()
