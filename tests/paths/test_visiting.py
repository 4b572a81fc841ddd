"""Covers of given sequences: all is visited, the number of paths is the least, the length lies above its bound."""

from __future__ import annotations

import heapq
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Machine, Transition
from parcours.paths.automaton import outermost
from parcours.paths.flow import _circulation
from parcours.paths.graph import Graph, Walk, graph_of
from parcours.paths.joining import Arcs, Integers
from parcours.paths.visiting import cover_sequences


@st.composite
def tasks(draw: st.DrawFn, most_sequences: int = 4) -> tuple[Graph, list[Walk]]:
    n = draw(st.integers(1, 5))
    state = st.integers(0, n - 1)
    ends = [(0, draw(state)), *draw(st.lists(st.tuples(state, state), max_size=8))]
    names = [f"s{each}" for each in range(n)]
    machine = Machine(
        "m", "s0", tuple(names), tuple(Transition(f"t{at}", names[a], names[b]) for at, (a, b) in enumerate(ends))
    )
    graph = graph_of(machine)
    leaving = graph.leaving()
    sequences = []
    for _ in range(draw(st.integers(1, most_sequences))):
        walk = [draw(st.integers(0, len(graph.edges) - 1))]
        for _ in range(draw(st.integers(0, 3))):
            if onward := leaving[graph.targets[walk[-1]]]:
                walk.append(draw(st.sampled_from(onward)))
        sequences.append(tuple(walk))
    return graph, sequences


def contains(path: Walk, sequence: Walk) -> bool:
    return any(path[at : at + len(sequence)] == sequence for at in range(len(path) - len(sequence) + 1))


def is_run(graph: Graph, path: Walk) -> bool:
    here = 0
    for edge in path:
        if graph.sources[edge] != here:
            return False
        here = int(graph.targets[edge])
    return here in graph.finals


def optimum(graph: Graph, sequences: list[Walk]) -> tuple[int, int]:
    """The fewest paths, and with as few the fewest edges, by trying everything (Dijkstra)."""
    reach = max(map(len, sequences))
    heap: list[tuple[int, int, int, Walk, int]] = [(1, 0, 0, (), 0)]
    seen = set()
    while heap:
        paths, length, state, recent, done = heapq.heappop(heap)
        if (state, recent, done) in seen:
            continue
        seen.add((state, recent, done))
        if state in graph.finals:
            if done == (1 << len(sequences)) - 1:
                return paths, length
            if recent:
                heapq.heappush(heap, (paths + 1, length, 0, (), done))
        for edge in np.flatnonzero(graph.sources == state).tolist():
            trail = (*recent, edge)[-reach:]
            gained = sum(1 << at for at, each in enumerate(sequences) if trail[-len(each) :] == each)
            heapq.heappush(heap, (paths, length + 1, int(graph.targets[edge]), trail, done | gained))
    raise AssertionError("no cover exists")


