"""What is offered where a guard computes with open values can be taken, and what is not offered cannot."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model import Cefsm, Move, StepRelation, parse_model
from parcours.model.composition import explore
from parcours.model.expression import evaluate, parse_expression


def counter(guard: str, action: str = "n := n", more: str = "", n: int = 0) -> Cefsm:
    meet = "meet: {from: C, to: C, message: N, capacity: 0}" if "meet" in more else ""
    return parse_model(f"""
parcours: model/1
name: counter
messages: {{N: {{fields: {{v: {{type: int}}, w: {{type: int}}}}}}}}
channels:
  in: {{from: environment, to: C, message: N}}
  {meet}
components:
  C:
    variables:
      n: {{type: int, initial: {n}, range: [-20, 20]}}
      k: {{type: int, role: input}}
      on: {{type: bool, role: input}}
    machines:
      m:
        initial: a
        transitions:
          t1: {{from: a, to: b, event: in(x), guard: "{guard}", action: "{action}"}}
          {more}
""")


VENDING = "(x.v == 5 || x.v == 10) && n + x.v <= 20"


def offered(cefsm: Cefsm) -> list[Move]:
    """The moves of the initial configuration, each taken."""
    steps = StepRelation(cefsm)
    here = steps.layout.initial()
    moves = list(steps.enabled(here, {}))
    for move in moves:
        steps.step(here, move)
    return moves


@pytest.mark.parametrize(("n", "coins"), [(0, [5, 10]), (10, [5, 10]), (15, [5]), (20, [])])
def test_a_coin_is_offered_only_where_the_credit_allows_it(n: int, coins: list[int]) -> None:
    assert [dict(move.inputs)["C.x.v"] for move in offered(counter(VENDING, "n := n + x.v", n=n))] == coins


def test_two_open_fields_that_must_fit_each_other_are_found() -> None:
    [move] = offered(counter("x.v + 3 * x.w == 1000 && x.w > 200"))
    v, w = (value for _, value in move.inputs)
    assert isinstance(v, int) and isinstance(w, int) and v + 3 * w == 1000 and w > 200


atoms = st.sampled_from(
    ["x.v", "x.w", "n", "k", "3", "7", "(n + x.v)", "(x.v - x.w)", "(2 * x.v)", "(x.v * x.w)", "-k"]
)
single = st.sampled_from(["x.v", "n", "3", "17", "(n + x.v)", "(3 * x.v - n)", "-x.v"])
comparing = st.sampled_from(["==", "!=", "<", "<=", ">", ">="])


def guards(parts: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    leaf = st.builds("{} {} {}".format, parts, comparing, parts)
    return st.recursive(
        leaf, lambda inner: st.builds("({} {} {})".format, inner, st.sampled_from(["&&", "||"]), inner), max_leaves=4
    )


@settings(max_examples=60, deadline=None)
@given(
    guards(atoms), guards(atoms), st.sampled_from(["n := n", "n := min(n + x.v, 20)", "n := x.w"]), st.integers(-9, 9)
)
def test_no_move_is_offered_that_is_refused(guard: str, other: str, action: str, n: int) -> None:
    more = (
        f't2: {{from: a, to: b, event: in(x), guard: "{guard}", message: "meet(x.v, k)"}}\n'
        f"      p:\n        initial: a\n        transitions:\n"
        f'          r1: {{from: a, to: b, event: meet(y), guard: "{other.replace("x.", "y.")}"}}'
    )
    steps = StepRelation(counter(guard, action, more, n))
    here = steps.layout.initial()
    for move in steps.enabled(here, {}):
        try:
            steps.step(here, move)
        except Exception as error:
            assert getattr(error, "slug", "") == "out-of-range"


@settings(max_examples=150, deadline=None)
@given(guards(single), st.integers(-9, 9))
def test_a_guard_linear_in_one_open_integer_is_decided(guard: str, n: int) -> None:
    known = parse_expression(guard)
    fits = [v for v in range(-80, 81) if evaluate(known, {"n": n, "x": {"v": v}}) is True]
    assert bool(fits) == bool(offered(counter(guard, n=n)))
    # Where the value is kept, either all values are offered or a doubt is raised.
    steps = StepRelation(counter(guard, "n := min(max(x.v, -20), 20)", n=n))
    moves = steps.enabled(steps.layout.initial(), {})
    assert steps.choices.doubts or {dict(move.inputs).get("C.x.v") for move in moves} == {*fits}


def test_what_a_kept_value_may_still_do_is_no_finding() -> None:
    more = """t2: {from: b, to: a, guard: n != 7}
          t3: {from: b, to: c, guard: n == 7}"""
    space = explore(counter("x.v >= 0 && x.v <= 15", "n := x.v", more))
    assert (space.complete, space.exact, space.findings) == (True, False, ())
    assert space.doubts == ("t1 keeps the open value 'x.v'",)


def test_a_kept_value_all_of_whose_values_are_tried_is_no_doubt() -> None:
    space = explore(
        counter(VENDING, "n := n + x.v", "t2: {from: b, to: a}\n          t3: {from: b, to: a, guard: n == 7}")
    )
    assert space.exact
    assert [str(found) for found in space.findings if found.kind != "deadlock"] == [
        "warning: no run takes t3 of C [dead-transition]"
    ]
