"""Prints how many simulations `parcours falsify` takes to the first collision, on mutants of RAMP's guard.

python bench/bench_falsify.py [--seeds 50] [--budget 3000] [--rungs 1 2 3] [--methods evolution]
                               [--peers NAME=PYTHON]   # see falsify_peers.py
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from collections.abc import Callable
from functools import partial
from typing import get_args

import falsify_peers
import numpy as np
from bench_rare import MUTANTS, search_of

from parcours.study.cube import Cube
from parcours.study.falsifying import falsify
from parcours.study.samplers import Method


def ours(method: Method, mutant: str, seed: int, budget: int) -> tuple[int, bool]:
    """Return how many simulations a search takes, and whether it finds a collision."""
    found = falsify(
        search_of(mutant, seed), seed=seed, budget=budget, method=method, cause="collided",
        progress=lambda what, done, total: None,
    )  # fmt: skip
    return found.simulations, bool(found.cause)


class Peers:
    """Falsifiers by others, in one process of another Python that searches one after the other."""

    def __init__(self, python: str) -> None:
        command, self._python = [python, falsify_peers.__file__], python
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def search(self, method: str, mutant: str, seed: int, budget: int) -> tuple[int, bool]:
        """Return the same of a peer.

        Constraints are unknown to it, so what they refuse is far from failing and costs no simulation.
        """
        search = search_of(mutant, seed)
        cube, asked, taken, found = Cube(search.inputs), 0, 0, False
        self._send([method, cube.n, seed, budget])
        while (point := self._received()) is not None:
            values, asked, near = cube.values(np.array([point])), asked + 1, falsify_peers.FARTHEST
            if cube.allows(values)[0]:
                [far], [causes] = search.simulate(values, np.array([taken]))
                found, taken = any(one.startswith("collided") for one in causes), taken + 1
                near = min(max(float(far), 0.0), near)
            self._send(None if found or taken == budget or asked == 10 * budget else near)
        return taken, found

    def _send(self, what: object) -> None:
        print(json.dumps(what), file=self._process.stdin, flush=True)

    def _received(self) -> list[float] | None:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise SystemExit(f"{self._python}: a peer must answer, but it ended; see above")
        point: list[float] | None = json.loads(line)
        return point


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
    parser.add_argument("--methods", nargs="*", default=get_args(Method), choices=get_args(Method), help="ours")
    parser.add_argument(
        "--peers",
        nargs="+",
        default=[],
        metavar="NAME=PYTHON",
        help=f"beside them, all whose name starts with NAME, run by PYTHON: {', '.join(falsify_peers.METHODS)}",
    )
    given = parser.parse_args()
    ways: dict[str, Callable[[str, int, int], tuple[int, bool]]] = {one: partial(ours, one) for one in given.methods}
    for name, python in (one.partition("=")[::2] for one in given.peers):
        named = [one for one in falsify_peers.METHODS if one.startswith(name)]
        if not named or not python:
            parser.error(f"--peers: must be NAME=PYTHON, where {', '.join(falsify_peers.METHODS)} start with NAME")
        peers = Peers(python)
        ways |= {one: partial(peers.search, one) for one in named}
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