@given(tasks())
def test_no_cover_has_fewer_paths_or_as_few_with_fewer_edges(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    cover = cover_sequences(graph, sequences)
    fewest, shortest = optimum(graph, sequences)
    assert len(cover.paths) == cover.fewest == fewest
    assert cover.length == cover.shortest == shortest


@given(tasks())
def test_where_the_network_is_large_the_bound_on_the_length_is_one(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    with patch("parcours.paths.joining.LARGEST", 0):
        cover = cover_sequences(graph, sequences)
    fewest, shortest = optimum(graph, sequences)
    assert len(cover.paths) == cover.fewest == fewest
    assert cover.shortest <= shortest <= cover.length


@given(tasks(most_sequences=12))
def test_every_sequence_is_visited_by_runs_from_start_to_end(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    paths = cover_sequences(graph, sequences).paths
    assert all(is_run(graph, path) for path in paths)
    assert all(any(contains(path, each) for path in paths) for each in sequences)


@given(tasks())
def test_cycles_are_joined_also_by_going_there_and_back(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    with patch("parcours.paths.flow._ROUNDS", 0), patch("parcours.paths.joining.LARGEST", 0):
        cover = cover_sequences(graph, sequences)
    assert len(cover.paths) == optimum(graph, sequences)[0]
    assert all(is_run(graph, path) for path in cover.paths)
    assert all(any(contains(path, each) for path in cover.paths) for each in sequences)


@given(tasks(most_sequences=12))
def test_no_network_is_solved_twice(task: tuple[Graph, list[Walk]]) -> None:
    solved: list[tuple[bytes, bytes, int]] = []

    def watched(closed: Arcs, most: int) -> Integers:
        solved.append((closed.least.tobytes(), closed.costs.tobytes(), most))
        return _circulation(closed, most)

    with patch("parcours.paths.flow._circulation", watched):
        cover_sequences(*task)
    assert len(solved) == len(set(solved))


@given(tasks(most_sequences=6), st.integers(1, 12))
def test_a_limit_on_the_length_is_kept_or_refused_where_nothing_fits(
    task: tuple[Graph, list[Walk]], limit: int
) -> None:
    graph, sequences = task
    try:
        paths = cover_sequences(graph, sequences, max_length=limit).paths
    except BadRequest as error:
        assert error.slug == "length-limit"
        assert max(min_length(graph, each) for each in sequences) > limit
        return
    assert all(len(path) <= limit and is_run(graph, path) for path in paths)
    cover = cover_sequences(graph, sequences, max_length=limit)
    assert cover.fewest <= len(cover.paths)
    assert cover.shortest <= cover.length
    assert all(any(contains(path, each) for path in paths) for each in sequences)


def min_length(graph: Graph, sequence: Walk) -> int:
    return optimum(graph, [sequence])[1]


@given(tasks(most_sequences=6))
def test_a_closed_walk_comes_back_and_an_open_one_is_not_longer(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    assume(graph.finals == (0,))
    (closed,) = cover_sequences(graph, sequences, shape="closed").paths
    (open_,) = cover_sequences(graph, sequences, shape="open").paths
    assert is_run(graph, closed)
    for each in sequences:
        assert contains(closed, each)
        assert contains(open_, each)


@given(tasks(most_sequences=10))
def test_the_outermost_sequences_are_those_inside_no_other(task: tuple[Graph, list[Walk]]) -> None:
    graph, sequences = task
    naive = [
        each
        for each in dict.fromkeys(sequences)
        if not any(each != other and contains(other, each) for other in sequences)
    ]
    assert outermost(len(graph.edges), sequences) == naive


@given(tasks())
def test_all_states_are_visited_by_the_fewest_paths(task: tuple[Graph, list[Walk]]) -> None:
    graph, _ = task
    cover = cover_sequences(graph, [], range(len(graph.states)))
    assert all(is_run(graph, path) for path in cover.paths)
    seen = {0, *(int(graph.targets[edge]) for path in cover.paths for edge in path)}
    assert seen == set(range(len(graph.states)))
    by_edges = cover_sequences(graph, [(edge,) for edge in range(len(graph.edges))])
    assert len(cover.paths) == cover.fewest <= by_edges.fewest
    assert cover.shortest <= cover.length <= by_edges.length


def fork() -> Graph:
    return graph_of(
        Machine("fork", "s", ("s", "a", "b"), (Transition("left", "s", "a"), Transition("right", "s", "b")))
    )


@pytest.mark.parametrize("shape", ["open", "closed"])
def test_one_walk_is_refused_where_there_is_no_way_back(shape: str) -> None:
    with pytest.raises(BadRequest, match=r"\[one-walk\]"):
        cover_sequences(fork(), [(0,), (1,)], shape=shape)  # type: ignore[arg-type]


def test_declared_final_states_are_where_paths_end() -> None:
    steps = (Transition("go", "a", "b"), Transition("back", "b", "a"), Transition("stay", "b", "b"))
    ends = Machine("m", "a", ("a", "b"), steps, final=("b",))
    (path,) = cover_sequences(graph_of(ends), [(0,), (1,), (2,)]).paths
    assert ends.transitions[path[-1]].target == "b"
    assert len(path) == 4


def test_cycles_that_hang_together_with_no_walk_are_joined() -> None:
    # The cheapest circulation takes go-back once and both loops of the far state as a cycle of its own.
    steps = (
        Transition("go", "a", "b"), Transition("back", "b", "a"),
        Transition("on", "b", "c"), Transition("off", "c", "b"),
        Transition("x", "c", "d"), Transition("y", "d", "c"),
    )  # fmt: skip
    graph = graph_of(Machine("m", "a", ("a", "b", "c", "d"), steps))
    cover = cover_sequences(graph, [(4, 5, 4)])
    (path,) = cover.paths
    assert is_run(graph, path)
    assert contains(path, (4, 5, 4))
    assert cover.shortest <= cover.length == 8
