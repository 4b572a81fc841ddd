"""Cases of a campaign that are run again, component by component: do data and order conform, are the facts the same?

    compiled loop  ----> facts               the same bits
    component form ----> facts, messages ----> conformance to the model, with its formulas over data; references

The compiled loop sends no messages: what is judged here is what it computes by the same kernels. Both draw the case's
latencies from one stream, in one order.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from parcours.kernels import suspended
from parcours.model.structure import Cefsm
from parcours.report.writing import write_text
from parcours.run.trace import Trace, transitions
from parcours.study.payload_fields import require_carried
from parcours.study.protocol import Progress
from parcours.suite import Case
from parcours.verdict.conformance import check
from parcours.verdict.contracts import contracts_of
from parcours.verdict.judgement import Judgement, Verdict
from parcours_ramp.components.model import OUTSIDE, component_model
from parcours_ramp.components.references import references
from parcours_ramp.components.sample_payloads import specimens
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import ComponentRun, run_components
from parcours_ramp.system.sampled_results import FILE, read_sampled
from parcours_ramp.system.study import SystemStudy


@dataclasses.dataclass(frozen=True, slots=True)
class SampledJudgement:
    """What came of a case that was run again."""

    judgement: Judgement
    pairs: frozenset[str]  # of transitions that a component took one straight after the other, as `p12 p13`
    judged: str  # which checks of its data were made, see `Contracts.mask`


def judge_sampled(study: SystemStudy, number: int) -> SampledJudgement:
    """Run a case in both forms and judge the component form's messages and facts."""
    ran = run_components(study, number)
    with suspended():  # a mutant is judged by the original
        model = component_model(study.parameters.schedule)
        found = check(ran.trace, model, allowance=OUTSIDE, data=message_of)
        pairs, mask = _pairs(ran.trace, model), contracts_of(model).mask(found.tally)
        judgement = found.judgement
        if judgement.passed:
            judgement = _referred(study, number, ran.trace, model) or judgement
    if judgement.passed:
        judgement = _compared(study, number, ran) or judgement
    return SampledJudgement(judgement, pairs, mask)


def _referred(study: SystemStudy, number: int, trace: Trace, model: Cefsm) -> Judgement | None:
    case = Case("sampled", number, "component-form", 0, (), (), study.time_limit, study.cases.seed)
    known = {"numbers": dataclasses.asdict(study.parameters)}
    every = (reference.judge(case, trace, known) for reference in references(model))
    return next((one for one in every if not one.passed), None)


def _compared(study: SystemStudy, number: int, ran: ComponentRun) -> Judgement | None:
    facts, _, _ = study.track(number)
    assert ran.facts is not None
    for name in facts.dtype.names or ():
        if ran.facts[name].tobytes() != facts[name].tobytes():
            rule = f"{name} is {ran.facts[name][0]} component by component, but {facts[name][0]} in the compiled loop"
            return Judgement(Verdict.FAIL, rule)
    return None


def _pairs(trace: Trace, model: Cefsm) -> frozenset[str]:
    found = set[str]()
    for component in model.components:
        taken = transitions(trace, component.name)
        for machine in component.machines:
            own = {one.id for one in machine.transitions}
            found.update(map(" ".join, pairwise(one for one in taken if one in own)))
    return frozenset(found)


def sample(study: SystemStudy, numbers: Sequence[int], folder: Path, progress: Progress) -> None:
    """Judge the cases that are missing in a folder; each verdict is kept at once."""
    require_carried(component_model(study.parameters.schedule), message_of, specimens)
    found = read_sampled(folder)
    for done, number in enumerate(numbers):
        progress("cases component by component", done, len(numbers))
        if str(number) not in found:
            one = judge_sampled(study, number)
            kept = {"verdict": str(one.judgement.verdict), "why": one.judgement.why[:2000]}
            found[str(number)] = {**kept, "pairs": ", ".join(sorted(one.pairs)), "judged": one.judged}
            write_text(folder / FILE, json.dumps(found, indent=1) + "\n")
    progress("cases component by component", len(numbers), len(numbers))
