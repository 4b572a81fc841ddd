"""Whether guards can hold together: the answer agrees with trying everything."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.model.expression import (
    BOOL,
    INT,
    REAL,
    TEXT,
    Binary,
    Expression,
    Literal,
    Name,
    Type,
    Unary,
    evaluate,
    parse_expression,
)
from parcours.model.solutions import EFFORT, Budget, Question, with_terms

NUMBERS = [0.0, 0.5, 1.0, 1.5, 2.0]
atoms = st.one_of(
    st.sampled_from([Name("p"), Name("q")]),
    st.builds(
        Binary,
        st.sampled_from(["<", "<=", "==", "!=", ">", ">="]),
        st.sampled_from([Name("v"), Name("w")]),
        st.sampled_from(NUMBERS).map(Literal),
    ),
    st.builds(Binary, st.sampled_from(["==", "!="]), st.just(Name("word")), st.sampled_from("ab").map(Literal)),
    st.builds(Binary, st.sampled_from(["<", "=="]), st.just(Name("n")), st.integers(0, 3).map(Literal)),
)
guards: st.SearchStrategy[Expression] = st.recursive(
    atoms,
    lambda inner: (
        st.builds(Unary, st.just("!"), inner) | st.builds(Binary, st.sampled_from(["&&", "||"]), inner, inner)
    ),
    max_leaves=6,
)
QUESTION = Question({"p": BOOL, "q": BOOL, "v": REAL, "w": REAL, "word": TEXT, "n": INT}, {})
# Constants lie on a grid of 0.5, so a grid of 0.25 that reaches beyond it meets every cell.
GRID = [step / 4 for step in range(-1, 10)]


@given(st.lists(guards, min_size=1, max_size=2))
def test_the_answer_is_that_of_trying_everything(both: list[Expression]) -> None:
    used = {name: name in str(both) for name in ("v", "w", "word", "n")}
    domains: dict[str, Iterable[object]] = {
        "p": [False, True],
        "q": [False, True],
        "v": GRID if used["v"] else [0.0],
        "w": GRID if used["w"] else [0.0],
        "word": ["a", "b", "c"],
        "n": range(-1, 5),
    }
    everything = (dict(zip(domains, values, strict=True)) for values in product(*domains.values()))
    possible = any(all(evaluate(guard, values) for guard in both) for values in everything)
    answer = QUESTION.witness(both)
    assert answer.holds is possible
    if possible:
        rest = {"p": False, "q": False, "v": 0.0, "w": 0.0, "word": "", "n": 0}
        assert all(evaluate(guard, {**rest, **dict(answer.values)}) for guard in both)


def ask(text: str, **known: object) -> object:
    types = {"n": INT, "m": INT, "v": REAL, "mode": Type("enum", ("slow", "fast")), "ob": Type("Pose"), "flag": BOOL}
    classes = {"Pose": {"x": REAL, "path": Type("Pose", rank=1)}}
    return Question(types, classes, {"m": range(1000)}, known).witness([parse_expression(text)]).holds


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("n > 3 && n < 5", True),
        ("n > 3 && n < 4", False),
        ("n > 3.5 && n < 4.5", True),
        ("v > 3 && v < 4", True),
        ("m > 998", True),
        ("m > 999", False),
        ("m < 0", False),
        ("mode != 'slow' && mode != 'fast'", False),
        ("ob.x < 0 && ob.x > -1", True),
        ("size(ob.path) > 2 && size(ob.path) < 4", True),
        ("size(ob.path) < 0", False),
        ("n + 1 > n", True),
        ("n * n == 49 && n > 7", None),
        ("v < n", True),
        ("1 / n > 0 && n == 0", None),
        ("flag && n > 9223372036854775806", True),
    ],
)
def test_questions_with_known_answers(text: str, holds: bool | None) -> None:
    assert ask(text) is holds


def test_known_values_are_not_chosen_again() -> None:
    assert ask("n == 3", n=4) is False and ask("n == 3", n=3) is True
    assert ask("ob.x > 1 && v > 1", ob={"x": 0.5}) is False
    assert ask("ob.x > 1 && size(ob.path) == 0", ob={"x": 1.5}) is True


def test_terms_of_a_message_nest_without_touching_the_known_one() -> None:
    known = {"ob": {"x": 1.0}}
    assert with_terms(known, {"ob.y": 2.0}) == {"ob": {"x": 1.0, "y": 2.0}} and known == {"ob": {"x": 1.0}}


def test_a_search_that_would_take_long_ends_undecided() -> None:
    names = {f"b{at}": BOOL for at in range(30)}
    never = parse_expression(" && ".join(names) + " && !b0")
    budget = Budget(100_000)
    assert Question(names, {}).witness([never], budget).holds is None
    assert 100_000 - budget.left <= EFFORT + 1
    assert Question(names, {}).witness([never], Budget(3)).holds is None
