"""What the solver computes is what the interpreter computes; serialised sequences run with the values it finds."""

from __future__ import annotations

from itertools import count

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel, BadRequest
from parcours.model import parse_model
from parcours.model.expression import (
    BOOL,
    INT,
    REAL,
    Apply,
    Binary,
    Expression,
    Literal,
    Name,
    Type,
    Unary,
    evaluate,
    type_of,
)
from parcours.paths.solving import Covered, Infeasible, solve_sequence, verdicts
from parcours.paths.solving.terms import Symbols, Translator, constant

TYPES = {"i": INT, "j": INT, "x": REAL, "y": REAL, "b": BOOL, "e": Type("enum", ("fast", "slow"))}


def ints(depth: int) -> st.SearchStrategy[Expression]:
    leaf = st.sampled_from([Name("i"), Name("j")]) | st.integers(0, 9).map(Literal)
    if not depth:
        return leaf
    inner = ints(depth - 1)
    return (
        leaf
        | st.builds(Binary, st.sampled_from(["+", "-", "*", "%"]), inner, inner)
        | st.builds(lambda a: Unary("-", a), inner)
        | st.builds(lambda a: Apply("abs", (a,)), inner)
        | st.builds(lambda name, a, b: Apply(name, (a, b)), st.sampled_from(["min", "max"]), inner, inner)
        | st.builds(lambda a: Apply("floor", (a,)), reals(depth - 1))
    )


def reals(depth: int) -> st.SearchStrategy[Expression]:
    leaf = st.sampled_from([Name("x"), Name("y")]) | st.sampled_from([0.5, 0.25, 2.0, 3.0]).map(Literal)
    if not depth:
        return leaf
    inner = reals(depth - 1)
    return (
        leaf
        | st.builds(Binary, st.sampled_from(["+", "-", "*", "/", "%"]), inner, inner)
        | st.builds(lambda a, b: Binary("/", a, b), ints(0), ints(0))
        | st.builds(lambda a, b: Binary("*", a, b), ints(0), inner)
        | st.builds(lambda a: Unary("-", a), inner)
        | st.builds(lambda name, a, b: Apply(name, (a, b)), st.sampled_from(["min", "max", "hypot"]), inner, inner)
        | st.builds(lambda a: Apply("sqrt", (a,)), inner)
    )


def conditions(depth: int) -> st.SearchStrategy[Expression]:
    order = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    leaf = (
        st.just(Name("b"))
        | st.builds(Binary, st.sampled_from(["==", "!="]), st.just(Name("e")), st.just(Literal("slow")))
        | st.builds(Binary, order, ints(2), ints(1))
        | st.builds(Binary, order, reals(2), reals(1) | ints(1))
    )
    if not depth:
        return leaf
    inner = conditions(depth - 1)
    return (
        leaf
        | st.builds(Binary, st.sampled_from(["&&", "||"]), inner, inner)
        | st.builds(lambda a: Unary("!", a), inner)
    )


VALUES = st.fixed_dictionaries(
    {
        "i": st.integers(-9, 9),
        "j": st.integers(-3, 3),
        "x": st.integers(-64, 64).map(lambda n: n / 8),
        "y": st.integers(-8, 8).map(lambda n: n / 4),
        "b": st.booleans(),
        "e": st.sampled_from(["fast", "slow"]),
    }
)


WORK = 2_000_000  # steps of the solver for one question: counted, so that a busy machine gives the same answer


def holds(condition: Expression, values: dict[str, object], *, exact: bool) -> tuple[bool | None, bool | None]:
    """Whether the solver says that a condition can hold, and that it can fail to hold, under given values."""
    symbols, numbers = Symbols(), count()
    translator = Translator(
        lambda node: type_of(node, TYPES), lambda node, type_: constant(values[str(node)], symbols, exact=False),
        symbols, {}, lambda: f"v{next(numbers)}", exact=exact,
    )  # fmt: skip
    term = translator.term(condition)
    answers = []
    for claim in (z3.And(term.defined, term.value), z3.Not(z3.And(term.defined, term.value))):
        solver = z3.Solver()
        solver.set("rlimit", WORK)
        solver.add(*translator.sides, claim)
        answer = solver.check()
        answers.append(None if answer == z3.unknown else answer == z3.sat)
    return answers[0], answers[1]


def truth(condition: Expression, values: dict[str, object]) -> bool:
    try:
        return evaluate(condition, values) is True
    except BadModel:
        return False  # the step relation takes a guard without a value as one that does not hold


