"""Cheapest flows and components of small networks are those of OR-tools and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from ortools.graph.python.min_cost_flow import SimpleMinCostFlow
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from parcours.paths.circulation import cheapest_flow, strong_components
from parcours.paths.graph import components


@pytest.mark.parametrize("seed", range(300))
def test_a_flow_exists_and_costs_as_or_tools_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_nodes, n_arcs = int(rng.integers(2, 12)), int(rng.integers(1, 30))
    sources, targets = rng.integers(0, n_nodes, (2, n_arcs))
    costs, capacities = rng.integers(0, 5, n_arcs), rng.integers(0, 6, n_arcs)
    supplies = np.zeros(n_nodes, np.int64)
    for gives, lacks in rng.integers(0, n_nodes, (int(rng.integers(0, 6)), 2)):
        supplies[gives] += 1
        supplies[lacks] -= 1
    solver = SimpleMinCostFlow()
    solver.add_arcs_with_capacity_and_unit_cost(sources, targets, capacities, costs)
    solver.set_nodes_supplies(np.arange(n_nodes), supplies)
    solvable = solver.solve() == SimpleMinCostFlow.OPTIMAL
    flow = cheapest_flow(sources, targets, costs, capacities, supplies)
    assert (flow is not None) == solvable
    if flow is not None:
        assert (flow >= 0).all() and (flow <= capacities).all()
        leaves, enters = (np.bincount(ends, weights=flow, minlength=n_nodes) for ends in (sources, targets))
        assert (leaves - enters == supplies).all()
        assert int(flow @ costs) == solver.optimal_cost()


@pytest.mark.parametrize("seed", range(100))
def test_components_are_scipy_s_numbered_by_their_first_nodes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_nodes, n_arcs = int(rng.integers(1, 30)), int(rng.integers(0, 40))
    sources, targets = rng.integers(0, n_nodes, (2, n_arcs))
    links = coo_array((np.ones(n_arcs), (sources, targets)), shape=(n_nodes, n_nodes))
    for directed in (True, False):
        ours = components(n_nodes, sources, targets, directed=directed)
        theirs = connected_components(links, directed=directed, connection="strong")[1]
        assert len(set(zip(ours.tolist(), theirs.tolist(), strict=True))) == len(set(ours.tolist())) == theirs.max() + 1
        assert list(dict.fromkeys(ours.tolist())) == list(range(ours.max() + 1))


def test_large_graphs_are_numbered_alike() -> None:
    rng = np.random.default_rng(0)
    sources, targets = rng.integers(0, 3000, (2, 4000))
    assert (components(3000, sources, targets) == strong_components(3000, sources, targets)).all()
