from __future__ import annotations

import pytest

from parcours.errors import BadRequest
from parcours.model.structure import Machine, Transition
from parcours.paths import requirements

DOOR = Machine("door", "shut", ("shut", "open", "gone", "never"), (
    Transition("push", "shut", "open"),
    Transition("pull", "open", "shut"),
    Transition("knock", "shut", "shut"),
    Transition("break", "open", "gone"),
    Transition("dream", "never", "shut"),
))  # fmt: skip


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
    fuse = Machine("fuse", "whole", ("whole", "blown"), (Transition("blow", "whole", "blown"),))
    assert spelled("edge-pair", fuse) == {"blow"}


def test_requirements_come_once_each_and_in_file_order() -> None:
    assert [str(need) for need in requirements(DOOR)] == ["push", "pull", "knock", "break"]


def test_an_unknown_criterion_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"'prime'.*Known: node, edge, edge-pair \[unknown-criterion\]"):
        requirements(DOOR, "prime")
