from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.paths import CRITERIA, measure

LAMP = Machine("lamp", "off", ("off", "on"), (Transition("up", "off", "on"), Transition("down", "on", "off")))
FAN = Machine("fan", "still", ("still",), (Transition("hum", "still", "still"),))
ROOM = Cefsm("room", (Component("Hall", (LAMP, FAN)),))


@given(st.lists(st.lists(st.sampled_from(["up", "down", "hum"]))), st.sampled_from(list(CRITERIA)))
def test_met_and_missed_partition_what_is_required(runs: list[list[str]], criterion: str) -> None:
    coverage = measure(ROOM, criterion, *runs)
    assert set(coverage.met) | set(coverage.missed) == set(coverage.required)
    assert not set(coverage.met) & set(coverage.missed)
    assert coverage.ratio == len(coverage.met) / len(coverage.required)


@given(st.lists(st.sampled_from(["up", "down", "hum"])), st.sampled_from(list(CRITERIA)))
def test_a_longer_run_meets_no_less(run: list[str], criterion: str) -> None:
    assert set(measure(ROOM, criterion, run[:-1]).met) <= set(measure(ROOM, criterion, run).met)


def test_nothing_taken_meets_only_the_states_where_machines_stand() -> None:
    assert [str(need) for need in measure(ROOM, "node").met] == ["off", "still"]
    assert measure(ROOM, "edge").met == ()


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
