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
from parcours.verdict.judgement import Judgement, Verdict
from parcours_ramp.components.model import OUTSIDE, component_model
from parcours_ramp.components.references import references
from parcours_ramp.components.sample_payloads import specimens
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.sampled_results import FILE, read_sampled
from parcours_ramp.system.study import SystemStudy


def judge_sampled(study: SystemStudy, number: int, pairs: set[str] | None = None) -> Judgement:
    """Run a case in both forms and judge the component form's messages and facts.

    `pairs` receives the pairs of transitions that a component took one straight after the other, as `p12 p13`.
    """
    ran = run_components(study, number)
    with suspended():  # a mutant is judged by the original
        model = component_model(study.parameters.schedule)
        if pairs is not None:
            pairs |= _pairs(ran.trace, model)
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


def _pairs(trace: Trace, model: Cefsm) -> set[str]:
    found = set[str]()
    for component in model.components:
        taken = transitions(trace, component.name)
        for machine in component.machines:
            own = {one.id for one in machine.transitions}
            found.update(map(" ".join, pairwise(one for one in taken if one in own)))
    return found


def sample(study: SystemStudy, numbers: Sequence[int], folder: Path, progress: Progress) -> None:
    """Judge the cases that are missing in a folder; each verdict is kept at once."""
    require_carried(component_model(study.parameters.schedule), message_of, specimens)
    found = read_sampled(folder)
    for done, number in enumerate(numbers):
        progress("cases component by component", done, len(numbers))
        if str(number) not in found:
            pairs = set[str]()
            judgement = judge_sampled(study, number, pairs)
            kept = {"verdict": str(judgement.verdict), "why": judgement.why[:2000], "pairs": ", ".join(sorted(pairs))}
            found[str(number)] = kept
            write_text(folder / FILE, json.dumps(found, indent=1) + "\n")
    progress("cases component by component", len(numbers), len(numbers))
