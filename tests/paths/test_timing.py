"""Windows are exact: the solver finds no schedule outside them, and one at each of their ends."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model import Cefsm, parse_model
from parcours.paths.solving import solved_schedule
from parcours.paths.timing import Contradiction, Schedule, Unscheduled, schedule
from parcours.paths.timing.network import TimeLimit, Windows, windows_of

EVENTS = 5
LIMITS = st.lists(
    st.builds(
        TimeLimit,
        st.integers(0, EVENTS - 1),
        st.integers(0, EVENTS - 1),
        st.integers(-6, 20).map(lambda n: Fraction(n, 3)),
        st.booleans(),
    ).filter(lambda limit: limit.earlier != limit.later),
    max_size=12,
)


def times() -> list[z3.ArithRef]:
    return [z3.RealVal(0), *(z3.Real(f"t{event}") for event in range(1, EVENTS))]


def as_solver(limits: list[TimeLimit]) -> z3.Solver:
    solver, t = z3.Solver(), times()
    solver.add(*(t[event] >= 0 for event in range(1, EVENTS)))
    for limit in limits:
        apart, most = t[limit.later] - t[limit.earlier], z3.Q(limit.most.numerator, limit.most.denominator)
        solver.add(apart < most if limit.strict else apart <= most)
    return solver


def can(solver: z3.Solver, *claims: z3.BoolRef) -> bool:
    return bool(solver.check(*claims) == z3.sat)


@given(LIMITS)
@settings(max_examples=60, deadline=None)
def test_windows_are_those_of_the_solver_and_contradictions_too(limits: list[TimeLimit]) -> None:
    limits = [*limits, *(TimeLimit(event, event - 1, Fraction(0)) for event in range(1, EVENTS))]
    found, solver, t = windows_of(EVENTS, limits), as_solver(limits), times()
    if not isinstance(found, Windows):
        assert not can(as_solver([limit for limit in found if limit.why == ""]))
        assert len(found) <= EVENTS, "a cycle visits no event twice"
        return
    assert can(solver, *(time == z3.Q(at.numerator, at.denominator) for time, at in zip(t, found.times, strict=True)))
    pairs = [*zip(t, found.windows, strict=True)]
    pairs += [(t[event] - t[event - 1], found.gaps[event - 1]) for event in range(1, EVENTS)]
    for time, window in pairs:
        earliest = z3.Q(window.earliest.numerator, window.earliest.denominator)
        assert not can(solver, time < earliest)
        assert can(solver, time == earliest) is not window.opens
        assert can(solver, time < earliest + z3.Q(1, 1000))
        if window.latest is None:
            assert can(solver, time > 1_000_000)
        else:
            latest = z3.Q(window.latest.numerator, window.latest.denominator)
            assert not can(solver, time > latest)
            assert can(solver, time == latest) is not window.closes


def windows(found: Schedule | Contradiction | Unscheduled) -> list[str]:
    assert isinstance(found, Schedule), found
    return [str(window) for window in found.windows]


def test_durations_run_from_entering_the_state(component: Callable[..., Cefsm]) -> None:
    cefsm = component("n: {type: int, initial: 0}", "t: {from: a, to: a, duration: [0.1, 0.2]}")
    assert windows(schedule(cefsm, ["t"] * 3)) == ["[0.1, 0.2] s", "[0.2, 0.4] s", "[0.3, 0.6] s"]


def test_tenths_of_a_second_add_up_exactly(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}",
        "t1: {from: a, to: b, duration: [0.1, 0.1]}",
        "t2: {from: b, to: c, duration: [0.2, 0.2]}",
        "t3: {from: c, to: a, guard: x <= 0.3, duration: [0, 0]}",
        "t4: {from: c, to: a, guard: x < 0.3, duration: [0, 0]}",
    )
    assert windows(schedule(cefsm, ["t1", "t2", "t3"]))[-1] == "[0.3, 0.3] s"
    assert isinstance(schedule(cefsm, ["t1", "t2", "t4"]), Contradiction)


def test_a_contradiction_names_the_bounds_of_its_cycle_and_no_other(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}, y: {type: clock}",
        "t1: {from: a, to: b, action: x := 0, duration: [1, 2]}",
        "t2: {from: b, to: c, duration: [3, 9]}",
        "t3: {from: c, to: a, guard: x < 3 && y < 100}",
    )
    found = schedule(cefsm, ["t1", "t2", "t3"])
    assert isinstance(found, Contradiction)
    assert set(found.bounds) == {
        "'t2' (step 2) takes at least 3 s",
        "guard of 't3' (step 3): x < 3 && y < 100 (x set in step 1)",
        "'t3' (step 3) comes after step 2",
    }


def test_invariants_hold_from_entering_until_leaving(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}",
        "t1: {from: a, to: b, guard: x >= 1}",
        "t2: {from: b, to: a, action: x := 2}",
        extra="        invariants: {a: x <= 4, b: x < 6}",
    )
    assert windows(schedule(cefsm, ["t1", "t2", "t1"])) == ["[1, 4] s", "[1, 6) s", "[1, 8) s"]


def test_a_choice_between_times_is_met_in_the_first_way_that_fits(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}",
        "t1: {from: a, to: b, guard: x < 1 || x >= 5, duration: [2, 9]}",
        "t2: {from: b, to: a, guard: x != 5, duration: [0, 0]}",
    )
    assert windows(schedule(cefsm, ["t1", "t2"])) == ["(5, 9] s", "(5, 9] s"]


def test_data_that_clocks_are_compared_with_is_chosen_by_the_solver_or_given(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}, n: {type: int, role: input, range: [1, 9]}",
        "t1: {from: a, to: b, guard: x <= n && n < 5, duration: [4, 20]}",
    )
    assert windows(solved_schedule(cefsm, ["t1"])) == ["[4, 4] s"]
    slow = schedule(cefsm, ["t1"], inputs=[(("C.n", 3), ("C.x", 3.0))])
    assert isinstance(slow, Contradiction) and "takes at least 4 s" in str(slow)
    with pytest.raises(BadRequest, match="guard"):
        schedule(cefsm, ["t1"], inputs=[(("C.n", 7), ("C.x", 3.0))])


def test_conditions_that_are_no_bound_are_said_not_to_be_scheduled(component: Callable[..., Cefsm]) -> None:
    cefsm = component("x: {type: clock}, y: {type: clock}", "t1: {from: a, to: a, guard: x + y < 5}")
    found = schedule(cefsm, ["t1"], inputs=[(("C.x", 0.0), ("C.y", 0.0))])
    assert isinstance(found, Unscheduled) and "difference of clocks" in found.reason


RELAY = """
parcours: model/1
name: relay
messages: {Go: {fields: {}}}
channels: {go: {from: A, to: B, message: Go, capacity: %d}}
components:
  A:
    machines:
      a: {initial: s, transitions: {a1: {from: s, to: t, message: go, duration: [2, 3]}}}
  B:
    machines:
      b:
        initial: u
        transitions:
          b1: {from: u, to: v, event: go, duration: [0, 5]}
          b2: {from: v, to: u, duration: [1, 1]}
"""


def test_a_receive_comes_after_its_send_and_in_a_rendezvous_with_it() -> None:
    assert windows(schedule(parse_model(RELAY % 1), ["a1", "b1", "b2"])) == ["[2, 3] s", "[2, 5] s", "[3, 6] s"]
    assert windows(schedule(parse_model(RELAY % 0), ["a1", "b1", "b2"])) == ["[2, 3] s", "[2, 3] s", "[3, 4] s"]


def test_clocks_read_what_they_read_in_the_schedule(component: Callable[..., Cefsm]) -> None:
    cefsm = component(
        "x: {type: clock}, y: {type: clock}",
        "t1: {from: a, to: b, guard: x > 2, action: y := 1.5}",
        "t2: {from: b, to: a, guard: y - x > -1 && y == 2.5}",
    )
    found = schedule(cefsm, ["t1", "t2"])
    assert isinstance(found, Schedule)
    assert found.readings[1]["y"] == 2.5 and found.readings[0]["x"] > 2
    assert found.readings[1]["x"] == float(found.times[1])
