"""Formulas are read as they are written, in their units; every wrong text is refused where it is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.requirements.parsing import parse
from parcours_navigation.requirements.syntax import Interval, Timed, Until, render, walk
from parcours_navigation.requirements.vocabulary import SIGNALS, VALUES, Meaning, unit_of
from temporal_logic import NAMES, draw_formula

PLAIN = {name: Meaning("1", "") for name in NAMES}


@pytest.mark.parametrize("seed", range(20))
def test_the_canonical_text_of_a_formula_is_read_as_the_same_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(10):
        formula = draw_formula(rng)
        assert parse(render(formula), names=PLAIN).formula == formula


@pytest.mark.parametrize(
    ("text", "grouped"),
    [
        ("x > 1 and y > 1 or x < 0", "(x > 1 and y > 1) or x < 0"),
        ("x > 1 -> y > 1 -> x < 0", "x > 1 -> (y > 1 -> x < 0)"),
        ("not x > 1 and y > 1", "(not (x > 1)) and y > 1"),
        ("always x > 1 and y > 1", "(always (x > 1)) and y > 1"),
        ("x > 1 until y > 1 and x < 0", "(x > 1 until y > 1) and x < 0"),
        ("always x > 1 until y > 1", "(always x > 1) until y > 1"),
        ("x - y - 1 > 2 * x + y", "((x - y) - 1) > ((2 * x) + y)"),
        ("-x * y > 0", "((-x) * y) > 0"),
        ("eventually[0, 2] always[0, end] x > 0", "eventually[0 s, 2 s] (always (x > 0))"),
    ],
)
def test_operators_bind_as_documented(text: str, grouped: str) -> None:
    assert parse(text).formula == parse(grouped).formula


@pytest.mark.parametrize(
    ("text", "interval"),
    [
        ("[0, 1.5 s]", Interval(0, 30)),
        ("[50 ms, 150 ms]", Interval(1, 3)),
        ("[50, 150 ms]", Interval(1, 3)),
        ("[0.15, 0.15]", Interval(3, 3)),
        ("[1, 1 min]", Interval(1200, 1200)),
        ("[2, end]", Interval(40, None)),
        ("[100 ms, end]", Interval(2, None)),
        ("", Interval(0, None)),
    ],
)
def test_times_become_whole_numbers_of_samples(text: str, interval: Interval) -> None:
    always, until = parse(f"always{text} x > 0").formula, parse(f"x > 0 until{text} y > 0").formula
    assert isinstance(always, Timed) and isinstance(until, Until)
    assert always.interval == until.interval == interval


@pytest.mark.parametrize(
    ("text", "same"),
    [("clearance > 5 cm", "clearance > 0.05"), ("speed < 10 cm/s", "speed < 0.1"), ("time < 2 min", "time < 120"),
     ("acceleration < 1 m/s^2", "acceleration < 1"), ("heading < 180 deg", "heading < 3.141592653589793")],
)  # fmt: skip
def test_numbers_are_in_si_units(text: str, same: str) -> None:
    assert parse(text).formula == parse(same).formula


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("always clearance > 0.05", "m"),
        ("speed < 1 and acceleration < 1", "1"),
        ("hypot(x, y) < 3 and goal_distance > 0.1 m", "m"),
        ("speed * time < goal_distance", "m"),
        ("sqrt(x * y) < 3 m", "m"),
        ("goal_distance / speed > 3 s", "s"),
        ("speed * yaw_rate < 1", "m/s^2"),
        ("imminent", "1"),
    ],
)
def test_robustness_has_the_unit_of_all_comparisons_if_they_share_one(text: str, unit: str) -> None:
    assert unit_of(parse(text).dimension) == unit


WRONG = {
    "": "require-syntax",
    "speed": "require-kind",
    "imminent > 0": "require-kind",
    "not speed": "require-kind",
    "always (x + y)": "require-kind",
    "speed + imminent > 0": "require-kind",
    "sped > 0": "require-name",
    "mean_speed > 0": "require-name",
    "cos(x) > 0": "require-name",
    "speed > 3 s": "require-unit",
    "x + time > 3": "require-unit",
    "max(x, time) > 3": "require-unit",
    "speed > 3 knots": "require-unit",
    "speed > 3 m/s^3": "require-unit",
    "always[0, 3 m] x > 0": "require-unit",
    "always[1, 0] x > 0": "require-interval",
    "always[0, 0.07] x > 0": "require-interval",
    "always[0, 1e9] x > 0": "require-interval",
    "always[0, 2 d] x > 0": "require-unit",
    "always[end, 3] x > 0": "require-interval",
    "always[-1, 3] x > 0": "require-interval",
    "always[0 3] x > 0": "require-syntax",
    "always[0, 1" + "0" * 400 + "] x > 0": "require-interval",
    "x > 1" + "0" * 400: "require-syntax",
    "0 < x < 1": "require-syntax",
    "x == 1": "require-syntax",
    "x > 0 && y > 0": "require-syntax",
    "x > 0 until y > 0 until x > 0": "require-syntax",
    "(x > 0": "require-syntax",
    "x > 0)": "require-syntax",
    "x > 0 y": "require-unit",
    "x > y x": "require-syntax",
    "abs(x, y) > 0": "require-syntax",
    "always": "require-syntax",
    "end > 0": "require-syntax",
    "x > \u00e4": "require-syntax",
    "(" * 100 + "x > 0" + ")" * 100: "require-size",
    "not " * 100 + "x > 0": "require-size",
    "-" * 100 + "x > 0": "require-size",
    "x > 0 -> " * 60 + "x > 0": "require-size",
    "(" * 9 + "x" + ("+ x" * 5 + ")") * 9 + "> 0": "require-size",
    "x > " + "1 + " * 2000 + "1": "require-size",
}


@pytest.mark.parametrize(("text", "slug"), WRONG.items(), ids=[f"{text[:24]}..." for text in WRONG])
def test_a_wrong_text_is_refused_by_name(text: str, slug: str) -> None:
    with pytest.raises(BadRequest) as refused:
        parse(text, "keeps-away")
    assert refused.value.slug == slug
    assert refused.value.where == "keeps-away"
    assert len(str(refused.value)) < 900


def test_random_texts_are_read_or_refused_and_nothing_else() -> None:
    rng = np.random.default_rng(0)
    signs = "always eventually until not and or -> ( ) [ ] , 0 1.5 s end < > <= + - * / abs( min( m/s ^2 1e999 ; 0x"
    words = [*SIGNALS, *signs.split(), "\0", "\n"]
    read = 0
    for _ in range(3000):
        text = " ".join(rng.choice(words, int(rng.integers(1, 9))))
        try:
            formula = parse(text).formula
        except BadRequest:
            continue
        read += 1
        assert parse(render(formula)).formula == formula
    assert read > 5


@pytest.mark.parametrize(("text", "before"), [("x > 0 and sped > 0", "x > 0 and "), ("always[1,0] x > 0", "always")])
def test_a_caret_shows_the_place(text: str, before: str) -> None:
    with pytest.raises(BadRequest, match=r"\^") as refused:
        parse(text)
    shown = str(refused.value).partition('in "')[2]
    assert shown.startswith(before + "^")


def test_a_pass_rule_reads_values_of_a_case_and_knows_no_time() -> None:
    parse("clearance < 5 cm or time > 30 s and mean_speed < 0.1", names=VALUES, temporal=False)
    with pytest.raises(BadRequest, match="write it as a requirement"):
        parse("always clearance < 0.05", names=VALUES, temporal=False)
    with pytest.raises(BadRequest, match="speed changes during a case"):
        parse("speed < 0.05", names=VALUES, temporal=False)


def test_every_name_has_a_unit_that_is_understood() -> None:
    for name, meaning in (SIGNALS | VALUES).items():
        assert meaning.words, name
        if meaning.unit not in ("1", "rad", "flag", "rad^2/s^3", "rad^2/s^5", "rad/s", "rad/s^2"):
            assert meaning.dimension != (0.0, 0.0), name
    assert all(part is not None for part in walk(parse("x > 0").formula))
