"""Formulas over messages: quantifiers, items of lists, units, and what is said where one fails or means nothing."""

import pytest

from parcours.errors import BadModel
from parcours.model import check_text, parse_model
from parcours.model.expression import evaluate, parse_expression, parse_formula
from parcours.model.expression.explaining import explain
from parcours.model.writing import write_model

WAY = {"way": [{"v": 1.0, "t": 0}, {"v": -3.0, "t": 1}, {"v": 2.0, "t": 1}], "goal": True, "n": 2}

MODEL = """
parcours: model/1
name: cart
constants: {v_max: 2.0, least: -1}
messages:
  Order: {fields: {target: {type: int}}}
  State: {fields: {v: {type: real}}}
  Track: {fields: {way: {type: State, shape: [n]}, ok: {type: bool}}}
channels:
  ask: {from: environment, to: Cart, message: Order, topic: /go}
  reply:
    from: Cart
    to: environment
    message: Track
    topic: /go
    ensures:
      speed: "all s in it.way: abs(s.v) <= v_max"
      answers: it.ok => size(it.way) >= request.target && request.target >= least
components:
  Cart:
    variables: {at: {type: int, initial: 0}}
    invariants: {bounded: at >= 0 && at <= 9}
    machines:
      m:
        initial: idle
        transitions:
          c1:
            {from: idle, to: idle, event: ask(it), action: at := it.target, message: reply, ensures: {go: old.at != at}}
"""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("all s in way: s.v <= 2", True),
        ("all s in way: s.v >= 0", False),
        ("some s in way: s.v < 0 && s.t == 1", True),
        ("all k in 1..size(way) - 1: way[k].t >= way[k - 1].t", True),
        ("all k in 1..size(way) - 1: way[k].t > way[k - 1].t", False),
        ("all k in 5..1: way[k].v > 100", True),
        ("(sum s in way: abs(s.v)) == 6", True),
        ("goal => n == 2", True),
        ("!goal => way[7].v == 0", True),
        ("all a in way: some b in way: near(a.v + b.v, -1, 3)", True),
        ("20 ms + 1 s == 1.02 && 90 deg > 1.57 && 2 cm == 0.02 && near(wrap(370 deg), 10 deg, 1e-9)", True),
        ("near(atan2(1, 0), 90 deg, 1e-12) && near(sin(30 deg), 0.5, 1e-12)", True),
    ],
)
def test_a_formula_has_the_value_that_it_says(text: str, value: bool) -> None:
    formula = parse_formula(text)
    assert evaluate(formula, WAY) is value
    assert parse_formula(str(formula)) == formula, "its text reads back"


@pytest.mark.parametrize("text", ["all s in way: s.v > 0", "way[0].v > 0", "goal => n > 1", "sin(1) > 0"])
def test_guards_have_no_formulas(text: str) -> None:
    with pytest.raises(BadModel):
        parse_expression(text)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("all s in way: s.v >= 0", "s = way[1]: s.v is -3, but must be >= 0"),
        ("goal => n == 3", "n is 2, but must be == 3; demanded because goal"),
        ("n == 2 && all k in 0..2: way[k].v < 2", "k = 2: way[k].v is 2, but must be < 2"),
        ("near(way[1].v, 0, 5 cm)", "way[1].v is -3, but must be within 0.05 of 0"),
        ("some s in way: s.v > 5", "some s in way: s.v > 5 is false"),
    ],
)
def test_what_fails_names_the_first_item_and_the_values(text: str, why: str) -> None:
    assert explain(parse_formula(text), WAY) == why


def test_an_item_that_is_not_there_is_an_error() -> None:
    with pytest.raises(BadModel, match=r"a list of 3 has items from 0 on, but none is at 3.*no-item"):
        evaluate(parse_formula("way[n + 1].v > 0"), WAY)


def test_a_model_says_formulas_and_keeps_them_when_it_is_written() -> None:
    model = parse_model(MODEL)
    speed, answers = model.channel("reply").ensures
    assert str(speed.condition) == "all s in it.way: abs(s.v) <= 2.0"
    assert "request.target >= -1" in str(answers.condition)
    assert speed.text == "all s in it.way: abs(s.v) <= v_max"
    assert [each.name for each in model.component("Cart").invariants] == ["bounded"]
    assert parse_model(write_model(model)) == model


@pytest.mark.parametrize(
    ("old", "new", "slug"),
    [
        ("abs(s.v) <= v_max", "abs(s.speed) <= v_max", "unknown-field"),
        ("abs(s.v) <= v_max", "abs(s.v) <= v_maxi", "unknown-name"),
        ("abs(s.v) <= v_max", "s.v", "type"),
        ("all s in it.way", "all s in it.ok", "type"),
        ("old.at != at", "old.there != at", "unknown-field"),
        ("at >= 0 &&", "at >= 0 furlongs &&", "unknown-unit"),
        ("at <= 9", "it <= 9", "unknown-name"),
        ("v_max: 2.0", "v_max: fast", "no-value"),
    ],
)
def test_what_a_formula_cannot_mean_is_found_before_any_case_runs(old: str, new: str, slug: str) -> None:
    assert old in MODEL
    found = check_text(MODEL.replace(old, new))
    assert slug in {finding.rule for finding in found.findings if finding.severity == "error"}
