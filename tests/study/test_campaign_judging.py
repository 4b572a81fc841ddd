"""Many cases judged at once: the verdicts and reasons of judging one case after the other, whatever the formulas."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
import pytest

from parcours.data import InputModel, enumeration, split
from parcours.errors import BadModel
from parcours.study.campaign.judging import judge, read_by
from parcours.study.campaign.rules import Fact, Rule, outcome_of
from parcours.study.campaign.study import CampaignStudy
from parcours.study.parameters import Parameter, Scalar
from parcours.verdict.judgement import VERDICTS

INPUTS = InputModel(
    "made",
    (
        split("x", "m", [-2.0, 0.0, 2.0]),
        split("k", "1", [-3, 0, 3], kind="integer"),
        enumeration("mode", ["slow", "fast"]),
    ),
)
FACTS = (Fact("hit", "bool"), Fact("late", "bool"), Fact("n", "int"), Fact("m", "int"), Fact("gap"), Fact("way"))
OWN = (Parameter("limit", "real", 0.5), Parameter("most", "int", 3), Parameter("style", "text", "plain"))
SETTINGS: dict[str, Scalar] = {"limit": 0.25, "most": 2, "style": "plain"}


def study(fail: list[str], inconclusive: list[str] | None = None) -> CampaignStudy:
    failing, leaving_open = (tuple(Rule(text) for text in texts) for texts in (fail, inconclusive or []))
    return CampaignStudy("made", lambda x: {}, INPUTS, FACTS, failing, leaving_open, own=OWN)


def facts(of: CampaignStudy, n: int, seed: int) -> np.ndarray:
    """Return facts of which many are zero, equal, or about as large as what floats hold of integers."""
    rng = np.random.default_rng(seed)
    found = np.zeros(n, of.dtype)
    found["number"] = rng.permutation(4 * n)[:n]
    for name in ("hit", "late"):
        found[name] = rng.random(n) < 0.5
    large = np.array([0, 1, -1, 2, 7, 2**53, 2**53 + 1, 2**62, -(2**62) - 1])
    found["n"], found["m"] = rng.choice(large[:5] if seed % 2 else large, (2, n))
    found["gap"], found["way"] = rng.choice([0.0, -0.0, 0.1, 0.2, 0.30000000000000004, -1.5, 1e200, 3.0], (2, n))
    found["error"][rng.random(n) < 0.1] = 1
    found["reason"][found["error"] != 0] = rng.choice(
        [b"it raised", "Gr\u00f6\u00dfe".encode(), b""], found["error"].sum()
    )
    return found


def one_by_one(of: CampaignStudy, rows: np.ndarray) -> list[tuple[str, str]]:
    values = of.values(rows["number"], 1)
    rulings = [outcome_of(of, row, of.known(each, SETTINGS)) for row, each in zip(rows, values, strict=True)]
    return [(str(one.verdict), one.reason) for one in rulings]


def at_once(of: CampaignStudy, rows: np.ndarray) -> list[tuple[str, str]]:
    rulings = judge(of, rows, SETTINGS, 1)
    return list(zip(map(str, rulings.verdicts), rulings.words, strict=True))


def number(draw: random.Random, depth: int) -> str:
    if depth == 0 or draw.random() < 0.3:
        return draw.choice(
            ["n", "m", "gap", "way", "x", "k", "limit", "most", "0", "1", "0.1", "3", "2.5", "-n", "-gap"]
        )
    one, other = number(draw, depth - 1), number(draw, depth - 1)
    return draw.choice([
        *(f"({one} {sign} {other})" for sign in "++--**/%"), f"abs({one})", f"min({one}, {other})", f"sqrt({one})",
        f"max({one}, {other})", f"floor({one})", f"hypot({one}, {other})",
    ])  # fmt: skip


def condition(draw: random.Random, depth: int) -> str:
    if depth == 0 or draw.random() < 0.2:
        return draw.choice(["hit", "late", "!hit", "mode == 'fast'", "style != 'plain'", "true"])
    if draw.random() < 0.5:
        return f"{number(draw, depth)} {draw.choice(['<', '<=', '>', '>=', '==', '!='])} {number(draw, depth)}"
    one, other = condition(draw, depth - 1), condition(draw, depth - 1)
    return draw.choice([f"({one} && {other})", f"({one} || {other})", f"!({one})", f"({one}) == ({other})"])


@pytest.mark.parametrize("seed", range(8))
def test_verdicts_and_reasons_are_those_of_one_case_after_the_other(seed: int) -> None:
    draw, kinds = random.Random(seed), set[str]()
    for _ in range(60):
        texts = [condition(draw, draw.randint(0, 3)) for _ in range(3)]
        try:
            of = study(texts[:2], texts[2:])
        except BadModel:
            continue  # `1 % 0.1`, or the like
        rows = facts(of, 40, draw.randrange(1000))
        found = at_once(of, rows)
        assert found == one_by_one(of, rows), texts
        kinds |= {one for one, _ in found}
        some = rows[[name for name in rows.dtype.names or () if name in read_by(of)]]
        assert judge(of, some, SETTINGS, 1).codes.tolist() == [VERDICTS.index(one) for one, _ in found]
    assert kinds == {"pass", "fail", "inconclusive", "error"}


@pytest.mark.parametrize(
    "text",
    ["n + 1 > n", "n == m", "n * m > 0", "1 / gap > 2", "gap != 0 && 1 / gap > 2", "sqrt(way) > 1", "gap * gap > 1",
     "hypot(gap, way) > 0.31622776601683794", "n % 2 == 1", "floor(gap) == 0", "gap + 0.2 == 0.30000000000000004"],
)  # fmt: skip
def test_where_columns_could_answer_otherwise_they_do_not(text: str) -> None:
    of = study([text])
    for seed in range(6):
        rows = facts(of, 100, seed)
        assert at_once(of, rows) == one_by_one(of, rows)


def test_most_formulas_are_not_evaluated_case_by_case(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> Callable[..., object]:
        raise AssertionError("this formula is one for columns")

    monkeypatch.setattr("parcours.study.campaign.judging.compiled", refused)
    of = study(
        ["hit || gap > limit && !late", "k * k > most * 2 + abs(n)", "x / 2 < -0.9"], ["gap != 0 && 1 / gap < -9"]
    )
    rows = facts(of, 500, 1)
    assert len(set(at_once(of, rows))) > 4
