"""Prints how often a timing verdict on p99 < 5 ms is wrong where misses come in spells (docs/timing.md).

A share of the repeats just below or just above 1 % misses the limit, in spells of 1 to 30 repeats that start at random.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import judge, parse_bound

RUNS = 600
MS = 1_000_000


def repeats(n: int, rate: float, spell: int, stream: np.random.Generator) -> NDArray[np.int64]:
    """Return n durations [ns], shape (n,): a share `rate` takes 9 ms, all others 1 to 4 ms."""
    starts = stream.random(n + spell) < rate / spell
    slow = np.convolve(starts, np.ones(spell))[spell : n + spell] > 0
    return np.where(slow, 9 * MS, stream.integers(MS, 4 * MS, n))


def share(verdict: Verdict, n: int, rate: float, spell: int, bound: str) -> float:
    """Return how often a verdict comes out."""
    stream = np.random.default_rng(2)
    found = [judge(repeats(n, rate, spell, stream), parse_bound(bound)).verdict for _ in range(RUNS)]
    return found.count(verdict) / RUNS


if __name__ == "__main__":
    print("repeats  spell  wrong pass  wrong pass, spells named  wrong fail")
    for n in (300, 600, 3000):
        for spell in (1, 3, 10, 30):
            passes = share(Verdict.PASS, n, 0.0101, spell, "p99 < 5 ms")
            named = share(Verdict.PASS, n, 0.0101, spell, f"p99 < 5 ms in spells of {spell}")
            fails = share(Verdict.FAIL, n, 0.0099, spell, "p99 < 5 ms")
            print(f"{n:7} {spell:6} {passes:11.1%} {named:25.1%} {fails:11.1%}")
