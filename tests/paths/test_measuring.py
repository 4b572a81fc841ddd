from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.expression import Assignment, Literal, Name
from parcours.model.structure import (
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
)
from parcours.paths import measure
from parcours.paths.graph import Graph
from parcours.paths.measuring import Tours

CRITERIA = (
    "node", "edge", "edge-pair", "2-switch", "prime", "simple-round-trip", "complete-round-trip", "complete:3",
    "specified:up down, hum", "all-defs", "all-uses", "all-du-paths", "channel", "message", "rendezvous",
)  # fmt: skip
TOURS: tuple[Tours, ...] = ("direct", "sidetrips", "detours")
LAMP = Machine("lamp", "off", ("off", "on"), (
    Transition("up", "off", "on", actions=(Assignment("bright", Literal(True)),), sends=(Send("light"),)),
    Transition("down", "on", "off", guard=Name("bright")),
))  # fmt: skip
FAN = Machine("fan", "still", ("still",), (Transition("hum", "still", "still", Receive("light")),))
ROOM = Cefsm(
    "room",
    (Component("Hall", (LAMP, FAN), (Variable("bright", "bool", False),)),),
    (Channel("light", "Hall", "Hall", "Light"),),
    (MessageClass("Light", ()),),
)


@given(st.lists(st.lists(st.sampled_from(["up", "down", "hum"]))), st.sampled_from(CRITERIA), st.sampled_from(TOURS))
def test_met_and_missed_partition_what_is_required(runs: list[list[str]], criterion: str, tours: Tours) -> None:
    coverage = measure(ROOM, criterion, *runs, tours=tours)
    assert coverage.required
    assert set(coverage.met) | set(coverage.missed) == set(coverage.required)
    assert not set(coverage.met) & set(coverage.missed)
    assert coverage.ratio == len(coverage.met) / len(coverage.required)


@given(st.lists(st.sampled_from(["up", "down", "hum"])), st.sampled_from(CRITERIA), st.sampled_from(TOURS))
def test_a_longer_run_meets_no_less(run: list[str], criterion: str, tours: Tours) -> None:
    before, after = (measure(ROOM, criterion, each, tours=tours) for each in (run[:-1], run))
    assert set(before.met) <= set(after.met)


