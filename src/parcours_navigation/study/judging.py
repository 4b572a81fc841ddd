"""Executes one system case of a planner again, in simulated time, and judges it."""

from __future__ import annotations

import numpy as np

from parcours.errors import BadSuite
from parcours.study.protocol import Judged
from parcours.suite import Case
from parcours_navigation.cases.running import CaseStudy, Family
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.requirements.judging import explained, verdicts
from parcours_navigation.requirements.requirement import Requirements


def judge_system(study: CaseStudy, cases: Family, case: Case, command: str) -> Judged:
    """Execute a case of any study that runs these cases, and judge it; `command` runs the campaign.

    Raises BadSuite if there is no such case, or its number and seed give other values.
    """
    numbers = np.array([case.number])
    id = cases.id(case.number)
    wrong = ""
    if case.id.partition("/")[2] != id.partition("/")[2] or case.names != cases.inputs.names:
        wrong = f"case {case.number} of seed {case.seed} is {id}"
    elif case.values != tuple(cases.values(numbers)[0].tolist()):
        wrong = f"its number and its seed {case.seed} give other values"
    if wrong:
        rule = f"a case must be one that the study has, but {wrong}"
        raise BadSuite(f"case {case.id!r}", rule, "write the suite again with this version", slug="foreign-case")
    facts = study.run(numbers)
    replay = f"{command} --case {case.number} --out out && parcours replay out {case.number} --html replay.html"
    (verdict,) = verdicts(facts, study.requirements)
    return Judged(case, verdict, explained(facts[0], study.requirements), _shown(facts[0], study.requirements), replay)


def _shown(record: np.void, requirements: Requirements) -> tuple[tuple[str, str], ...]:
    """Return the judge's facts: times in seconds, lengths in metres; and how robustly requirements are met."""
    found = []
    for name in FACTS.names or ():
        value = record[name].item()
        if name.startswith("t_") or name == "halted_time":
            text = "never" if value == NEVER else f"{value * 1e-9:.3f} s"
        else:
            text = f"{value:.4g}"
        found.append((name, text))
    for k, one in enumerate(requirements.formulas):
        found.append((f"robustness({one.name})", one.by(float(record["robustness"][k]))))
    return tuple(found)
