"""One case of any study -> executed again and judged: for pytest, exported scripts, and regression tests by hand."""

from __future__ import annotations

from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Judged
from parcours.suite import Case


def judge_case(case: Case, study: str = "", **settings: object) -> Judged:
    """Execute one case in simulated time and judge it.

    Args:
        case: of a study, as its plan or a suite file holds it.
        study: how a command line names the study; by default the name in the case, which must be registered.
        settings: of the study's parameters, where they differ from the defaults.

    Raises:
        BadRequest: the study or a parameter is unknown, or a value is not allowed.
        BadSuite: the study has no such case, or other values than its number and seed give.

    >>> from parcours.study.finding import find
    >>> case = next(find("ramp_components").suite({}, 1))
    >>> judged = judge_case(case)
    >>> judged.verdict.value, judged.case.id
    ('pass', 'ramp_components/ITP1-tp12.tp21.tp12-0.0.0/0')
    """
    found = find(study or case.study)
    return found.judge(case, settings_of(found.parameters, settings, f"study {found.name}"))
