"""Requirements and pass rules become verdicts, reasons and tables, and survive a manifest."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.verdict.judgement import Verdict
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault
from parcours_navigation.requirements.judging import (
    FAR,
    explained,
    finite_robustness,
    holds,
    joined,
    values_of,
    verdicts,
    violations,
)
from parcours_navigation.requirements.requirement import (
    NO_REQUIREMENTS,
    Requirements,
    kept,
    read_requirements,
    requirements_of,
)
from parcours_navigation.requirements.tables import requirement_table, violations_of
from parcours_navigation.requirements.vocabulary import VALUES

ASKED = requirements_of(
    {"keeps-away": "always clearance > 0.05", "arrives": "eventually goal_distance < 0.2"}, ["travelled > 4"]
)


def reached(n: int) -> NDArray[np.void]:
    """Return facts of n cases that reached the goal."""
    facts = np.zeros(n, FACTS)
    facts["number"], facts["t_goal"], facts["t_end"] = np.arange(n), 9_000_000_000, 9_000_000_000
    facts["t_goal_after"] = NEVER
    return facts


def judged(*rows: tuple[float, float], asked: Requirements = ASKED) -> NDArray[np.void]:
    """Return facts of cases with these values of robustness, each decided at 2.5 s."""
    return joined(reached(len(rows)), {k: np.array([row, (2.5, 2.5)]) for k, row in enumerate(rows)}, asked)


def test_a_case_fails_if_a_requirement_is_violated_and_passes_at_zero() -> None:
    facts = judged((0.1, 0.2), (-0.01, 0.2), (0.0, 0.0), (0.1, -np.inf), (np.nan, 0.1))
    assert verdicts(facts, ASKED) == [
        Verdict.PASS, Verdict.FAIL, Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE
    ]  # fmt: skip
    assert verdicts(reached(2), NO_REQUIREMENTS) == [Verdict.PASS, Verdict.PASS]


def test_the_reason_names_formula_time_and_amount() -> None:
    said = explained(judged((-0.012, 0.2))[0], ASKED)
    assert said.startswith("violates keeps-away at 2.50 s by 0.012 m: always clearance > 0.05; goal reached at 9.00 s")
    assert "no value" in explained(judged((np.nan, 0.2))[0], ASKED)
    far = judged((0.1, 0.1))
    far["travelled"] = 4.5
    assert explained(far[0], ASKED).startswith("fails by travelled > 4 (travelled = 4.5 m); goal reached")
    assert verdicts(far, ASKED) == [Verdict.FAIL]


def test_a_sound_outcome_that_fails_stays_what_it_is() -> None:
    facts = judged((-0.1, 0.1), (-0.1, 0.1), (0.1, 0.1))
    facts["error"][0] = PlannerFault.RAISED
    facts["n_robot_contacts"][2] = 1
    facts["t_robot_contact"][2], facts["t_shared_contact"][2] = 1, NEVER
    assert verdicts(facts, ASKED) == [Verdict.ERROR, Verdict.FAIL, Verdict.FAIL]


def test_a_blocked_goal_does_not_excuse_a_violation() -> None:
    facts = judged((-0.1, 0.1), (0.1, 0.1))
    facts["t_goal"], facts["goal_gap"] = NEVER, -0.1
    assert verdicts(facts, ASKED) == [Verdict.FAIL, Verdict.INCONCLUSIVE]


def test_cases_in_error_are_not_judged() -> None:
    plain = reached(2)
    plain["error"][0] = PlannerFault.RAISED
    facts = joined(plain, {0: np.ones((2, 2)), 1: np.ones((2, 2))}, ASKED)
    assert np.isnan(facts["robustness"][0]).all() and (facts["robustness"][1] == 1.0).all()
    assert np.isnan(violations(facts, ASKED)[0]).all()
    assert [one.n for one in violations_of(facts, ASKED)] == [1, 1, 1]


def test_facts_without_requirements_keep_their_layout_and_bytes() -> None:
    plain = reached(3)
    assert joined(plain, {}, NO_REQUIREMENTS) is plain
    assert NO_REQUIREMENTS.facts(FACTS) is FACTS and NO_REQUIREMENTS.manifest() == {}
    only_rules = requirements_of({}, ["time > 30"])
    assert only_rules.facts(FACTS) is FACTS and only_rules.manifest()
    with_them = joined(plain, {}, ASKED)
    assert all((with_them[name] == plain[name]).all() for name in ("number", "t_end", "reason"))


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("clearance < 5 cm", [True, False]),
        ("not clearance < 0.05", [False, True]),
        ("time >= 9 s and travelled > 1", [False, True]),
        ("clearance > 1 or travelled > 1", [False, True]),
        ("clearance < 5 cm -> travelled > 1", [False, True]),
        ("-travelled + 1 < 0", [False, True]),
        ("max(travelled, clearance) / 2 > 1", [False, True]),
        ("mean_speed > 0", [False, True]),
        ("mean_speed > 0 or mean_speed <= 0", [False, True]),
        ("not mean_speed > 0", [True, False]),
        ("hypot(3, 4) > 4.9", [True, True]),
    ],
)
def test_a_pass_rule_holds_where_its_values_say_so(rule: str, expected: list[bool]) -> None:
    facts = reached(2)
    facts["min_clearance"], facts["travelled"] = [0.01, 0.3], [0.5, 3.0]
    facts["measures"]["mean_speed"] = [np.nan, 0.2]
    assert holds(requirements_of({}, [rule]).rules[0].formula, facts).tolist() == expected


def test_every_value_of_a_case_can_be_read() -> None:
    for name in VALUES:
        assert values_of(reached(3), name).shape == (3,), name
        assert holds(requirements_of({}, [f"{name} >= 0"]).rules[0].formula, reached(3)).all()


def test_the_table_has_shares_with_intervals_and_the_worst_case() -> None:
    facts = judged((0.3, 1.0), (-0.2, -np.inf), (0.1, 2.0), (0.2, 0.5))
    first, second, rule = violations_of(facts, ASKED)
    assert (first.violated, first.n, first.worst, first.case, first.median) == (1, 4, -0.2, 1, 0.1)
    assert (second.worst, second.case) == (-np.inf, 1)
    assert (rule.name, rule.violated, rule.case) == ("fail", 0, None)
    table = requirement_table({"mine": (first, second, rule)})
    assert table is not None
    assert table.rows[0] == (
        "mine", "keeps-away", "always clearance > 0.05", 4, "25.0% [4.6%, 69.9%]", "-0.2 m", 1, "0.1 m"
    )  # fmt: skip
    json.dumps([one.document() for one in (first, second, rule)], allow_nan=False)
    assert requirement_table({"mine": ()}) is None
    assert finite_robustness(facts, ASKED).min() == -FAR


def test_requirements_survive_their_manifest() -> None:
    again = kept(json.loads(json.dumps(ASKED.manifest())), "folder")
    assert again == ASKED
    assert kept({}, "folder") == NO_REQUIREMENTS
    wrong: object
    for wrong in ({"require": [["a", "b"]], "fail": []}, {"require": 3}, [], {"fail": []}):
        with pytest.raises(BadResults, match="requirements that this version reads"):
            kept({"requirements": wrong}, "folder")


def test_options_name_their_requirements() -> None:
    found = read_requirements("near: eventually goal_distance < 0.2;\n slow: always speed < 0.3;", "time > 3; x > 1")
    assert found.names == ("near", "slow") and len(found.rules) == 2
    assert not read_requirements("", " ; ")
    for text, slug in {
        "always speed < 1": "require-form",
        "a: x > 0; a: y > 0": "require-form",
        "two words: x > 0": "require-name",
        "7: x > 0": "require-name",
        ": x > 0": "require-name",
        "a:": "require-syntax",
        ";".join(f"r{k}: x > 0" for k in range(65)): "require-size",
    }.items():
        with pytest.raises(BadRequest) as refused:
            read_requirements(text)
        assert refused.value.slug == slug, text
