"""One case of a component study, executed on the simulated host, as JSON: `python -m parcours.studio.stepping`.

It runs as a process of its own, and in it the components in a worker, as in any run of the study.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator

from parcours.abtc import AbstractCase, find_case, serialise
from parcours.errors import BadRequest, ParcoursError
from parcours.model import Cefsm
from parcours.run.port import StepReport
from parcours.run.trace import Trace, TraceEvent

_MOST = 20_000  # events that are shown


def executed(study: str, abstract: str) -> dict[str, object]:
    """Return what happened when an abstract case ran with the first row of the study's data, and its verdict.

    Raises BadRequest: it is no study of components, or has no such case.
    """
    from parcours.study.components.running import run_again
    from parcours.study.components.study import ComponentStudy
    from parcours.study.finding import find
    from parcours.study.parameters import settings_of

    found = find(study)
    if not isinstance(found, ComponentStudy):
        raise BadRequest(study, "cases of components are stepped through, but this is a study of another kind",
                         "watch a run of it", slug="studio-step")  # fmt: skip
    find_case(found.model, abstract)
    case = found.plan(1).case(list(found.abstracts).index(abstract))
    judgement, trace = run_again(found, case, settings_of(found.parameters, {}, f"study {found.name}"))
    values = dict(zip(case.names, map(float, case.values), strict=True))
    return {"case": case.id, "verdict": str(judgement.verdict), "why": judgement.why, "values": values,
            "events": list(_happened(trace))}  # fmt: skip


def planned(model: Cefsm, abstract: str) -> dict[str, object]:
    """Return the same of a model without a study: the order in which the case wants its transitions."""
    case: AbstractCase = find_case(model, abstract)
    events = [
        {"time": 0, "kind": "take", "component": f"{one.component}#{one.reference}", "transition": one.transition,
         "channel": "", "text": one.role}
        for one in serialise(case)
    ]  # fmt: skip
    return {"case": case.id, "verdict": "", "why": "the order that the case demands; nothing was executed",
            "values": {}, "events": events[:_MOST]}  # fmt: skip


def _happened(trace: Trace) -> Iterator[dict[str, object]]:
    for one in trace.events[:_MOST]:
        yield {"time": one.time, "kind": one.kind, "component": one.component, "transition": one.transition,
               "channel": one.channel, "text": _said(one)[:500]}  # fmt: skip


def _said(event: TraceEvent) -> str:
    """Return the text of an event, or in words what its component reported."""
    if not isinstance(event.payload, StepReport):
        return event.text
    parts = [f"{name} = {value}" for name, value in event.payload.variables.items()]
    return ", ".join([*parts, *(event.payload.operations or ())])


if __name__ == "__main__":
    try:
        sys.stdout.write(json.dumps(executed(*sys.argv[1:3])))
    except ParcoursError as error:
        sys.stderr.write(f"parcours: {error}\n")
        sys.exit(2)
