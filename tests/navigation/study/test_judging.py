from __future__ import annotations

from dataclasses import replace

import pytest

from parcours.errors import BadRequest, BadSuite
from parcours.study import judge_case
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.suite import Case, combine
from parcours.verdict.judgement import Verdict
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes
from parcours_ramp.components.model import component_inputs
from parcours_ramp.components.study import interaction_cases, run_functional
from parcours_ramp.system.study import system_study


def suite_of(name: str, n_cases: int) -> list[Case]:
    study = find(name)
    return list(study.suite(settings_of(study.parameters, {}), 3, n_cases))


SYSTEM = suite_of("ramp_system", 12)
COMPONENTS = suite_of("ramp_components", 67)


@pytest.mark.parametrize("schedule", ["original", "guarded"])
def test_a_system_case_is_judged_as_in_its_campaign(schedule: str) -> None:
    facts = system_study(schedule, seed=3)(0, len(SYSTEM))
    expected = [VERDICT_OF[Outcome(int(code))] for code in outcomes(facts)]
    judged = [judge_case(case, schedule=schedule) for case in SYSTEM]
    assert [each.verdict for each in judged] == expected
    assert [each.why for each in judged] == [explain(record) for record in facts]


def test_a_component_case_is_judged_as_in_its_study() -> None:
    for case in COMPONENTS[::13]:
        assert judge_case(case).verdict is run_functional(case).judgement.verdict


def test_abstract_cases_themselves_are_combined_as_their_ids_are() -> None:
    cases = interaction_cases()
    plans = [combine("ramp_components", each, component_inputs(), seed=3) for each in (list(cases), cases.values())]
    assert plans[0] == plans[1] and judge_case(plans[1].case(0)).verdict is Verdict.PASS


def test_an_explanation_holds_the_case_the_reason_the_facts_and_a_replay() -> None:
    case = SYSTEM[0]
    said = str(judged := judge_case(case))
    assert said.startswith(f"{judged.verdict}: {judged.why}\n") and case.id in said
    assert (
        "x1 = " in said
        and "t_end = " in said
        and f"--case {case.number} --out out && parcours replay out {case.number}" in said
    )


def test_cases_of_the_published_protocol_are_known_by_their_ids() -> None:
    [case] = SystemCases(3, "published", study="ramp_system").suite(1)
    assert "--protocol published" in judge_case(case).replay


def test_a_case_that_is_not_the_studys_own_is_refused() -> None:
    case = SYSTEM[0]
    for foreign in (
        replace(case, values=(case.values[0] + 0.1, *case.values[1:])),
        replace(case, number=1),
        replace(COMPONENTS[0], abstract="ITP9"),
    ):
        with pytest.raises(BadSuite, match=r"write the suite again.*\[foreign-case\]"):
            judge_case(foreign)
    for case, schedule, slug in (
        (COMPONENTS[0], "guarded", r"it has no parameter 'schedule'.*\[parameter-unknown\]"),
        (SYSTEM[0], "fast", r"--schedule: .*'fast' was given.*\[parameter-choice\]"),
    ):
        with pytest.raises(BadRequest, match=slug):
            judge_case(case, schedule=schedule)