@given(conditions(2), VALUES)
@settings(max_examples=150, deadline=None)
def test_whatever_floating_point_does_is_possible_in_rounded_arithmetic(
    condition: Expression, values: dict[str, object]
) -> None:
    can, may_not = holds(condition, values, exact=False)
    assert (can if truth(condition, values) else may_not) is not False


@given(conditions(2), VALUES)
@settings(max_examples=100, deadline=None)
def test_integers_and_logic_are_translated_exactly(condition: Expression, values: dict[str, object]) -> None:
    if any(name in str(condition) for name in ("x", "y", "/", ".", "sqrt")):
        condition = Binary("==", Name("i"), Binary("%", Name("j"), Name("i")))
    assert holds(condition, values, exact=True) == (truth(condition, values), not truth(condition, values))


DOORBELL = """
parcours: model/1
name: doorbell
messages: {Ring: {fields: {times: {type: int}, tone: {type: text}}}}
channels:
  press: {from: environment, to: Button, message: Ring}
  ring: {from: Button, to: Bell, message: Ring, capacity: 2}
  meet: {from: Bell, to: Button, message: Ring, capacity: 0}
components:
  Button:
    variables: {bonus: {type: int, initial: 2, range: [0, 9]}}
    machines:
      push:
        initial: s
        transitions:
          b1:
            from: s
            to: s
            event: press(it)
            guard: it.tone != 'mute'
            action: bonus := bonus + it.times
            message: ring(bonus, it.tone)
          b2: {from: s, to: s, event: meet(back), guard: back.times == 7}
          b3: {from: s, to: s, event: press(it), message: ring(it)}
  Bell:
    variables: {heard: {type: int, initial: 0}}
    machines:
      sound:
        initial: q
        transitions:
          r1: {from: q, to: q, event: ring(it), guard: "it.times > 5 && it.tone == 'high'", action: heard := it.times}
          r2: {from: q, to: q, message: "meet(heard, 'x')"}
          r3: {from: q, to: q, event: ring(it), guard: it.times < 0}
"""


def test_values_travel_in_messages_between_components() -> None:
    found = solve_sequence(parse_model(DOORBELL), ["b1", "r1", "r2", "b2"])
    assert isinstance(found, Covered)
    moves = [dict(move.inputs) for move in found.path.moves]
    assert moves[0] == {"Button.it.times": 5, "Button.it.tone": "high"}, "2 + 5 == 7 is what the meeting asks for"
    assert moves[1]["Bell.it.times"] == 7 and moves[3]["Button.back.times"] == 7


def test_messages_arrive_in_the_order_they_were_sent_unless_it_is_said_otherwise() -> None:
    doorbell = parse_model(DOORBELL)
    ids = ["b3", "b1", "r3", "r1"]
    first = solve_sequence(doorbell, ids)
    assert isinstance(first, Covered) and dict(first.path.moves[0].inputs)["Button.it.times"] < 0  # type: ignore[operator]
    crossed = solve_sequence(doorbell, ids, sends=[None, None, 1, 0])
    assert isinstance(crossed, Infeasible), "bonus is never negative"
    assert any("r3" in reason for reason in crossed.proof)


def test_copies_of_a_component_have_variables_of_their_own() -> None:
    doorbell = parse_model(DOORBELL)
    ids = ["b1", "b1", "r1", "r1"]
    assert isinstance(solve_sequence(doorbell, ids), Covered)
    apart = solve_sequence(doorbell, ids, instances=[0, 1, 0, 1])
    assert isinstance(apart, Covered)
    assert [dict(move.inputs)["Button.it.times"] for move in apart.path.moves[:2]] >= [4, 4]


def test_a_sequence_that_does_not_join_is_refused_with_its_place() -> None:
    for ids, slug in ((["nobody"], "foreign-transition"), (["off", "off"], "broken-sequence")):
        lamp = parse_model(
            "parcours: model/1\nname: lamp\ncomponents:\n  L:\n    machines:\n      l:\n        initial: a\n"
            "        transitions: {off: {from: a, to: b}, on: {from: b, to: a}}\n"
        )
        with pytest.raises(BadRequest, match="entry") as refused:
            solve_sequence(lamp, ids)
        assert refused.value.slug == slug


def test_without_the_solver_a_sequence_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdicts, "has_solver", lambda: False)
    with pytest.raises(BadRequest, match=r"parcours\[solver\]") as refused:
        solve_sequence(parse_model(DOORBELL), ["b1"])
    assert refused.value.slug == "solver-missing"
