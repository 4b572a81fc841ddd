"""Prints how many simulations `parcours falsify` takes to the first collision, on mutants of RAMP's guard.

python bench/bench_falsify.py [--seeds 50] [--budget 3000] [--mutants 3]
"""

from __future__ import annotations

import argparse
import time
from typing import get_args

import numpy as np
from bench_rare import MUTANTS, search_of

from parcours.study.falsifying import Method, falsify


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--budget", type=int, default=3000)
    parser.add_argument("--mutants", type=int, default=3, help="how many rungs of the ladder, from the first")
    given = parser.parse_args()
    print(f"{given.seeds} seeds, at most {given.budget} simulations each\n")
    print(
        "| what is changed of `guarded` | collides | method | found by | simulations to the first: median [quartiles] |"
    )
    print("|---|---|---|---|---|")
    for mutant, (_, rate) in list(MUTANTS.items())[: given.mutants]:
        for method in get_args(Method):
            began, taken, seen = time.process_time(), [], 0
            for seed in range(1, given.seeds + 1):
                found = falsify(
                    search_of(mutant, seed), seed=seed, budget=given.budget, method=method, cause="collided",
                    progress=lambda what, done, total: None,
                )  # fmt: skip
                taken.append(found.simulations)
                seen += bool(found.cause)
            low, middle, high = (f"{one:.0f}" for one in np.quantile(taken, (0.25, 0.5, 0.75)))
            print(f"| {mutant} | {rate:g} | {method} | {seen} | {middle} [{low}, {high}] |", end=" ")
            print(f"<!-- {time.process_time() - began:.0f} s of processor time -->", flush=True)


if __name__ == "__main__":
    main()
