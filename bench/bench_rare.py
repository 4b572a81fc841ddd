"""Prints how often `parcours rare` is right: where the probability is known, and on mutants of RAMP's guard.

python bench/bench_rare.py [--known 100] [--probabilities 1e-7] [--budget 20000] [--mutants 1]
                            [--mutant-budget 50000] [--brute 0]
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel, split
from parcours.streams import starts, uniforms
from parcours.study.falsifying import Search
from parcours.study.splitting import Rarity, estimate
from parcours.verdict.statistics import wilson
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.study.falsifying import PlannerSearch
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.system.study import system_study

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# what is changed of `guarded`, and the rate of collisions that long campaigns have shown; 0 where none is known
MUTANTS: dict[str, tuple[dict[str, float], float]] = {
    "guard_horizon=0.2": ({"guard_horizon": 0.2}, 2e-2),
    "guard_horizon=0.3, guard_margin=0": ({"guard_horizon": 0.3, "guard_margin": 0.0}, 6e-3),
    "plan_margin=0, guard_margin=0": ({"plan_margin": 0.0, "guard_margin": 0.0}, 1.6e-3),
    "guard_horizon=0.4, guard_margin=0": ({"guard_horizon": 0.4, "guard_margin": 0.0}, 2.3e-4),
    "guard_margin=0": ({"guard_margin": 0.0}, 1.3e-4),
    "guard_horizon=0.4, guard_margin=0.01": ({"guard_horizon": 0.4, "guard_margin": 0.01}, 1e-5),
    "guard_margin=0.01": ({"guard_margin": 0.01}, 4e-6),
    "guard_margin=0.015": ({"guard_margin": 0.015}, 1e-6),
}


CUBE = InputModel("cube", tuple(split(name, "1", [0.0, 0.5, 1.0]) for name in "xyz"))


@dataclasses.dataclass(frozen=True)
class Corner:
    """Fails with a known probability: where three inputs, and a number drawn beside them, are all large."""

    probability: float
    inputs: InputModel = CUBE
    event: str = "all are large"
    study: object = None
    period: int = 1

    def prepare(self) -> bool:
        """Say that workers may be forked."""
        return True

    def drawn(self, numbers: Integers) -> Floats:
        """Return uniform values."""
        return uniforms(starts(3, numbers, 1), 0, 3)

    def settled(self, values: Floats, numbers: Integers) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the values: all are taken."""
        return values, np.ones(len(values), bool)

    def simulate(self, values: Floats, numbers: Integers) -> tuple[Floats, Sequence[Sequence[str]]]:
        """Return how far cases are from the corner."""
        other = uniforms(starts(3, numbers, 2), 0, 1)
        far: Floats = 1.0 - self.probability**0.25 - np.concatenate([values, other], axis=1).min(axis=1)
        return far, [("large",) if one < 0.0 else () for one in far]

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        """Write nothing."""
        return []


def search_of(mutant: str, seed: int) -> PlannerSearch:
    """Return the cases of a mutant."""
    study = dataclasses.replace(system_study("guarded", seed=seed), parameters=guarded(**MUTANTS[mutant][0]))
    return PlannerSearch(study, Scenario(), {})


def found(search: Search, seed: int, budget: int) -> Rarity:
    """Return an estimate, by two workers."""
    return estimate(search, seed=seed, budget=budget, workers=2, progress=lambda what, done, total: None)


def known(n: int, budget: int, probabilities: Sequence[float]) -> None:
    """Print how often intervals hold a probability that is known, and how often they lie within half of it."""
    for probability in probabilities:
        ones = [found(dataclasses.replace(Corner(probability), study=Corner(1.0)), seed, budget) for seed in range(n)]
        held = sum(one.low <= probability <= one.high for one in ones)
        ends = [np.quantile([getattr(one, end) for one in ones], 0.5) / probability for end in ("low", "high")]
        near = sum(one.low >= 0.5 * probability and one.high <= 1.5 * probability for one in ones)
        mean = np.mean([one.probability for one in ones]) / probability
        print(f"{probability:g}: held by {held} of {n} intervals, {near} within 50 % of it; "
              f"their medians [{ends[0]:.2f}, {ends[1]:.2f}] of it, "
              f"mean estimate {mean:.2f} of it; {np.mean([one.simulations for one in ones]):.0f} simulations; "
              f"without a lower end {sum(one.low == 0.0 for one in ones)}", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--known", type=int, default=100, help="estimates of each known probability")
    parser.add_argument("--probabilities", type=float, nargs="+", default=[1e-4, 1e-5, 1e-7])
    parser.add_argument("--budget", type=int, default=20_000)
    parser.add_argument("--mutants", type=int, default=1, help="estimates of each mutant")
    parser.add_argument("--mutant-budget", type=int, default=50_000)
    parser.add_argument("--brute", type=int, default=0, help="cases of a campaign of each mutant, beside")
    given = parser.parse_args()
    if given.known:
        known(given.known, given.budget, given.probabilities)
    for mutant, (_, rate) in MUTANTS.items() if given.mutants else ():
        held = 0
        for seed in range(1, given.mutants + 1):
            began = time.perf_counter()
            one = found(search_of(mutant, seed), seed, given.mutant_budget)
            held += one.low <= rate <= one.high
            print(
                f"{mutant}, {rate:g}; {time.perf_counter() - began:.0f} s; {one}; founders {one.founders}", flush=True
            )
        print(f"{mutant}: the rate is held by {held} of {given.mutants}")
        if given.brute:
            search, count = search_of(mutant, 1000), 0
            for first in range(0, given.brute, 2000):
                numbers = np.arange(first, min(first + 2000, given.brute))
                count += int((search.simulate(search.drawn(numbers), numbers)[0] < 0.0).sum())
            seen = wilson(count, given.brute)
            print(f"{mutant}: {count} of {given.brute}, {seen.share:.3g} [{seen.low:.3g}, {seen.high:.3g}]", flush=True)


if __name__ == "__main__":
    main()
