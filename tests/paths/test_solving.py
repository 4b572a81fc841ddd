"""What `solve` says agrees with an interpreter that tries every input at every step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model import (
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    StepRelation,
    Transition,
    Variable,
    parse_model,
)
from parcours.model.configuration import Configuration, Move
from parcours.model.expression import Assignment, evaluate, parse_expression
from parcours.model.structure import Field
from parcours.paths.criteria import CoverageRequirement, requirements
from parcours.paths.solving import Covered, Executability, Infeasible, Undecided, deciding, solve

GUARDS = ["", "n > 1", "n == k", "n + k < 2", "go", "!go || n == 2", "it.v == n + 1", "it.v < 0 && go", "k * n == 4"]
VALUES = ["n + 1", "n + k", "2 - n", "0", "it.v", "max(n, k) - 1", "(n + 2) % 3"]


@st.composite
def small_models(draw: st.DrawFn) -> Cefsm:
    transitions = []
    for number in range(draw(st.integers(2, 7))):
        guard, action = draw(st.sampled_from(GUARDS)), draw(st.none() | st.sampled_from(VALUES))
        event = "it." in guard or "it." in (action or "")
        transitions.append(
            Transition(
                f"t{number}",
                "s0" if number == 0 else draw(st.sampled_from(["s0", "s1", "s2"])),
                draw(st.sampled_from(["s0", "s1", "s2"])),
                Receive("in", "it") if event else None,
                parse_expression(guard) if guard else None,
                (Assignment("n", parse_expression(action)),) if action else (),
            )
        )
    machine = Machine("m", "s0", ("s0", "s1", "s2"), tuple(transitions))
    variables = (
        Variable("n", "int", 0, domain=range(4)),
        Variable("k", "int", None, "input", range(3)),
        Variable("go", "bool", None, "input"),
    )
    message = MessageClass("M", (Field("v", "int"),))
    return Cefsm("c", (Component("C", (machine,), variables),), (Channel("in", "environment", "C", "M"),), (message,))


def reachable_pairs(cefsm: Cefsm) -> set[tuple[str, ...]]:
    """Every transition, and every two in a row, that some run takes: over all states and values that are reached."""
    component = cefsm.components[0]
    machine = component.machines[0]
    queue: list[tuple[str, object]] = [(machine.initial, 0)]
    seen, steps = set(queue), dict[tuple[str, object], set[tuple[str, tuple[str, object]]]]()
    for state, n in queue:
        for transition, k, go, v in product(machine.transitions, range(3), (False, True), range(-5, 6)):
            known = {"n": n, "k": k, "go": go, "it": {"v": v}}
            if transition.source != state or (transition.guard and evaluate(transition.guard, known) is not True):
                continue
            for action in transition.actions:
                assert isinstance(action, Assignment)
                known["n"] = evaluate(action.value, known)
            if known["n"] in range(4):
                after = (transition.target, known["n"])
                steps.setdefault((state, n), set()).add((transition.id, after))
                if after not in seen:
                    seen.add(after)
                    queue.append(after)
    pairs = {
        (first, second) for place in seen for first, after in steps.get(place, ()) for second, _ in steps.get(after, ())
    }
    return pairs | {(id,) for place in seen for id, _ in steps.get(place, ())}


def assert_sound(cefsm: Cefsm, found: Executability) -> None:
    possible = reachable_pairs(cefsm)
    assert {each.requirement.steps for each in found.covered} <= possible
    assert possible.isdisjoint(each.requirement.steps for each in found.infeasible)
    assert all(each.proof for each in found.infeasible)
    for path in found.paths:
        run(cefsm, path.moves)
    for each in found.covered:
        ids = each.path.ids
        steps = each.requirement.steps
        assert any(ids[at : at + len(steps)] == steps for at in range(len(ids)))


def run(cefsm: Cefsm, moves: Sequence[Move]) -> Configuration:
    steps = StepRelation(cefsm, frozenset(channel.name for channel in cefsm.channels))
    here = steps.layout.initial()
    for move in moves:
        here = steps.step(here, move)
    return here


@given(small_models(), st.sampled_from(["edge", "edge-pair"]))
@settings(max_examples=15, deadline=None)
def test_small_state_spaces_are_decided_completely_and_rightly(cefsm: Cefsm, criterion: str) -> None:
    found = solve(cefsm, "C", "m", criterion, budget=20_000)
    assert_sound(cefsm, found)
    assert not found.undecided
    assert len(found.covered) + len(found.infeasible) == len(requirements(cefsm.components[0].machines[0], criterion))


@given(small_models())
@settings(max_examples=10, deadline=None)
def test_the_solver_by_itself_contradicts_the_interpreter_nowhere(cefsm: Cefsm) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(deciding, "MOST_STATES", 0)
        found = solve(cefsm, "C", "m", "edge-pair", budget=10_000)
    assert_sound(cefsm, found)
    missed = {each.requirement.steps for each in found.undecided}
    assert missed.isdisjoint(reachable_pairs(cefsm)), "what can be met in a small model is found"


def verdict(found: Executability, id: str) -> Covered | Infeasible | Undecided:
    return next(each for each in found.verdicts if each.requirement.steps == (id,))


def test_a_loop_that_must_be_taken_often_is_taken_so_often(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "n: {type: int, initial: 0}, step: {type: int, role: input, range: [0, 3]}",
        "t1: {from: a, to: a, action: n := n + step}",
        "t2: {from: a, to: b, guard: n == 20}",
    )
    (path,) = solve(cefsm, "C", "m", [CoverageRequirement("m", "transitions", ("t2",))], budget=10_000).paths
    assert len(path.ids) == 8, "seven steps, as each is 3 at most, and out"
    assert sum(value for move in path.moves for _, value in move.inputs if isinstance(value, int)) == 20


def test_a_proof_names_the_guards_that_conflict_and_no_other(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 300)
    cefsm = component(
        "v: {type: real, role: input}, ready: {type: bool, role: input}, n: {type: int, initial: 0}",
        "t1: {from: a, to: b, guard: ready && n < 100000, action: n := n + 1}",
        "t2: {from: b, to: a, guard: v > 1.0 && v < 0.5}",
        "t3: {from: b, to: a, guard: v > 1.0}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=5_000)
    assert verdict(found, "t2") == Infeasible(
        CoverageRequirement("m", "transitions", ("t2",)), ("guard of 't2': v > 1.0 && v < 0.5",)
    )
    assert isinstance(verdict(found, "t3"), Covered)


def test_a_proof_goes_back_to_the_start_where_it_must(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 300)
    cefsm = component(
        "v: {type: real, role: input}, b: {type: bool, initial: false}, m: {type: int, initial: 0}",
        "t1: {from: a, to: a, guard: v > 1.0 && v < 0.5, action: b := true}",
        "t2: {from: a, to: a, action: m := m + 1}",
        "t3: {from: a, to: b, guard: b}",
        "t4: {from: a, to: b, guard: m < 0}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=3_000)
    back = ("'b' starts at false", "guard of 't3': b", "guard of 't1': v > 1.0 && v < 0.5")
    assert verdict(found, "t3") == Infeasible(CoverageRequirement("m", "transitions", ("t3",)), back)
    bound = ("always m >= 0", "guard of 't4': m < 0")
    assert verdict(found, "t4") == Infeasible(CoverageRequirement("m", "transitions", ("t4",)), bound)


def test_what_only_rounding_allows_is_not_called_infeasible(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: real, role: input}, y: {type: real, initial: 0}",
        "t1: {from: a, to: b, guard: x > 0.0, action: y := x + 1.0}",
        "t2: {from: b, to: a, guard: y == y + 1.0}",
        "t3: {from: b, to: a, guard: y * 2.0 < y}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=3_000)
    assert not isinstance(verdict(found, "t2"), Infeasible), "1e300 + 1 == 1e300 in floating point"
    assert isinstance(verdict(found, "t3"), Infeasible), "no rounding makes twice a positive number smaller"


def test_real_inputs_are_floats_that_really_hold(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: real, role: input}, y: {type: real, role: input}",
        't1: {from: a, to: b, guard: "x * x + y * y < 0.3 && x > 0.51 && hypot(x, y) > 0.52"}',
        "t2: {from: b, to: a, guard: sqrt(x) == 1.5 && floor(y) % 3 == 2 && abs(y) / 2.0 < 5}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=10_000)
    assert len(found.covered) == 2
    run(cefsm, found.paths[0].moves)


def test_a_search_that_cannot_end_says_what_it_spent(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "n: {type: int, initial: 1}, k: {type: int, role: input}",
        "t1: {from: a, to: a, guard: k > 0 && k < 1000, action: n := (n * k) % 100003}",
        "t2: {from: a, to: b, guard: n * n == 2 * k * k && k > 7}",
    )
    found = solve(cefsm, "C", "m", "edge", budget=1_000)
    missed = verdict(found, "t2")
    assert isinstance(missed, Undecided) and missed.reason
    assert missed.spent < 4_000


def test_paths_end_where_a_test_may_end_unless_they_may_end_anywhere(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "n: {type: int, initial: 0, range: [0, 5]}",
        "t1: {from: a, to: b, action: n := 3}",
        "t2: {from: b, to: b, guard: n > 0, action: n := n - 1}",
        "t3: {from: b, to: a, guard: n == 0}",
        extra="        final: [a]",
    )
    need = [CoverageRequirement("m", "transitions", ("t1", "t2"))]
    (path,) = solve(cefsm, "C", "m", need).paths
    assert path.ids == ("t1", "t2", "t2", "t2", "t3") and path.ends
    (path,) = solve(cefsm, "C", "m", need, complete=False).paths
    assert path.ids == ("t1", "t2") and not path.ends


SHARED = """
parcours: model/1
name: m
components:
  C:
    variables: {n: {type: int, initial: 0, range: [0, 3]}}
    machines:
      m: {initial: a, transitions: {t1: {from: a, to: b, guard: n == 2}, t2: {from: b, to: a, guard: n == 2 && n == 1}}}
      helper: {initial: h, transitions: {h1: {from: h, to: h, guard: n < 3, action: n := n + 1}}}
