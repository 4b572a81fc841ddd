from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Machine, Transition
from parcours.paths.graph import Graph, Walk, graph_of
from parcours.paths.measuring import Tours, toured
from parcours.paths.measuring.tours import distinct_since, states_of

TOURS: tuple[Tours, ...] = ("direct", "sidetrips", "detours")


@st.composite
def graphs_and_walks(draw: st.DrawFn) -> tuple[Graph, list[Walk]]:
    states = [f"s{number}" for number in range(draw(st.integers(1, 4)))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    arcs = [("s0", "s0"), *draw(st.lists(ends, min_size=1, max_size=7))]
    machine = Machine("m", "s0", tuple(states), tuple(Transition(f"t{n}", a, b) for n, (a, b) in enumerate(arcs)))
    graph = graph_of(machine)
    return graph, [draw_walk(draw, graph) for _ in range(draw(st.integers(2, 6)))]


def draw_walk(draw: st.DrawFn, graph: Graph) -> Walk:
    walk = [draw(st.integers(0, len(graph.edges) - 1))]
    for _ in range(draw(st.integers(0, 7))):
        following = [edge for edge in range(len(graph.edges)) if graph.sources[edge] == graph.targets[walk[-1]]]
        if not following:
            break
        walk.append(draw(st.sampled_from(following)))
    return tuple(walk)


def tours_naively(graph: Graph, path: Walk, walk: Walk, tours: Tours) -> bool:
    """The definitions of Ammann & Offutt, word for word."""
    if tours == "direct":
        return any(path[at : at + len(walk)] == walk for at in range(len(path)))
    along = iter(path if tours == "sidetrips" else states_of(graph, path))
    return all(step in along for step in (walk if tours == "sidetrips" else states_of(graph, walk)))


@given(graphs_and_walks(), st.sampled_from(TOURS), st.integers(1, 3))
@settings(max_examples=200)
def test_tours_are_what_their_definitions_say(given: tuple[Graph, list[Walk]], tours: Tours, n_paths: int) -> None:
    graph, walks = given
    paths, wanted = walks[:n_paths], walks
    expected = [any(tours_naively(graph, path, walk, tours) for path in paths) for walk in wanted]
    assert toured(graph, wanted, paths, tours) == expected


@given(graphs_and_walks())
def test_direct_tours_are_tours_with_side_trips_and_these_are_tours_with_detours(
    given: tuple[Graph, list[Walk]],
) -> None:
    graph, walks = given
    direct, sidetrips, detours = (toured(graph, walks, walks[:1], tours) for tours in TOURS)
    assert all(loose or not strict for strict, loose in zip(direct, sidetrips, strict=True))
    assert all(loose or not strict for strict, loose in zip(sidetrips, detours, strict=True))


def test_a_detour_may_take_another_edge_and_a_side_trip_may_not() -> None:
    fork = graph_of(Machine("fork", "a", ("a", "b", "c"), (
        Transition("short", "a", "c"), Transition("long1", "a", "b"), Transition("long2", "b", "c"),
    )))  # fmt: skip
    walk, path = (0,), (1, 2)
    assert [toured(fork, [walk], [path], tours) for tours in TOURS] == [[False], [False], [True]]


@given(st.lists(st.integers(0, 3)))
def test_states_are_different_since_the_earliest_place_from_which_none_comes_twice(states: list[int]) -> None:
    expected = [
        min(at for at in range(end + 1) if len(set(states[at : end + 1])) == end + 1 - at) for end in range(len(states))
    ]
    assert distinct_since(states) == expected


def test_an_unknown_way_to_tour_is_refused() -> None:
    still = graph_of(Machine("m", "s", ("s",), (Transition("t", "s", "s"),)))
    with pytest.raises(BadRequest, match=r"'detour' was given; did you mean 'detours'\?.*\[unknown-tours\]"):
        toured(still, [(0,)], [], "detour")  # type: ignore[arg-type]
