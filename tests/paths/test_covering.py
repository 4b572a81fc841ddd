from __future__ import annotations

import heapq
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.paths import cover, internal_paths, measure, requirements
from parcours.paths.graph import graph_of

COVERED = (
    "node", "edge", "edge-pair", "2-switch", "prime", "simple-round-trip", "complete-round-trip", "complete:3",
)  # fmt: skip


@st.composite
def machines(draw: st.DrawFn, most_states: int = 5, most_transitions: int = 9) -> Machine:
    states = [f"s{number}" for number in range(draw(st.integers(1, most_states)))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    rest = draw(st.lists(ends, max_size=most_transitions - 1))
    arcs = [("s0", draw(st.sampled_from(states))), *rest]
    transitions = tuple(Transition(f"t{number}", a, b) for number, (a, b) in enumerate(arcs))
    return Machine("m", "s0", tuple(states), transitions)


def final_states(machine: Machine) -> tuple[str, ...]:
    graph = graph_of(machine)
    return tuple(graph.states[state] for state in graph.finals)


def cheapest(machine: Machine, criterion: str) -> tuple[int, int]:
    """The fewest paths, and then the fewest transitions, by trying everything (Dijkstra)."""
    needs = [need.steps for need in requirements(machine, criterion)]
    finals = set(final_states(machine))
    heap: list[tuple[int, int, str, str, int]] = [(1, 0, machine.initial, "", 0)]
    seen: set[tuple[str, str, int]] = set()
    while heap:
        paths, length, state, last, covered = heapq.heappop(heap)
        if (state, last, covered) in seen:
            continue
        seen.add((state, last, covered))
        if covered == 2 ** len(needs) - 1 and state in finals:
            return paths, length
        if state in finals and last:
            heapq.heappush(heap, (paths + 1, length, machine.initial, "", covered))
        for transition in machine.transitions:
            if transition.source == state:
                new = {(transition.id,), (last, transition.id)}
                gained = sum(1 << place for place, steps in enumerate(needs) if steps in new)
                heapq.heappush(heap, (paths, length + 1, transition.target, transition.id, covered | gained))
    raise AssertionError("no cover exists")


@given(machines(), st.sampled_from(["edge", "edge-pair"]))
@settings(max_examples=150, deadline=None)
def test_no_cover_has_fewer_paths_or_as_few_with_fewer_transitions(machine: Machine, criterion: str) -> None:
    if criterion == "edge-pair" and len(requirements(machine, criterion)) > 12:
        machine = Machine("m", "s0", machine.states, machine.transitions[:3])
    paths = cover(machine, criterion)
    assert (len(paths), sum(len(path.transitions) for path in paths)) == cheapest(machine, criterion)


@given(machines(most_states=7, most_transitions=14), st.sampled_from(COVERED))
@settings(max_examples=150, deadline=None)
def test_a_cover_meets_every_requirement_of_its_criterion(machine: Machine, criterion: str) -> None:
    paths = cover(machine, criterion)
    assert measure(machine, criterion, *(path.ids for path in paths)).missed == ()


@given(machines(most_states=7, most_transitions=14), st.sampled_from(COVERED))
@settings(max_examples=150, deadline=None)
def test_paths_are_runs_from_the_initial_state_to_a_final_one(machine: Machine, criterion: str) -> None:
    for path in cover(machine, criterion):
        assert path.states[0] == machine.initial
        assert path.states[-1] in final_states(machine)
        assert all(before.target == after.source for before, after in pairwise(path.transitions))


@given(machines(most_states=7, most_transitions=14), st.sampled_from(["edge", "edge-pair"]))
@settings(max_examples=100, deadline=None)
def test_a_machine_that_always_leads_back_is_covered_by_one_closed_path(machine: Machine, criterion: str) -> None:
    paths = cover(machine, criterion)
    if final_states(machine) == (machine.initial,):
        assert [path.is_closed for path in paths] == [True]
    else:
        assert not any(path.is_closed for path in paths)


@given(machines(most_states=7, most_transitions=14))
@settings(max_examples=100, deadline=None)
def test_edge_pair_covers_subsume_edge_covers_and_these_subsume_node_covers(machine: Machine) -> None:
    pairs = [path.ids for path in cover(machine, "edge-pair")]
    edges = [path.ids for path in cover(machine, "edge")]
    assert measure(machine, "edge", *pairs).missed == ()
    assert measure(machine, "node", *edges).missed == ()


def test_a_transition_is_repeated_only_where_more_lead_in_than_out() -> None:
    fork = Machine("fork", "a", ("a", "b"), (
        Transition("left", "a", "b"), Transition("right", "a", "b"), Transition("back", "b", "a"),
    ))  # fmt: skip
    (path,) = cover(fork)
    assert path.ids == ("left", "back", "right", "back")


def test_fewer_paths_come_before_fewer_transitions() -> None:
    snare = Machine("snare", "a", ("a", "b", "c", "d", "e"), (
        Transition("in", "a", "b"),
        Transition("x", "b", "c"), Transition("y", "b", "c"), Transition("z", "b", "c"),
        Transition("u", "c", "d"), Transition("v", "d", "e"), Transition("w", "e", "b"),
    ))  # fmt: skip
    (path,) = cover(snare)  # two paths would do with eight transitions: in x u v w y, and in z
    assert path.ids == ("in", "x", "u", "v", "w", "y", "u", "v", "w", "z")


def test_a_repeated_stretch_is_the_shortest_whatever_the_order_of_the_file() -> None:
    detour = (
        Transition("d1", "b", "c"), Transition("d2", "c", "d"),
        Transition("d3", "d", "e"), Transition("d4", "e", "a"),
    )  # fmt: skip
    forth = tuple(Transition(f"f{n}", "a", "b") for n in range(4))
    direct = (Transition("n1", "b", "n"), Transition("n2", "n", "a"))
    for order in [(*detour, *forth, *direct), (*forth, *direct, *detour), (*direct, *detour, *forth)]:
        (path,) = cover(Machine("m", "a", ("a", "b", "c", "d", "e", "n"), order))
        assert len(path.transitions) == 4 + 4 + 3 * 2


def test_paths_that_cannot_return_end_in_different_dead_ends() -> None:
    split = Machine("split", "a", ("a", "b", "c"), (
        Transition("loop", "a", "a"), Transition("one", "a", "b"), Transition("two", "a", "c"),
    ))  # fmt: skip
    assert [path.ids for path in cover(split)] == [("loop", "one"), ("two",)]


def test_a_machine_without_transitions_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"machine 'still': .*'here'.*\[nothing-to-cover\]"):
        cover(Machine("still", "here", ("here",), ()))


def test_an_unknown_criterion_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadRequest, match=r"'edges' was given; did you mean 'edge'\?.*\[unknown-criterion\]"):
        cover(Machine("m", "s", ("s",), (Transition("t", "s", "s"),)), "edges")


def test_names_stay_apart_with_ten_components() -> None:
    lamp = Machine("lamp", "off", ("off",), (Transition("t", "off", "off"),))
    house = Cefsm("house", tuple(Component(f"C{number}", (lamp,)) for number in range(1, 12)))
    names = [path.name for paths in internal_paths(house).values() for path in paths]
    assert names[0] == "tp1_1"
    assert names[10] == "tp11_1"
    assert len(set(names)) == 11


def test_a_long_ring_with_chords_is_covered_in_order() -> None:
    size = 400
    ring = [Transition(f"r{i}", f"s{i}", f"s{(i + 1) % size}") for i in range(size)]
    chords = [Transition(f"c{i}", f"s{i}", f"s{(i * 7 + 3) % size}") for i in range(0, size, 5)]
    machine = Machine("ring", "s0", tuple(f"s{i}" for i in range(size)), (*ring, *chords))
    (path,) = cover(machine)
    assert path.is_closed
    assert measure(machine, "edge", path.ids).missed == ()
