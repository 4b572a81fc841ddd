"""Cases of a campaign that are run again, component by component: do data and order conform, are the facts the same?

    compiled loop  ----> facts               the same bits
    component form ----> facts, messages ----> conformance to the model, with its formulas over data; references

The compiled loop sends no messages: what is judged here is what it computes by the same kernels. Both draw the case's
latencies from one stream, in one order.
"""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from parcours.errors import BadResults
from parcours.kernels import suspended
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Table
from parcours.report.writing import write_text
from parcours.study.carrying import require_carried
from parcours.study.protocol import Progress, Reported
from parcours.suite import Case
from parcours.verdict.conformance import check
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.study.campaigns import Campaign
from parcours_navigation.study.results import CampaignResults
from parcours_ramp.components.model import OUTSIDE, component_model
from parcours_ramp.components.references import references
from parcours_ramp.components.specimens import specimens
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SystemStudy

FILE = "sampled.json"


def judge_sampled(study: SystemStudy, number: int) -> Judgement:
    """Run a case in both forms and judge the component form's messages and facts."""
    ran = run_components(study, number)
    with suspended():  # a mutant is judged by the original
        model = component_model(study.parameters.schedule)
        conforms = check(ran.trace, model, allowance=OUTSIDE, data=message_of).judgement
    if not conforms.passed:
        return conforms
    case = Case("sampled", number, "component-form", 0, (), (), study.time_limit, study.cases.seed)
    known = {"numbers": dataclasses.asdict(study.parameters)}
    with suspended():
        for reference in references(model):
            referred = reference.judge(case, ran.trace, known)
            if not referred.passed:
                return referred
    facts, _, _ = study.track(number)
    assert ran.facts is not None
    for name in facts.dtype.names or ():
        if ran.facts[name].tobytes() != facts[name].tobytes():
            rule = f"{name} is {ran.facts[name][0]} component by component, but {facts[name][0]} in the compiled loop"
            return Judgement(Verdict.FAIL, rule)
    return Judgement(Verdict.PASS, conforms.why)


def sample(study: SystemStudy, numbers: Sequence[int], folder: Path, progress: Progress) -> None:
    """Judge the cases that are missing in a folder; each verdict is kept at once."""
    require_carried(component_model(study.parameters.schedule), message_of, specimens)
    found = read_sampled(folder)
    for done, number in enumerate(numbers):
        progress("cases component by component", done, len(numbers))
        if str(number) not in found:
            judgement = judge_sampled(study, number)
            found[str(number)] = {"verdict": str(judgement.verdict), "why": judgement.why[:2000]}
            write_text(folder / FILE, json.dumps(found, indent=1) + "\n")
    progress("cases component by component", len(numbers), len(numbers))


def read_sampled(folder: Path) -> dict[str, dict[str, str]]:
    """Return verdict and reason of each sampled case by its number; empty if none was. Raises BadResults."""
    path = folder / FILE
    if not path.exists():
        return {}
    try:
        document = json.loads(path.read_bytes())
        return {str(int(k)): {"verdict": str(Verdict(v["verdict"])), "why": str(v["why"])} for k, v in document.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        rule = f"sampled cases must be readable, but: {error}"
        raise BadResults(str(path), rule, "delete it, and run the command again", slug="results-sampled") from error


class SampledCampaign(CampaignResults):
    """A campaign some of whose cases were run again component by component; one that fails there has failed."""

    def __init__(self, found: Campaign, folder: Path, study: str) -> None:
        super().__init__(found, folder, study)
        self._sampled = read_sampled(folder)

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case, and of the sampled ones as cases of their own."""
        again = [
            CaseResult(f"{self._id(self.found.cases.id(int(number)))}/data", Verdict(one["verdict"]), 0.0, one["why"])
            for number, one in self._sampled.items()
        ]
        return [*super().cases(), *again]

    def case_verdicts(self) -> Sequence[Verdict]:
        """Return the verdicts of `cases`, without their reasons."""
        return [*super().case_verdicts(), *(Verdict(one["verdict"]) for one in self._sampled.values())]

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""
        return super().verdict_counts() + Counter(Verdict(one["verdict"]) for one in self._sampled.values())

    def causes(self) -> Sequence[str]:
        """Return why each of `cases` did not pass, in words that cases share."""
        passed = str(Verdict.PASS)
        again = ["" if one["verdict"] == passed else one["why"][:200] for one in self._sampled.values()]
        return [*super().causes(), *again]

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places."""
        n = len(self.found.facts)
        every = self.cases() if any(k >= n for k in places) else []
        return [every[k] for k in places] if every else super().some_cases(places)

    def reported(self, name: str) -> Reported:
        """Return the table of sampled cases; nothing without any."""
        rows = tuple((number, one["verdict"], one["why"]) for number, one in self._sampled.items())
        columns = Column("case"), Column("verdict"), Column("why")
        note = "Run again by components, with its latencies; messages judged by model and references, facts compared."
        tables = [Table(f"Sampled cases, {name}", columns, rows, note)] if rows else []
        return Reported(tables, lambda: tables, {})
