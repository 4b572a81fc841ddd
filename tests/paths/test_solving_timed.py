"""Timed components of several machines: what `solve` says agrees with a naive model that states every clock reading."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model import Cefsm, Component, Machine, Transition, Variable, parse_model
from parcours.model.expression import Assignment, Expression, parse_expression
from parcours.model.writing import write_model
from parcours.paths.solving import Covered, Executability, Infeasible, Undecided, deciding, solve
from parcours.paths.timing import Contradiction, schedule
from parcours.paths.timing.zones import Zones

CLOCKS, DEPTH = ("x", "y"), 4
BOUNDS = ["x <= 1", "x < 2", "y <= 2", "x >= 1", "y > 2", "y >= 3", "x == 1", "y < 1 || x > 1", "x - y < 1", "x <= n"]
DATA = ["n == 0", "n == 1"]


@st.composite
def machines(draw: st.DrawFn, name: str) -> Machine:
    states = [f"{name}{number}" for number in range(3)]
    transitions = []
    for number in range(draw(st.integers(1, 3))):
        guards = draw(st.lists(st.sampled_from([*BOUNDS, *DATA]), max_size=2, unique=True))
        sets = draw(st.lists(st.sampled_from(["x := 0", "y := 0", "x := 2", "n := 1"]), max_size=2, unique=True))
        transitions.append(
            Transition(
                f"{name}_t{number}",
                states[0] if number == 0 else draw(st.sampled_from(states)),
                draw(st.sampled_from(states)),
                None,
                parse_expression(" && ".join(f"({each})" for each in guards)) if guards else None,
                tuple(Assignment(each[0], parse_expression(each[5:])) for each in sets),
                duration=draw(st.sampled_from([None, None, (0.0, 0.0), (1.0, 2.0), (0.5, float("inf"))])),
            )
        )
    held = [(state, parse_expression(draw(st.sampled_from(["x <= 1", "y < 2", "x <= 2", "y >= 0"]))))
            for state in states if draw(st.booleans())]  # fmt: skip
    return Machine(name, states[0], tuple(states), tuple(transitions), invariants=tuple(held))


@st.composite
def systems(draw: st.DrawFn) -> Cefsm:
    variables = (Variable("x", "clock", None), Variable("y", "clock", None), Variable("n", "int", 0, domain=range(3)))
    return Cefsm("c", (Component("C", (draw(machines("a")), draw(machines("b"))), variables),))


class Naive:
    """A run with every reading as a term: all invariants hold before and after each step, and so in between."""

    def __init__(self, cefsm: Cefsm) -> None:
        (component,) = cefsm.components
        self.machines, self.solver = component.machines, z3.Solver()
        self.steps: list[str] = []
        self.states = [machine.initial for machine in component.machines]
        self.clocks = {name: z3.RealVal(0) for name in CLOCKS}
        self.since, self.n = [z3.RealVal(0) for _ in component.machines], 0
        self._hold()

    def take(self, machine: int, transition: Transition) -> bool:
        """Take a transition after some time; return whether that can be."""
        wait = z3.Real(f"wait{len(self.steps)}")
        self.solver.add(wait >= 0)
        self.clocks = {name: value + wait for name, value in self.clocks.items()}
        self.since = [value + wait for value in self.since]
        self._hold()
        if transition.guard is not None:
            self.solver.add(self.term(transition.guard))
        if transition.duration is not None:
            least, most = transition.duration
            self.solver.add(self.since[machine] >= least)
            if most < float("inf"):
                self.solver.add(self.since[machine] <= most)
        for action in transition.actions:
            assert isinstance(action, Assignment)
            value = int(str(action.value))
            if action.target == "n":
                self.n = value
            else:
                self.clocks[action.target] = z3.RealVal(value)
        self.states[machine], self.since[machine] = transition.target, z3.RealVal(0)
        self._hold()
        self.steps.append(transition.id)
        return bool(self.solver.check() == z3.sat)

    def runs(self, depth: int) -> Iterator[tuple[str, ...]]:
        """Yield every run of at most so many steps from here."""
        yield tuple(self.steps)
        kept = (list(self.steps), list(self.states), dict(self.clocks), list(self.since), self.n)
        for at, machine in enumerate(self.machines if depth else ()):
            for transition in machine.transitions:
                if transition.source == self.states[at]:
                    self.solver.push()
                    if self.take(at, transition):
                        yield from self.runs(depth - 1)
                    self.solver.pop()
                    self.steps, self.states, self.clocks, self.since, self.n = (
                        list(kept[0]), list(kept[1]), dict(kept[2]), list(kept[3]), kept[4])  # fmt: skip

    def can(self, ids: Sequence[str]) -> bool:
        """Return whether a run can be taken from the start."""
        found = {each.id: (at, each) for at, machine in enumerate(self.machines) for each in machine.transitions}
        return all(self.take(*found[id]) for id in ids)

    def term(self, expression: Expression) -> z3.BoolRef:
        text = str(expression)
        parts = text.replace("(", "").replace(")", "").split(" && ")
        names = {**self.clocks, "n": self.n}
        either = [[eval(one, {}, names) for one in part.split(" || ")] for part in parts]
        return z3.And([z3.Or([z3.BoolVal(each) if isinstance(each, bool) else each for each in one]) for one in either])

    def _hold(self) -> None:
        for machine, now in zip(self.machines, self.states, strict=True):
            self.solver.add(*(self.term(each) for state, each in machine.invariants if state == now))


@settings(max_examples=60, deadline=None)
@given(systems())
def test_two_machines_are_decided_as_a_naive_model_of_time_says(cefsm: Cefsm) -> None:
    start = Naive(cefsm)
    seen = set().union(*start.runs(DEPTH)) if start.solver.check() == z3.sat else set()
    for name in ("a", "b"):
        found = solve(cefsm, "C", name, "edge", budget=2_000)
        # Zones of clocks that are compared with each other allow a little too much.
        assert not found.undecided or "x - y" in str(write_model(cefsm)), [each.reason for each in found.undecided]
        for path in found.paths:
            assert not path.moves or Naive(cefsm).can(path.ids), path.ids
        assert seen.isdisjoint(each.requirement.steps[0] for each in found.infeasible)


@settings(max_examples=20, deadline=None)
@given(systems())
def test_the_solver_by_itself_is_never_wrong_about_time(cefsm: Cefsm) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(deciding, "MOST_STATES", 0)
        found = solve(cefsm, "C", "a", "edge", budget=300)
    seen = set().union(*Naive(cefsm).runs(DEPTH)) if Naive(cefsm).solver.check() == z3.sat else set()
    assert all(Naive(cefsm).can(path.ids) for path in found.paths if path.moves)
    assert seen.isdisjoint(each.requirement.steps[0] for each in found.infeasible)


STANDING = """
parcours: model/1
name: standing
components:
  C:
    variables: {x: {type: clock}}
    machines:
      A: {initial: a, transitions: {t1: {from: a, to: b, guard: x >= 5}}}
      B: {initial: p, invariants: {p: x <= 1, q: x <= 2}, transitions: {u: {from: p, to: q}}}
