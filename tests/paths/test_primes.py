from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Machine, Transition
from parcours.paths.criteria.bounded import complete_paths, switches
from parcours.paths.criteria.primes import prime_paths, round_trips, shortest_round_trips, simple_paths
from parcours.paths.criteria.requirement import RequirementCounter, RequirementLimits
from parcours.paths.graph import Graph, Walk, graph_of


@st.composite
def graphs(draw: st.DrawFn, most_states: int = 5, most_more: int = 4) -> Graph:
    states = [f"s{number}" for number in range(draw(st.integers(1, most_states)))]
    tree = [(states[draw(st.integers(0, at - 1))], states[at]) for at in range(1, len(states))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    if draw(st.booleans()):  # without a way back
        ends = ends.map(lambda pair: (min(pair), max(pair))).filter(lambda pair: pair[0] != pair[1] or not tree)
    arcs = draw(st.permutations([*tree, *draw(st.lists(ends, max_size=most_more))]))
    transitions = tuple(Transition(f"t{number}", a, b) for number, (a, b) in enumerate(arcs))
    return graph_of(Machine("m", "s0", tuple(states), transitions))


def random_graph(n_states: int, n_edges: int, seed: int) -> Graph:
    """A ring with chords."""
    rng = np.random.default_rng(seed)
    ring = np.arange(n_states)
    chords = rng.integers(0, n_states, (2, n_edges - n_states))
    sources, targets = np.append(ring, chords[0]), np.append((ring + 1) % n_states, chords[1])
    return Graph("m", tuple(map(str, ring)), tuple(map(str, range(n_edges))), sources, targets, (0,))


def walks(graph: Graph, most: int) -> Iterator[Walk]:
    """All walks of 1 to `most` edges."""
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    here: list[Walk] = [(edge,) for edge in range(len(graph.edges))]
    for _ in range(most):
        yield from here
        here = [(*w, edge) for w in here for edge in range(len(graph.edges)) if sources[edge] == targets[w[-1]]]


def is_simple(graph: Graph, walk: Walk) -> bool:
    states = [int(graph.sources[walk[0]]), *graph.targets[list(walk)].tolist()]
    return len(set(states)) == len(states) or (states[0] == states[-1] and len(set(states)) == len(states) - 1)


def lies_in(short: Walk, long: Walk) -> bool:
    return any(long[at : at + len(short)] == short for at in range(len(long) - len(short) + 1))


def longest(found: set[Walk]) -> set[Walk]:
    return {walk for walk in found if not any(walk != other and lies_in(walk, other) for other in found)}


@given(graphs())
@settings(max_examples=200)
def test_prime_paths_are_the_simple_paths_in_no_other_simple_path(graph: Graph) -> None:
    simple = {walk for walk in walks(graph, len(graph.states)) if is_simple(graph, walk)}
    found = prime_paths(graph)
    assert set(found) == longest(simple)
    assert len(set(found)) == len(found)


@given(graphs())
@settings(max_examples=100)
def test_round_trips_are_the_prime_paths_that_return(graph: Graph) -> None:
    closed = [walk for walk in prime_paths(graph) if graph.sources[walk[0]] == graph.targets[walk[-1]]]
    assert round_trips(graph) == closed


@given(graphs())
@settings(max_examples=100)
def test_each_state_on_a_round_trip_gets_one(graph: Graph) -> None:
    some = shortest_round_trips(graph)
    assert set(some) <= set(round_trips(graph))
    assert [graph.sources[walk[0]] for walk in some] == sorted({graph.sources[walk[0]] for walk in round_trips(graph)})


def test_prime_paths_grow_with_parallel_edges() -> None:
    sources, targets = np.array([0, 0, 1, 1, 1]), np.array([1, 1, 2, 2, 2])
    assert len(prime_paths(Graph("m", ("a", "b", "c"), tuple("vwxyz"), sources, targets, (2,)))) == 2 * 3


def test_the_complete_graph_has_as_many_prime_paths_as_orderings_and_cycles() -> None:
    n = 6
    sources, targets = np.divmod(np.array([at for at in range(n * n) if at // n != at % n]), n)
    graph = Graph("m", tuple(map(str, range(n))), tuple(map(str, range(n * n - n))), sources, targets, (0,))
    cycles = sum(int(np.prod(range(n - k + 1, n + 1))) for k in range(2, n + 1))
    assert len(prime_paths(graph)) == cycles  # a path through all states closes to a cycle here, so it is not prime


def test_a_search_that_mostly_ends_nowhere_is_still_short() -> None:
    # Down this ladder there are 2 ** 40 ways; the goal lies beside its first rung.
    rungs, targets, onward = 40, [], []
    for rung in range(rungs):
        onward += [[4 * rung, 4 * rung + 1], [4 * rung + 2, 4 * rung + 3]]
        targets += [2 * rung + 2, 2 * rung + 3, 2 * rung + 2, 2 * rung + 3]
    goal = len(onward) + 2
    onward += [[], [], []]
    onward[0].append(len(targets))
    targets.append(goal)
    tally = RequirementCounter(RequirementLimits(work=1_000_000), "ladder")
    found = list(simple_paths(0, targets, (onward, onward), {goal: [len(targets)]}, None, tally))
    assert found == [(len(targets) - 1, len(targets))]


def test_too_many_prime_paths_are_refused_with_the_count_reached() -> None:
    graph = random_graph(100, 300, seed=1)
    with pytest.raises(BadRequest, match=r"prime paths of 'm': .*at most 5000, .*stopped at 5001.*\[too-many-requ"):
        prime_paths(graph, RequirementLimits(count=5000))
    with pytest.raises(BadRequest, match=r"at most 1000 steps .*stopped at \d+.*\[too-many-requirements\]"):
        prime_paths(graph, RequirementLimits(steps=1000))
    with pytest.raises(BadRequest, match=r"so few that 50000 steps of the search find them.*stopped at \d+"):
        prime_paths(graph, RequirementLimits(work=50_000))


@given(graphs(4, 2), st.integers(0, 3))
@settings(max_examples=80)
def test_switches_are_the_walks_up_to_a_length_that_lie_in_no_longer_one(graph: Graph, n: int) -> None:
    found = switches(graph, n)
    assert set(found) == longest(set(walks(graph, n + 1)))
    assert len(set(found)) == len(found)


@given(graphs(4, 3), st.integers(1, 5))
@settings(max_examples=100)
def test_complete_paths_lead_from_the_start_to_a_final_state(graph: Graph, most: int) -> None:
    ends = set(graph.finals)
    whole = {w for w in walks(graph, most) if graph.sources[w[0]] == 0 and graph.targets[w[-1]] in ends}
    found = complete_paths(graph, most)
    assert set(found) == whole
    assert len(set(found)) == len(found)


def test_walks_of_any_length_are_refused_or_found_without_recursion() -> None:
    ring = random_graph(50, 50, seed=0)
    assert list(map(len, switches(ring, 9999))) == [10_000] * 50
    assert list(map(len, complete_paths(ring, 200))) == [50, 100, 150, 200]
    for n in (10**6, 10**9 - 1):
        with pytest.raises(BadRequest, match=r"\[too-many-requirements\]"):
            switches(random_graph(50, 60, seed=0), n, RequirementLimits(work=200_000))
    with pytest.raises(BadRequest, match=r"complete paths of 'm' up to 999999999: .*\[too-many-requirements\]"):
        complete_paths(ring, 10**9 - 1, RequirementLimits(count=1000))


def test_a_long_way_round_is_found_without_recursion() -> None:
    ring = random_graph(800, 800, seed=0)
    assert {len(path) for path in prime_paths(ring)} == {800}
