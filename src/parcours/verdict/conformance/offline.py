"""Checks a whole trace against a model: pass, fail or inconclusive, with the first deviation."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from parcours.model.structure import Cefsm
from parcours.run.trace import Trace
from parcours.verdict.conformance.behaviour import Allowance
from parcours.verdict.conformance.checking import HIDDEN, NOTHING, Checker, Fields, no_fields
from parcours.verdict.conformance.findings import Conformance
from parcours.verdict.conformance.tracking import Observes
from parcours.verdict.judgement import Judgement, Verdict


def check(
    trace: Trace,
    cefsm: Cefsm,
    *,
    component: str | Collection[str] | None = None,
    observes: Observes = "transitions",
    quiescence: Mapping[str, int] | None = None,
    allowance: Allowance = NOTHING,
    hidden: int = HIDDEN,
    fields: Fields = no_fields,
    data: Fields | None = None,
    until: int | None = None,
) -> Conformance:
    """Return whether a whole trace is one that the model allows; the arguments are those of `Checker`.

    Args:
        until: how long the system was watched [ns]; to the last event if not given.

    A trace in which the host itself stopped the case is inconclusive, unless a component was silent at its turn where
    the model lets it not be; so is one that shows none of the components.

    Raises:
        BadRequest: a name is unknown, or a timeout is not above 0.
        BadModel: a guard of the model has no value where the system stands.
    """
    known = {each.name for each in cefsm.components}
    seen = {event.component for event in trace.events if event.component in known}
    if component is None and seen:
        component = sorted(seen)
    checker = Checker(
        cefsm, component=component, observes=observes, quiescence=quiescence, allowance=allowance,
        hidden=hidden, fields=fields, data=data,
    )  # fmt: skip
    number = 0
    for event in trace.events:
        number += 1
        if checker.observe(event) is not None:
            break
    last = trace.events[-1].time if trace.events else 0
    deviation = checker.finish(last if until is None else until)
    if deviation is not None:
        verdict = Verdict.INCONCLUSIVE if deviation.doubt else Verdict.FAIL
        judgement = Judgement(verdict, str(deviation))
    else:
        judgement = _without_deviation(trace, checker, observes)
    return Conformance(judgement, deviation, number, checker.n_outside, checker.tally)


def _hint(checker: Checker) -> str:
    # Silence is only judged against timeouts, and only of components that appear or are named.
    owed = checker.owed()
    if owed:
        name, channel = owed[0]
        decide = f"a timeout (--quiescence {channel}=MS) and --duration decide whether it is late"
        return f"; {name} must send on {channel}: {decide}"
    return (
        "; if one of them should send, name it (--component), with a timeout (--quiescence CHANNEL=MS) and --duration"
    )


def _without_deviation(trace: Trace, checker: Checker, observes: Observes) -> Judgement:
    stopped = next((event for event in trace.events if event.kind == "deviation"), None)
    if stopped is not None:
        why = f"no deviation from the model up to {stopped.time / 1e6:.3f} ms, where the host stopped the case: "
        quiet = "; the model lets it be silent there" if stopped.transition else ""
        return Judgement(Verdict.INCONCLUSIVE, f"{why}{stopped.component} {stopped.text}{quiet}")
    kinds = ("take",) if observes == "transitions" else ("send", "receive")
    names = {event.component.partition("#")[0] for event in trace.events if event.kind in kinds}
    shown = sorted(names & checker.components)
    if not shown:
        what = "transitions" if observes == "transitions" else "messages"
        return Judgement(Verdict.INCONCLUSIVE, f"the trace shows no {what} of the model's components{_hint(checker)}")
    return Judgement(Verdict.PASS, f"{len(trace.events)} events of {', '.join(shown)} are as the model allows")