"""


def verdict(found: Executability, id: str) -> Covered | Infeasible | Undecided:
    return next(each for each in found.verdicts if each.requirement.steps == (id,))


def test_no_time_passes_where_a_machine_that_stands_still_does_not_let_it() -> None:
    cefsm = parse_model(STANDING)
    assert isinstance(verdict(solve(cefsm, "C", "A", "edge"), "t1"), Infeasible)
    found = schedule(cefsm, ["t1"])
    assert isinstance(found, Contradiction) and any("invariant of 'p'" in each for each in found.bounds)
    free = parse_model(STANDING.replace("q: x <= 2", "q: x <= 7"))
    assert solve(free, "C", "A", "edge").paths[0].ids == ("u", "t1")


MEETING = """
parcours: model/1
name: meeting
messages: {Go: {fields: {}}}
channels: {go: {from: C, to: C, message: Go, capacity: 0}}
components:
  C:
    variables: {x: {type: clock}}
    machines:
      A: {initial: a, transitions: {send: {from: a, to: b, guard: x >= 5, action: x := 0, message: go}}}
      B: {initial: p, transitions: {take: {from: p, to: q, event: go(it), guard: x <= 1}}}
"""


def test_what_a_sender_does_to_a_clock_in_the_same_step_proves_nothing() -> None:
    missed = verdict(solve(parse_model(MEETING), "C", "A", "edge", budget=500), "send")
    assert isinstance(missed, Undecided)


FISCHER = """
      P{0}:
        initial: idle
        invariants: {{asks: x{0} <= 2}}
        transitions:
          ask{0}: {{from: idle, to: asks, guard: id == 0, action: x{0} := 0}}
          write{0}: {{from: asks, to: waits, action: x{0} := 0; id := {0}}}
          retry{0}: {{from: waits, to: asks, guard: id == 0, action: x{0} := 0}}
          enter{0}: {{from: waits, to: critical, guard: x{0} > {1} && id == {0}}}
          intrude{0}: {{from: critical, to: critical, guard: id != {0}}}
          leave{0}: {{from: critical, to: idle, action: id := 0}}
"""


@pytest.mark.parametrize(("wait", "is_safe"), [(2, True), (1, False)])
def test_fischers_protocol_is_decided_and_is_safe_only_if_it_waits_long_enough(wait: int, is_safe: bool) -> None:
    clocks = "x1: {type: clock}, x2: {type: clock}, id: {type: int, initial: 0, range: [0, 2]}"
    head = f"parcours: model/1\nname: f\ncomponents:\n  F:\n    variables: {{{clocks}}}\n    machines:"
    cefsm = parse_model(head + FISCHER.format(1, wait) + FISCHER.format(2, wait))
    found = solve(cefsm, "F", "P1", "edge")
    assert not found.undecided
    assert [each.requirement.steps for each in found.infeasible] == [("intrude1",)] * is_safe


def test_zones_are_finitely_many_however_long_a_run_is(component: Callable[..., Cefsm]) -> None:
    cefsm = component("x: {type: clock}, y: {type: clock}", "t: {from: a, to: a, guard: x >= 1, action: x := 0}",
                      "u: {from: a, to: b, guard: y < 3 && x > 4}")  # fmt: skip
    (owner,) = cefsm.components
    zones, seen = Zones(owner), set()
    zone = zones.start(("a",))
    while zone is not None and zone not in seen:
        seen.add(zone)
        (zone,) = zones.after(zone, ("a",), [(0, owner.machines[0].transitions[0], {})])
    assert len(seen) < 10