"""


def test_other_machines_of_the_component_help_where_the_space_is_searched() -> None:
    found = solve(parse_model(SHARED), "C", "m", "edge")
    assert found.paths[0].ids == ("h1", "h1", "t1")
    assert isinstance(verdict(found, "t2"), Infeasible)


def test_what_other_machines_may_set_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(deciding, "MOST_STATES", 0)
    found = solve(parse_model(SHARED), "C", "m", "edge", budget=3_000)
    missed = verdict(found, "t1")
    assert isinstance(missed, Undecided) and "other machines" in missed.reason
    assert isinstance(verdict(found, "t2"), Infeasible), "n is 2 and 1 under no interference"


def test_without_the_solver_small_spaces_are_still_decided(
    component: Callable[..., Cefsm], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deciding, "has_solver", lambda: False)
    assert isinstance(verdict(solve(parse_model(SHARED), "C", "m", "edge"), "t2"), Infeasible)
    endless = component(
        "n: {type: int, initial: 0}", "t1: {from: a, to: a, action: n := n + 1}", "t2: {from: a, to: a, guard: n < 0}"
    )
    monkeypatch.setattr(deciding, "MOST_STATES", 50)
    missed = verdict(solve(endless, "C", "m", "edge"), "t2")
    assert isinstance(missed, Undecided) and "z3" in missed.reason and "50 states" in missed.reason


@pytest.mark.parametrize(
    ("need", "slug"),
    [
        (CoverageRequirement("m", "transitions", ("t1", "t1")), "broken-sequence"),
        (CoverageRequirement("m", "transitions", ("nowhere",)), "foreign-transition"),
        (CoverageRequirement("m", "state", ("nowhere",)), "foreign-transition"),
        (CoverageRequirement("m", "round trip", ("a",)), "requirement-kind"),
    ],
)
def test_requirements_that_make_no_sense_are_refused(need: CoverageRequirement, slug: str) -> None:
    with pytest.raises(BadRequest) as refused:
        solve(parse_model(SHARED), "C", "m", [need])
    assert refused.value.slug == slug


def test_unknown_components_and_machines_are_refused() -> None:
    for names in (("D", "m"), ("C", "n")):
        with pytest.raises(BadRequest):
            solve(parse_model(SHARED), *names, "edge")
