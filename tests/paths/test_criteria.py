from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.paths.criteria import CRITERIA, CoverageCriterion, parse_criterion, requirements
from parcours.paths.criteria.requiring import edge_names
from parcours.paths.graph import Graph

DOOR = Machine("door", "shut", ("shut", "open", "gone", "never"), (
    Transition("push", "shut", "open"),
    Transition("pull", "open", "shut"),
    Transition("knock", "shut", "shut"),
    Transition("break", "open", "gone"),
    Transition("dream", "never", "shut"),
))  # fmt: skip
FUSE = Machine("fuse", "whole", ("whole", "blown"), (Transition("blow", "whole", "blown"),))


def spelled(criterion: str, machine: Machine = DOOR) -> set[str]:
    return {str(need) for need in requirements(machine, criterion)}


def test_only_reachable_states_are_required() -> None:
    assert spelled("node") == {"shut", "open", "gone"}


def test_only_reachable_transitions_are_required() -> None:
    assert spelled("edge") == {"push", "pull", "knock", "break"}


def test_edge_pairs_are_transitions_that_can_follow_each_other() -> None:
    assert spelled("edge-pair") == {
        "push pull", "push break", "pull push", "pull knock", "knock push", "knock knock",
    }  # fmt: skip


def test_a_transition_in_no_pair_is_required_alone() -> None:
    assert spelled("edge-pair", FUSE) == {"blow"}


def test_prime_paths_are_the_longest_on_which_no_state_comes_twice() -> None:
    assert spelled("prime") == {"push pull", "pull push", "knock", "push break"}


def test_a_state_without_transitions_is_a_prime_path_by_itself() -> None:
    (need,) = requirements(Machine("still", "here", ("here",), ()), "prime")
    assert (need.kind, need.steps) == ("state", ("here",))


def test_round_trips_begin_at_each_state_that_has_one() -> None:
    assert spelled("complete-round-trip") == {"push pull", "pull push", "knock"}
    assert spelled("simple-round-trip") == {"round trip at shut", "round trip at open"}


def test_requirements_come_once_each_and_in_file_order() -> None:
    assert [str(need) for need in requirements(DOOR)] == ["push", "pull", "knock", "break"]


def test_a_model_asks_each_of_its_machines() -> None:
    house = Cefsm("house", (Component("Hall", (DOOR, FUSE)),))
    assert {need.machine for need in requirements(house, "edge")} == {"Hall.door", "Hall.fuse"}


def test_specified_walks_go_to_the_machine_that_has_them() -> None:
    house = Cefsm("house", (Component("Hall", (DOOR, FUSE)),))
    found = [(need.machine, str(need)) for need in requirements(house, "specified: blow, push pull ,blow")]
    assert found == [("Hall.door", "push pull"), ("Hall.fuse", "blow")]


def test_a_specified_walk_with_a_gap_is_refused_with_the_two_states() -> None:
    with pytest.raises(BadRequest, match=r"walk 'push knock': .*'push' ends in 'open'.*'shut'.*\[broken-walk\]"):
        requirements(DOOR, "specified:push knock")


def test_a_specified_walk_of_something_else_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"walk 'push pul': .*'pul' is not one; did you mean 'pull'.*\[foreign-transi"):
        requirements(DOOR, "specified:push pul")
    with pytest.raises(BadRequest, match=r"'dream' is not one"):  # it cannot be reached
        requirements(DOOR, "specified:dream")


def test_an_unknown_criterion_is_refused_with_the_known_ones() -> None:
    with pytest.raises(
        BadRequest, match=r"'primes'.*did you mean 'prime'\? Known: node, edge, .*\[unknown-criterion\]"
    ):
        requirements(DOOR, "primes")


@pytest.mark.parametrize("written", ["complete", "complete:", "complete:0", "complete:-1", "-switch", "1.5-switch"])
def test_a_parameter_out_of_range_is_refused_with_an_example(written: str) -> None:
    with pytest.raises(BadRequest, match=r"needs a number from [01] .*write it as .*\[criterion-number\]"):
        parse_criterion(written)


def test_specified_needs_walks() -> None:
    for written in ("specified", "specified:", "specified: , "):
        with pytest.raises(BadRequest, match=r"\[no-walks\]"):
            parse_criterion(written)
    with pytest.raises(BadRequest, match=r"\[no-walks\]"):
        requirements(DOOR, CoverageCriterion("specified", walks=((),)))


ids = st.text(st.characters(exclude_characters=", :", exclude_categories=["Z", "C"]), min_size=1, max_size=4)
criteria = (
    st.sampled_from([name for name in CRITERIA if name.islower()]).map(CoverageCriterion)
    | st.integers(0, 10**9 - 1).map(lambda n: CoverageCriterion("switch", n))
    | st.integers(1, 10**9 - 1).map(lambda n: CoverageCriterion("complete", n))
    | st.lists(st.lists(ids, min_size=1).map(tuple), min_size=1).map(
        lambda walks: CoverageCriterion("specified", walks=tuple(walks))
    )
)


@given(criteria)
def test_a_criterion_reads_back_as_it_is_written(criterion: CoverageCriterion) -> None:
    assert parse_criterion(str(criterion)) == criterion


def test_each_family_refuses_what_it_cannot_look_at() -> None:
    tick = Graph("g", ("s",), ("tick",), np.array([0]), np.array([0]), (0,))
    with pytest.raises(BadRequest, match=r"'all-uses': .*'g' is a graph.*\[criterion-subject\]"):
        requirements(tick, "all-uses")
    with pytest.raises(BadRequest, match=r"'channel': .*a machine was given; give the model \[criterion-subject\]"):
        requirements(DOOR, "channel")


@given(st.lists(st.tuples(st.integers(0, 2), st.sampled_from(["a", "b", "a at 0"])), min_size=1))
def test_edges_of_a_composition_get_different_names(ends: list[tuple[int, str]]) -> None:
    sources = np.array([source for source, _ in ends])
    graph = Graph("g", ("0", "1", "2"), tuple(name for _, name in ends), sources, np.zeros_like(sources), (0,))
    assert len(set(edge_names(graph))) == len(ends)