@given(st.sampled_from(CRITERIA))
def test_a_run_that_does_everything_meets_everything(criterion: str) -> None:
    assert measure(ROOM, criterion, ["up", "hum", "hum", "down", "hum", "up", "down", "up"]).missed == ()


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    states = [f"s{number}" for number in range(draw(st.integers(1, 4)))]
    tree = [(states[draw(st.integers(0, at - 1))], states[at]) for at in range(1, len(states))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    arcs = [*tree, *draw(st.lists(ends, min_size=1, max_size=5))]
    return Machine("m", "s0", tuple(states), tuple(Transition(f"t{n}", a, b) for n, (a, b) in enumerate(arcs)))


def straight(machine: Machine, run: list[str]) -> list[list[str]]:
    """The pieces of a run in which each transition begins where the one before it ended."""
    by_id = {each.id: each for each in machine.transitions}
    pieces = [run[:1]]
    for before, after in pairwise(run):
        if by_id[before].target == by_id[after].source:
            pieces[-1].append(after)
        else:
            pieces.append([after])
    return pieces


@given(machines(), st.sampled_from(CRITERIA[:8]), st.sampled_from(TOURS), st.data())
@settings(max_examples=100)
def test_a_run_with_jumps_meets_what_its_straight_pieces_meet(
    machine: Machine, criterion: str, tours: Tours, data: st.DataObject
) -> None:
    run = data.draw(st.lists(st.sampled_from([each.id for each in machine.transitions]), max_size=12))
    pieces = straight(machine, run)
    assert measure(machine, criterion, run, tours=tours) == measure(machine, criterion, *pieces, tours=tours)


@given(machines(), st.sampled_from(TOURS), st.data())
@settings(max_examples=100)
def test_a_state_has_its_round_trip_when_one_of_all_round_trips_from_there_is_toured(
    machine: Machine, tours: Tours, data: st.DataObject
) -> None:
    run, state = [], machine.initial
    for number in data.draw(st.lists(st.integers(0, 5), max_size=14)):
        following = [each for each in machine.transitions if each.source == state] or machine.transitions
        run.append(following[number % len(following)].id)
        state = following[number % len(following)].target
    source = {each.id: each.source for each in machine.transitions}
    every = measure(machine, "complete-round-trip", run, tours=tours).met
    some = measure(machine, "simple-round-trip", run, tours=tours).met
    assert {need.steps[0] for need in some} == {source[need.steps[0]] for need in every}


def test_a_move_of_two_transitions_counts_for_both_machines() -> None:
    assert measure(ROOM, "edge", ["up+hum", "down"]).ratio == 1.0
    assert measure(ROOM, "rendezvous", ["up+hum", "down"]).ratio == 1.0
    with pytest.raises(BadRequest, match=r"entry 1: .*'up\+ham' is not one.*\[foreign-transition\]"):
        measure(ROOM, "edge", ["down", "up+ham"])


def test_transitions_whose_ids_hold_a_plus_are_found_first() -> None:
    machine = Machine("m", "s", ("s",), tuple(Transition(id, "s", "s") for id in ("a", "b", "a+b", "b+a+b")))
    assert [str(need) for need in measure(machine, "edge", ["a+b"]).met] == ["a+b"]
    assert [str(need) for need in measure(machine, "edge", ["a+a+b"]).met] == ["a", "a+b"]


def test_a_transition_from_a_state_that_cannot_be_reached_parts_what_it_stands_between() -> None:
    island = Machine("m", "a", ("a", "b"), (Transition("t", "a", "a"), Transition("lost", "b", "b")))
    assert measure(island, "edge-pair", ["t", "lost", "t"]).met == ()
    assert measure(island, "edge-pair", ["t", "t"]).ratio == 1.0


SQUARE = Graph(
    "square", ("0", "1", "2"), ("tick", "tick", "tock", "tock"),
    np.array([0, 1, 1, 2]), np.array([1, 2, 0, 0]), (0,),
)  # fmt: skip


def test_a_move_of_a_composition_is_the_one_that_leaves_the_configuration() -> None:
    met = [str(need) for need in measure(SQUARE, "edge", ["tick", "tick", "tock"]).met]
    assert met == ["tick at 0", "tick at 1", "tock at 2"]
    assert [str(need) for need in measure(SQUARE, "edge", ["tick at 0", "tock at 1"]).met] == ["tick at 0", "tock at 1"]


def test_a_move_that_does_not_leave_the_configuration_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"entry 1: .*leaves '1', but 'tack' is not one.*did you mean 'tock'"):
        measure(SQUARE, "edge", ["tick", "tack"])


def test_a_move_with_two_outcomes_is_refused_with_a_name_for_one() -> None:
    fork = Graph("fork", ("0", "1"), ("tick", "tick"), np.array([0, 0]), np.array([0, 1]), (1,))
    with pytest.raises(BadRequest, match=r"'tick' is 2 of them; write it as 'tick at 0'"):
        measure(fork, "edge", ["tick"])
    assert [str(need) for need in measure(fork, "edge", ["tick at 0 (2)"]).met] == ["tick at 0 (2)"]


def test_where_nothing_ran_nothing_is_met_and_a_run_without_steps_shows_where_machines_stand() -> None:
    assert measure(ROOM, "node").met == ()
    assert [str(need) for need in measure(ROOM, "node", []).met] == ["off", "still"]


def test_other_machines_between_two_transitions_do_not_part_the_pair() -> None:
    assert "up down" in map(str, measure(ROOM, "edge-pair", ["up", "hum", "down"]).met)


def test_a_jump_makes_no_pair() -> None:
    met = [str(need) for need in measure(LAMP, "edge-pair", ["down", "down", "up"]).met]
    assert met == ["down up"]


def test_two_runs_make_no_pair_across_their_seam() -> None:
    assert measure(LAMP, "edge-pair", ["up"], ["down"]).met == ()


def test_requirements_of_a_model_name_component_and_machine() -> None:
    assert {need.machine for need in measure(ROOM, "edge").required} == {"Hall.lamp", "Hall.fan"}


def test_a_foreign_transition_is_refused_with_its_place() -> None:
    with pytest.raises(BadRequest, match=r"sequence, entry 1: .*'upp'.*did you mean 'up'.*\[foreign-transition\]"):
        measure(LAMP, "edge", ["up", "upp"])
