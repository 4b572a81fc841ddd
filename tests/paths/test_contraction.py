"""Contracted networks against the same networks whole: the same least cost, and flows that add up."""

import numpy as np
import pytest

from parcours.paths.circulation import cheapest_flow
from parcours.paths.contraction import Contraction, Flows

UNLIMITED = 1 << 31


def closed_problem(rng: np.random.Generator) -> tuple[Flows, np.ndarray]:
    """Return a circulation with lower bounds as a flow problem, its last arc limited, and the arcs' capacities.

    A ring joins all nodes; chords, loops and parallel arcs come on top. Arcs must be taken up to twice.
    """
    n = int(rng.integers(2, 14))
    chords = rng.integers(0, n, (int(rng.integers(0, n + 2)), 2))
    ring = np.stack([np.arange(n), (np.arange(n) + 1) % n], 1)
    arcs = np.concatenate([chords, ring]).astype(np.int64)
    least = rng.integers(0, 3, len(arcs))
    least[-1] = int(rng.integers(0, 3))
    supplies = np.bincount(arcs[:, 1], least, n) - np.bincount(arcs[:, 0], least, n)
    capacities = np.full(len(arcs), UNLIMITED)
    capacities[-1] = rng.choice([int(rng.integers(0, 12)), UNLIMITED])
    costs = rng.integers(0, 4, len(arcs))
    return Flows(arcs[:, 0], arcs[:, 1], costs, supplies.astype(np.int64), np.arange(len(arcs))), capacities


def balance(problem: Flows, flow: np.ndarray) -> np.ndarray:
    """Return what leaves each node beyond what enters it."""
    n = problem.supplies.size
    return np.bincount(problem.sources, flow, n) - np.bincount(problem.targets, flow, n)


@pytest.mark.parametrize("block", range(4))
def test_the_cheapest_flow_costs_the_same(block: int) -> None:
    rng = np.random.default_rng(block)
    shrunk = 0
    for _ in range(500):
        problem, capacities = closed_problem(rng)
        asked = problem.sources, problem.targets, problem.costs, capacities, problem.supplies
        whole = cheapest_flow(*asked)
        contraction = Contraction(problem, fixed=problem.numbers[-1])
        left = contraction.left
        found = cheapest_flow(left.sources, left.targets, left.costs, capacities[left.numbers], left.supplies)
        assert (whole is None) == (found is None)
        shrunk += left.numbers.size < problem.numbers.size
        if whole is not None and found is not None:
            flow = contraction.flow(found)
            assert (flow >= 0).all() and (flow <= capacities).all()
            assert (balance(problem, flow) == problem.supplies).all()
            assert flow @ problem.costs == whole @ problem.costs
    assert shrunk > 400


def test_a_long_chain_is_one_arc() -> None:
    n = 50_000
    sources = np.arange(n)
    supplies = np.zeros(n, dtype=np.int64)
    supplies[0], supplies[-1] = 7, -7
    chain = Flows(sources, (sources + 1) % n, np.ones(n, dtype=np.int64), supplies, sources)
    contraction = Contraction(chain, fixed=n - 1)
    assert contraction.left.numbers.size <= 1
    assert contraction.flow(np.zeros(contraction.left.numbers.size, dtype=np.int64)).tolist() == [7] * (n - 1) + [0]
