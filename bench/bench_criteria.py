"""How long requirements, covers and measures take on random machines, over three decades of their size.

python bench/bench_criteria.py            covers of edges and edge pairs up to 10 000 transitions
python bench/bench_criteria.py --large    up to 100 000

A machine is a ring through all states with chords at random, so every state leads back; there are four transitions for
three states. The ratio compares the time with that of the size before; 10 is linear.
"""

from __future__ import annotations

import argparse
import gc
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import TypeVar

import numpy as np

from parcours.errors import BadRequest
from parcours.model.structure import Machine, Transition
from parcours.paths import measure, requirements
from parcours.paths.covering import cover_demand
from parcours.paths.criteria import Demand, demands, parse_criterion
from parcours.paths.graph import graph_of
from parcours.paths.measuring import Tours


def random_machine(n_transitions: int, seed: int = 0, *, sparse: int = 0) -> Machine:
    """Return a machine with three states for four transitions, or as many chords as `sparse` says."""
    n_states = n_transitions - sparse if sparse else 3 * n_transitions // 4
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, n_states, (n_transitions - n_states, 2)).tolist()
    arcs = [*((state, (state + 1) % n_states) for state in range(n_states)), *ends]
    names = tuple(f"s{state}" for state in range(n_states))
    return Machine("m", "s0", names, tuple(Transition(f"t{n}", names[a], names[b]) for n, (a, b) in enumerate(arcs)))


Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[float, Result]:
    """Return how long it took [s], and its result."""
    begun = time.perf_counter()
    result = work()
    return time.perf_counter() - begun, result


def _demand(machine: Machine, criterion: str) -> Demand:
    return demands(machine, parse_criterion(criterion))[0]


def covers(criterion: str, sizes: list[int]) -> Iterator[str]:
    before = 0.0
    for size in sizes:
        machine = random_machine(size)
        asking, asked = timed(partial(_demand, machine, criterion))
        solving, found = timed(partial(cover_demand, asked))
        ids = [[asked.graph.edges[edge] for edge in path] for path in found.paths]
        measuring, coverage = timed(partial(measure, machine, criterion, *ids))
        assert not coverage.missed
        total = asking + solving
        ratio = f"{total / before:5.1f}" if before else "    -"
        gap = (found.length - found.shortest) / found.shortest
        yield (
            f"{criterion:>10} {size:>8} {len(asked.goals):>8} {asking:8.3f} {solving:8.3f} {ratio} {measuring:8.3f}"
            f" {len(found.paths):>6} {found.length:>8} {gap:7.2%}"
        )
        before = total


def primes(sizes: list[tuple[int, int]]) -> Iterator[str]:
    for n_states, n_transitions in sizes:
        machine = random_machine(n_transitions, 1, sparse=n_transitions - n_states)
        begun = time.perf_counter()
        try:
            answer = f"{len(requirements(machine, 'prime')):>8} prime paths"
        except BadRequest as refusal:
            answer = f"refused: {refusal.where}: {refusal.rule}"
        yield f"{n_states:>8} {n_transitions:>8} {time.perf_counter() - begun:8.3f} {answer}"


def trace(n_steps: int) -> Iterator[str]:
    machine = random_machine(1000)
    graph = graph_of(machine)
    leaving, targets = graph.leaving(), graph.targets.tolist()
    rng = np.random.default_rng(0)
    state, run = 0, []
    for draw in rng.integers(0, 1 << 30, n_steps).tolist():
        edge = leaving[state][draw % len(leaving[state])]
        run.append(graph.edges[edge])
        state = targets[edge]
    ways: tuple[Tours, ...] = ("direct", "sidetrips", "detours")
    for criterion in ("node", "edge", "edge-pair", "3-switch", "simple-round-trip"):
        for tours in ways:
            took, coverage = timed(partial(measure, machine, criterion, run, tours=tours))
            yield f"{criterion:>18} {tours:>10} {took:8.3f} {len(coverage.required):>8} {coverage.ratio:7.1%}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--large", action="store_true", help="covers of edges and edge pairs up to 100 000 transitions")
    chosen = parser.parse_args()
    gc.set_threshold(100_000, 50, 50)  # as the command line does
    print(
        "covers [s]: transitions, requirements, asking, covering, ratio, measuring, paths, length, gap to lower bound"
    )
    largest = [100_000] if chosen.large else []
    for line in covers("edge", [1000, 10_000, *largest]):
        print(line, flush=True)
    for line in covers("edge-pair", [100, 1000, 10_000, *largest]):
        print(line, flush=True)
    for line in covers("prime", [10, 20, 40]):
        print(line, flush=True)
    print("prime paths [s]: states, transitions, time, answer")
    for line in primes([(10, 30), (20, 40), (30, 60), (100, 110), (1000, 1010), (100, 300), (10_000, 30_000)]):
        print(line, flush=True)
    print("measuring a run of 1 000 000 steps of a machine with 1000 transitions [s]: time, requirements, met")
    for line in trace(1_000_000):
        print(line, flush=True)


if __name__ == "__main__":
    main()
