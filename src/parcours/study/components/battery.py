"""What a component study's author should know: cases that fail, cannot run or differ, and what nothing reaches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from parcours.errors import ParcoursError
from parcours.model.structure import ENVIRONMENT
from parcours.run.trace import Trace
from parcours.study.components.executing import run_functional
from parcours.study.components.landing import landing_of
from parcours.study.components.running import executed_apart, executors
from parcours.study.parameters import Settings, settings_of
from parcours.study.payload_fields import uncarried
from parcours.study.protocol import Level, Progress, StudyFinding
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

_SHOWN = 5  # findings of one sort that are shown; the rest are counted
_TWICE = 20  # cases that are executed twice, to see whether they repeat
_LIVE = 3  # cases that are executed on processes, too

# Verdict and trace of cases by their ids; without trace where a case hung or died
Outcomes = dict[str, tuple[Judgement, Trace | None]]


def check_study(study: ComponentStudy, progress: Progress) -> list[StudyFinding]:
    """Return everything that the battery finds, errors first.

    Each abstract case is executed once, some twice, a few on processes; what the model has and no case takes, and test
    inputs that reach nothing, are looked for without executing anything.
    """
    nodes = study.nodes()
    carried = [
        StudyFinding("error", "messages", rule, "change the class in the model, or what is sent")
        for rule in uncarried(nodes.model, nodes.shown, nodes.specimens, nodes.codec)
    ]
    if study.system is None:
        return carried  # a study with a tester of its own: its tests are elsewhere
    settings = settings_of(study.parameters, {})
    cases = list(study.plan(1).cases(0, len(study.abstracts)))
    outcomes = _executed(study, settings, cases, progress)
    found = [
        *carried,
        *_failing(cases, outcomes),
        *_unrepeatable(study, settings, cases, outcomes, progress),
        *_different_live(study, settings, cases, outcomes, progress),
        *_infeasible(study),
        *_untaken(study),
        *_unreached_inputs(study),
        *_other_units(study),
        *_landing_nowhere(study, settings, progress),
    ]
    rank = {"error": 0, "warning": 1, "note": 2}
    return sorted(found, key=lambda one: rank[one.level])


def _executed(study: ComponentStudy, settings: Settings, cases: Sequence[Case], progress: Progress) -> Outcomes:
    """Return verdict and trace of each case by its id, executed apart from this process."""
    outcomes: Outcomes = {}
    for case, judgement, trace in executed_apart(study, cases, settings):
        outcomes[case.id] = judgement, trace
        progress("cases", len(outcomes), len(cases))
    return outcomes


def _failing(cases: Sequence[Case], outcomes: Outcomes) -> Iterator[StudyFinding]:
    wrong: list[StudyFinding] = []
    for case in cases:
        judgement, trace = outcomes[case.id]
        if trace is None:
            wrong.append(
                StudyFinding("error", case.id, f"fails: {judgement.why}", "see it: parcours run STUDY --case ID")
            )
        elif not judgement.passed:
            level: Level = "warning" if judgement.verdict is Verdict.INCONCLUSIVE else "error"
            wrong.append(StudyFinding(level, case.id, f"{judgement.verdict}: {judgement.why}"))
    yield from wrong[:_SHOWN]
    if len(wrong) > _SHOWN:
        yield StudyFinding("error", "cases", f"{len(wrong) - _SHOWN} more do not pass", "parcours run shows all")


def _unrepeatable(
    study: ComponentStudy, settings: Settings, cases: Sequence[Case], outcomes: Outcomes, progress: Progress
) -> Iterator[StudyFinding]:
    """Yield cases that come out otherwise when they are executed again, in another order."""
    again = _executed(study, settings, list(reversed(cases[:_TWICE])), progress)
    for id, (_, second) in again.items():
        _, first = outcomes[id]
        if first is not None and second is not None and _plain(first) != _plain(second):
            rule = "comes out otherwise when it is executed again, after other cases"
            remedy = "a component keeps something between cases, or draws random numbers without the seed of its `case`"
            yield StudyFinding("warning", id, rule, remedy)
            return


def _plain(trace: Trace) -> list[tuple[object, ...]]:
    return [(one.time, one.kind, one.component, one.transition, one.channel, repr(one.payload)) for one in trace.events]


def _different_live(
    study: ComponentStudy, settings: Settings, cases: Sequence[Case], outcomes: Outcomes, progress: Progress
) -> Iterator[StudyFinding]:
    """Yield cases whose verdict on processes is another one, or why there are no processes."""
    if not study.where:
        yield StudyFinding("note", "host processes", "not tried: no other process can find this study",
                      "give the object its `where`: file.py:NAME")  # fmt: skip
        return
    exercise, live = study.exercise(settings), {**settings, "host": "processes"}
    try:
        with executors(study, live) as (in_order, _):
            for k, case in enumerate(cases[:_LIVE]):
                judgement = run_functional(exercise, case, in_order).judgement
                progress("cases on processes", k + 1, min(_LIVE, len(cases)))
                before = outcomes[case.id][0].verdict
                if judgement.verdict is not before and judgement.verdict is not Verdict.INCONCLUSIVE:
                    rule = f"is {before} in simulated time, but on processes {judgement.verdict}: {judgement.why}"
                    yield StudyFinding("error", case.id, rule, "what a component does must not depend on its process")
    except ParcoursError as error:
        yield StudyFinding("error", f"host processes, {error.where}", error.rule, error.remedy)


def _infeasible(study: ComponentStudy) -> Iterator[StudyFinding]:
    found = list(study.infeasible.items())
    for id, why in found[:_SHOWN]:
        remedy = "no value that the tester can choose makes the guards of this case hold together"
        yield StudyFinding("note", id, f"is left out: {why}", remedy)
    if len(found) > _SHOWN:
        yield StudyFinding(
            "note", "abstract cases", f"{len(found) - _SHOWN} more are left out for the same kind of reason"
        )


def _untaken(study: ComponentStudy) -> Iterator[StudyFinding]:
    taken = {event.transition for id in study.abstracts for event in study._events(id)}
    for component in study.model.components:
        left = [transition.id for transition in component.transitions() if transition.id not in taken]
        if left:
            rule = f"no case takes {', '.join(left)}"
            remedy = (
                "name an interaction path through it under the model's `interactions:`, or in `paths:` another "
                "criterion, such as `specified:` and a way that the guards allow"
            )
            yield StudyFinding("warning", f"component {component.name}", rule, remedy)


def _unreached_inputs(study: ComponentStudy) -> Iterator[StudyFinding]:
    """Yield test inputs that no message, input variable or formula reads."""
    from parcours.model.expression import names

    fields = {field.name for message in study.model.messages for field in message.fields}
    variables = {variable.name for component in study.model.components for variable in component.variables}
    formulas = [
        formula for table in (study.supply, study.set_before) for each in table.values() for formula in each.values()
    ]
    read = fields | variables | {name for formula in formulas for name in names(formula)}
    for name in study.inputs.names:
        if name not in read:
            rule = "reaches nothing that the tester sends: no message field, input variable or formula has this name"
            remedy = "name a field like it, or use it under `supply:`; constructors may take an argument of this name"
            yield StudyFinding("warning", f"test input {name!r}", rule, remedy)


def _other_units(study: ComponentStudy) -> Iterator[StudyFinding]:
    """Yield test inputs that are passed on as they are to a field or input variable that is in another unit."""
    sent = {channel.message for channel in study.model.channels if channel.receiver != ENVIRONMENT}
    places = [
        (f"field {message.name}.{field.name}", field.name, field.unit)
        for message in study.model.messages
        if message.name in sent
        for field in message.fields
    ]
    places += [
        (f"input variable {component.name}.{one.name}", one.name, one.unit)
        for component in study.model.components
        for one in component.variables
        if one.role == "input"
    ]
    set_by_formula = {name for table in (study.supply, study.set_before) for each in table.values() for name in each}
    units = {domain.name: domain.unit for domain in study.inputs.domains}
    for place, name, unit in places:
        mine = units.get(name, "1")
        if "1" not in (mine, unit) and _bare(mine) != _bare(unit) and name not in set_by_formula:
            rule = f"is in {mine}, but {place}, which is given its values as they are, is in {unit}"
            yield StudyFinding(
                "warning", f"test input {name!r}", rule, "give both in one unit, or convert it: `supply:`"
            )


def _bare(unit: str) -> str:
    """Return a unit in one spelling: m/s^2, m/s2 and m/s² are the same."""
    return unit.translate(str.maketrans("²³", "23", " ^*"))


def _landing_nowhere(study: ComponentStudy, settings: Settings, progress: Progress) -> Iterator[StudyFinding]:
    """Yield blocks of test data that change no message that a component receives, though the input is known."""
    if not study.inputs.domains:
        return
    landing = landing_of(study, study.plan(1), settings, progress)
    for block in landing.unreached[:_SHOWN]:
        rule = "no other value in its place changes a message that a component receives, in any case"
        yield StudyFinding("warning", block, rule, "see `parcours data landing`; constructors may read it all the same")
    if len(landing.unreached) > _SHOWN:
        yield StudyFinding("warning", "blocks", f"{len(landing.unreached) - _SHOWN} more change nothing")
