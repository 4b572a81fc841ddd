"""Steps per second of online walks, on random machines over three decades of transitions, and on the model of RAMP.

Usage: python bench/bench_walking.py [--steps 1000000]
"""

from __future__ import annotations

import argparse
import resource
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

import parcours_ramp
from parcours.model import read_model
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.paths.walking import WALKERS, GraphSpace, ModelSpace, Walk, phase

RAMP = Path(parcours_ramp.__file__).parent / "components" / "model.yaml"


def random_machine(n_transitions: int) -> Cefsm:
    """Return a strongly connected machine: a ring of half the transitions, and as many chords at random."""
    n = n_transitions // 2
    ends = np.random.default_rng(1).integers(0, n, (n_transitions - n, 2)).tolist()
    ring = [Transition(f"r{k}", f"s{k}", f"s{(k + 1) % n}") for k in range(n)]
    chords = [Transition(f"c{k}", f"s{a}", f"s{b}") for k, (a, b) in enumerate(ends)]
    machine = Machine("ring", "s0", tuple(f"s{k}" for k in range(n)), (*ring, *chords))
    return Cefsm("bench", (Component("A", (machine,)),))


def measure(what: str, space: ModelSpace, walker: str, until: str) -> float:
    """Walk, print what it took, and return the time for one step [s]."""
    walk = Walk(space, [phase(walker, until)], np.random.default_rng(1))
    began = time.perf_counter()
    for _ in walk:
        pass
    taken = time.perf_counter() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    edges = walk.tallies.of["edge"].ratio
    print(
        f"{what:<22} {walker:<14} {walk.steps:>9} steps {taken:7.2f} s {walk.steps / taken:>9.0f} steps/s"
        f"  edges {edges:7.2%}  peak {memory:.0f} MB"
    )
    return taken / walk.steps


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--steps", type=int, default=1_000_000)
    steps = options.parse_args().steps
    for walker in WALKERS:
        costs = []
        for size in (100, 1_000, 10_000, 100_000):
            # A guided walk is over when all is covered; the others walk on, to show that memory stays flat.
            until = f"edge>=100% or steps>={steps}" if walker == "guided" else f"steps>={steps}"
            if walker == "guided" and size == 100_000:
                until = "edge>=80%"
            costs.append(measure(f"graph, {size} transitions", GraphSpace(random_machine(size)), walker, until))
        ratios = ", ".join(f"{after / before:.2f}" for before, after in pairwise(costs))
        print(f"{'':<22} {walker:<14} cost of a step from decade to decade: x {ratios}\n")
    ramp = read_model(RAMP)
    for walker in ("random", "weighted", "least-visited"):
        measure("RAMP, guards evaluated", ModelSpace(ramp), walker, f"steps>={steps}")


if __name__ == "__main__":
    main()
