"""`solve` at its bounds: the empty path, proofs among clocks, the longest path, and spaces too large to search."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count

import pytest

from parcours.model import Cefsm
from parcours.paths.criteria import CoverageRequirement
from parcours.paths.solving import Covered, Executability, Infeasible, Undecided, deciding, searching, solve


def verdict(found: Executability, id: str) -> Covered | Infeasible | Undecided:
    return next(each for each in found.verdicts if each.requirement.steps == (id,))


def test_the_start_is_met_where_nothing_can_be_done_in_time(component: Callable[..., Cefsm]) -> None:
    cefsm = component("x: {type: clock}", "t1: {from: a, to: b, guard: x <= 0, duration: [2, 2]}")
    found = solve(cefsm, "C", "m", "node", budget=3_000)
    (start,) = found.covered
    assert start.requirement.steps == ("a",) and start.path.moves == ()
    assert [each.requirement.steps for each in found.infeasible] == [("b",)]


def test_the_start_is_met_by_a_longer_path_where_there_is_one(component: Callable[..., Cefsm]) -> None:
    found = solve(component("x: {type: clock}", "t1: {from: a, to: b, guard: x >= 1}"), "C", "m", "node", budget=3_000)
    assert [each.path.ids for each in found.covered] == [("t1",), ("t1",)] and len(found.paths) == 1


def test_a_clock_elsewhere_hinders_no_proof_over_data(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 0)
    cefsm = component(
        "x: {type: clock}, n: {type: int, initial: 0}, k: {type: int, initial: 0}",
        "t1: {from: a, to: b, action: n := n + 1}",
        "t2: {from: b, to: b, guard: x >= 1, action: x := 0; k := k + 1}",
        "t3: {from: b, to: b, guard: n == 0}",
    )
    found = verdict(solve(cefsm, "C", "m", "edge", budget=2_000), "t3")
    assert isinstance(found, Infeasible) and "action of 't1': n := n + 1" in found.proof


def test_a_proof_without_time_takes_no_clock_for_data(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 0)
    cefsm = component(
        "x: {type: clock}, n: {type: int, initial: 0, range: [0, 3]}",
        "t1: {from: a, to: a, action: x := 0; n := (n + 1) % 4}",
        "t2: {from: a, to: b, guard: n == 3 && x == 7}",
        "t3: {from: b, to: c, guard: x > 7}",
    )
    assert len(solve(cefsm, "C", "m", "edge", budget=5_000).covered) == 3


def test_when_all_paths_are_tried_what_conflicts_is_still_named(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 0)
    cefsm = component(
        "n: {type: int, initial: 0, range: [0, 3]}",
        "t1: {from: a, to: b, action: n := 2}",
        "t2: {from: b, to: a, guard: n == 2, action: n := 0}",
        "t3: {from: a, to: a, guard: n > 0}",
    )
    (found,) = solve(cefsm, "C", "m", "edge", budget=5_000).infeasible
    assert found.requirement.steps == ("t3",) and "guard of 't3': n > 0" in found.proof


def test_where_time_counts_paths_do_not_grow_for_ever(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "LOOPS", 3)
    monkeypatch.setattr(deciding, "MOST_STATES", 0)
    cefsm = component(
        "x: {type: clock}, n: {type: int, initial: 0}, go: {type: int, role: input, range: [0, 9]}",
        "t1: {from: a, to: a, guard: x >= 1, action: x := 0; n := n + go}",
        "t2: {from: a, to: b, guard: n == 1000}",
        "t3: {from: a, to: b, guard: n == 24}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=5_000)
    assert isinstance(verdict(found, "t3"), Covered), "in three steps"
    missed = verdict(found, "t2")
    assert isinstance(missed, Undecided) and "more than 15 transitions" in missed.reason


def test_the_way_home_is_found_however_large_the_space_is(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 1)
    cefsm = component(
        "", "t1: {from: a, to: b}", "t2: {from: b, to: d}", "t3: {from: d, to: a}", extra="        final: [a]"
    )
    (path,) = solve(cefsm, "C", "m", [CoverageRequirement("m", "transitions", ("t1",))]).paths
    assert path.ids == ("t1", "t2", "t3") and path.ends


@pytest.mark.parametrize("most_states", [0, 20_000])
@pytest.mark.parametrize("budget", [1, 40, 400])
def test_a_budget_gives_the_same_answer_on_a_busy_machine(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch, budget: int, most_states: int
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", most_states)
    cefsm = component(
        "n: {type: int, initial: 1}, k: {type: int, role: input}",
        "t1: {from: a, to: a, guard: k > 0 && k < 1000, action: n := (n * k) % 100003}",
        "t2: {from: a, to: b, guard: n * n == 2 * k * k && k > 7}",
        "t3: {from: b, to: a, guard: n < 0}",
    )

    def answers() -> tuple[object, ...]:
        found = solve(cefsm, "C", "m", "edge", budget=budget)
        return found.infeasible, [(each.requirement, each.reason) for each in found.undecided], [*map(str, found.paths)]

    quiet = answers()
    hours = count(step=3600.0)  # each look at the clock comes an hour after the last
    for clock in ("monotonic", "perf_counter", "time", "process_time"):
        monkeypatch.setattr(time, clock, lambda: next(hours))
    assert answers() == quiet
