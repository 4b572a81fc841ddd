"""Compiled drawing gives the bits of plain drawing, whatever the kinds of inputs and the rules."""

from __future__ import annotations

import numpy as np
import pytest

from parcours.data import InputModel, draw, parse_input_model, select
from parcours.data.compiled_drawing import Drawer
from parcours.errors import BadDomain, BadRequest


def _model(*rules: str) -> InputModel:
    text = """
parcours: data/1
name: mixed
parameters:
  a: {unit: m, blocks: ["[-1, 0]", "(0, 2]"]}
  b: {unit: m, blocks: ["[0.5, 1]", "(1, 3]"]}
  n: {unit: "1", kind: integer, edges: [2, 4, 7]}
  turn: {unit: rad, kind: angle, blocks: ["[-2, 3)", "[3, 4]"]}
  mode: {kind: enumeration, values: [slow, fast, off]}
constraints:
"""
    return parse_input_model(text + "".join(f'  r{k}: {{row: "{rule}"}}\n' for k, rule in enumerate(rules)), "m.yaml")


RULES = [
    ("a + b * 2 - n < 3",),
    ("hypot(a, b, turn) >= 1", "-a <= b && !(n == 3)"),
    ("min(a, b) > -0.5 || max(a, n) >= 4", "abs(turn) != 1 && floor(b) <= 2"),
    ("mode == 'fast' || a < 1",),
    ("b == 0 || a / b < 1",),  # which has no value at b = 0
    ("sqrt(b) > a", "n % 2 == 0 || a < 1"),
]


@pytest.mark.parametrize("rules", RULES)
def test_the_same_bits_as_plain_drawing(rules: tuple[str, ...]) -> None:
    model, cases = _model(*rules), np.array([7, 2**40, *range(200)])
    rows = select("each_choice", model.sizes, np.arange(len(cases)), seed=3)
    assert Drawer(model).draw(rows, cases, seed=5).tobytes() == draw(model, rows, cases, seed=5).tobytes()


def test_rows_that_nothing_meets_and_cases_that_do_not_fit_are_refused_alike() -> None:
    model = _model("a > 5")
    rows = np.zeros((1, len(model.domains)), np.int64)
    for number, tries, kind in ((0, 50, BadDomain), (-1, 50, BadRequest)):
        said = []
        for ask in (Drawer(model).draw, lambda *given, **more: draw(model, *given, **more)):
            with pytest.raises(kind) as error:
                ask(rows, np.array([number]), tries=tries)
            said.append(str(error.value))
        assert said[0] == said[1]
