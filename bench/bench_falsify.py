"""Prints how many simulations `parcours falsify` takes to the first collision, on mutants of RAMP's guard.

python bench/bench_falsify.py [--seeds 50] [--budget 3000] [--rungs 1 2 3] [--peers]   # peers: pip install psy-taliro
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np
from bench_rare import MUTANTS, search_of

from parcours.study.falsifying import Search, falsify
from parcours.study.samplers import Method


def ours(method: Method, mutant: str, seed: int, budget: int) -> tuple[int, bool]:
    """Return how many simulations a search takes, and whether it finds a collision."""
    found = falsify(
        search_of(mutant, seed), seed=seed, budget=budget, method=method, cause="collided",
        progress=lambda what, done, total: None,
    )  # fmt: skip
    return found.simulations, bool(found.cause)


def theirs(
    simulations: Callable[[str, Search, int, int], tuple[int, bool]], peer: str, mutant: str, seed: int, budget: int
) -> tuple[int, bool]:
    """Return the same of a peer."""
    return simulations(peer, search_of(mutant, seed), seed, budget)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--budget", type=int, default=3000)
    parser.add_argument(
        "--rungs",
        type=int,
        nargs="+",
        default=[1, 2, 3],
        choices=range(1, len(MUTANTS) + 1),
        help="of the ladder of mutants, from 1",
    )
    parser.add_argument("--methods", nargs="+", default=get_args(Method), choices=get_args(Method))
    parser.add_argument("--peers", action="store_true", help="others instead of ours")
    given = parser.parse_args()
    ways: dict[str, Callable[[str, int, int], tuple[int, bool]]] = {one: partial(ours, one) for one in given.methods}
    if given.peers:
        from falsify_peers import PEERS, simulations

        ways = {one: partial(theirs, simulations, one) for one in PEERS}
    print(f"{given.seeds} seeds, at most {given.budget} simulations each\n")
    print(
        "| what is changed of `guarded` | collides | method | found by | simulations to the first: median [quartiles] |"
    )
    print("|---|---|---|---|---|")
    ladder = [*MUTANTS.items()]
    for mutant, (_, rate) in (ladder[rung - 1] for rung in given.rungs):
        for method, way in ways.items():
            began = time.process_time()
            runs = [way(mutant, seed, given.budget) for seed in range(1, given.seeds + 1)]
            taken, seen = [one[0] for one in runs], sum(one[1] for one in runs)
            low, middle, high = (f"{one:.0f}" for one in np.quantile(taken, (0.25, 0.5, 0.75)))
            print(f"| {mutant} | {rate:g} | {method} | {seen} | {middle} [{low}, {high}] |", end=" ")
            print(f"<!-- {time.process_time() - began:.0f} s of processor time -->", flush=True)


if __name__ == "__main__":
    main()
