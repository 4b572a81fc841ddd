"""Runs the mutants of a study and keeps each outcome at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadRequest, one_of
from parcours.run.campaign import terminable
from parcours.study.components.study import ComponentStudy
from parcours.study.journal import Journal, read_journal, write_question
from parcours.study.mutation.fork_server import Build, Kind, MutantOutcome, Refused, Report, judge_mutants
from parcours.study.mutation.models import model_mutants
from parcours.study.mutation.mutant import Mutant, sampled
from parcours.study.mutation.observing import TWIN, strikes_of
from parcours.study.mutation.results import MutationResults, entry_of, outcome_of
from parcours.study.mutation.source import Sources, modules_of
from parcours.study.mutation.suites import WHOLE, Suite
from parcours.study.parameters import Settings
from parcours.study.protocol import Progress
from parcours.study.reproducing import Reruns, spread

if TYPE_CHECKING:
    from parcours.study.protocol import Study


@dataclass(frozen=True, slots=True)
class MutationRequest:
    """What `parcours mutate STUDY` asks."""

    settings: Sequence[Settings]  # of each study: a value for each of its parameters
    of: Kind  # what is changed
    seed: int  # of the cases, and of the sample
    suite: Suite = WHOLE  # how the cases of the first study are selected and judged
    cases: int | None = None  # of the suite; None for as many as the study has
    twin: int = 0  # cases in which an effect is looked for
    sample: int = 0  # how many mutants; 0 for all
    operators: tuple[str, ...] = ()  # only these; all if empty
    only: str = ""  # only mutants whose id contains this
    workers: int = 1  # processes


def sources_of(study: Study, of: Kind = "code") -> Sources:
    """Return the mutants of a study's Python modules, none if something else is changed.

    Raises BadRequest: it has no such modules, or one is no Python.
    """
    model = getattr(study, "model", None)
    components = model.components if model is not None else ()
    channels = tuple(one.name for one in model.channels) if model is not None else ()
    transitions = tuple(tuple(one.id for one in component.transitions()) for component in components)
    return Sources(tuple(modules_of(study)) if of == "code" else (), transitions, channels)


def _listed(study: Study, sources: Sources, of: Kind) -> list[Mutant]:
    if of == "code":
        return sources.mutants()
    if not isinstance(study, ComponentStudy):
        rule = f"{study.name} has no model whose channels and transitions could be changed"
        raise BadRequest(f"--target {of}", rule, "that is for component studies", slug="mutants-none")
    if of == "model":
        return [one for one, _ in model_mutants(study.model)]
    return [Mutant(id, one.kind, "", 0, str(one)) for id, one in strikes_of(study)]


def mutants_of(study: Study, sources: Sources, request: MutationRequest) -> list[Mutant]:
    """Return the mutants that are asked for. Raises BadRequest: an operator is unknown, or no mutant is left."""
    listed = _listed(study, sources, request.of)
    known = sorted({one.operator for one in listed})
    for name in request.operators:
        if name not in known:
            rule = f"must be one of those that find something here, but is {name!r}"
            raise BadRequest("--operators", rule, one_of(name, known), slug="mutants-operator")
    chosen = [one for one in listed if not request.operators or one.operator in request.operators]
    chosen = [one for one in chosen if request.only in one.id]
    if not chosen:
        rule = f"some mutant must be left, but of {len(listed)} none is"
        raise BadRequest("mutants", rule, "see --list", slug="mutants-none")
    return sampled(chosen, request.sample, request.seed)


def mutate(
    studies: Sequence[Study], request: MutationRequest, out: Path, progress: Progress, kernels: Path | None = None
) -> tuple[MutationResults, bool]:
    """Run the mutants that are missing in a folder; return all outcomes, and whether Ctrl-C ended the run.

    Args:
        studies: the first, whose mutants they are, and others whose cases run on them too.
        kernels: the folder for machine code, if several runs share it.
    """
    sources = sources_of(studies[0], request.of)
    mutants = mutants_of(studies[0], sources, request)
    outcomes: dict[str, MutantOutcome] = {}
    interrupted = False
    with terminable():
        for study, settings in zip(studies, request.settings, strict=True):
            folder = out if study is studies[0] else out / study.name
            decides = {one.name: settings[one.name] for one in study.parameters if one.decides}
            texts = {one.name: hashlib.sha256(one.text.encode()).hexdigest()[:16] for one in sources.modules}
            suite = request.suite if study is studies[0] else WHOLE
            question = {"form": "mutation/2", "of": request.of, "seed": request.seed, "settings": decides,
                        "criteria": [suite.paths, suite.combine, suite.data, suite.mixed], "cases": request.cases,
                        "twin": request.twin, "modules": texts,
                        "files": dict(getattr(study, "digests", {}))}  # fmt: skip
            write_question(folder, study.name, study.where, question)
            with Journal(folder) as journal:
                try:
                    _judge(study, settings, suite, request, sources, mutants, journal, kernels or folder, progress)
                except KeyboardInterrupt:
                    interrupted = True
                for one in mutants:
                    if one.id in journal.done:
                        found = outcome_of(journal.done[one.id])
                        outcomes[one.id] = outcomes[one.id].joined(found) if one.id in outcomes else found
            if interrupted:
                break
    return MutationResults(" and ".join(one.name for one in studies), request.of, tuple(mutants), outcomes), interrupted


def repeat(studies: Sequence[Study], request: MutationRequest, out: Path, progress: Progress) -> Reruns:
    """Run a few of the noticed mutants of a folder again, and compare what became of them with what was kept.

    A mutant that hung, or whose process died, is left out: what it was doing then depends on the clock.
    """
    sources = sources_of(studies[0], request.of)
    mutants = mutants_of(studies[0], sources, request)
    tried, equal, among = 0, 0, 0
    with terminable():
        for study, settings in zip(studies, request.settings, strict=True):
            folder = out if study is studies[0] else out / study.name
            kept = {id: outcome_of(entry) for id, entry in read_journal(folder).items()}
            built = tuple(one.id for one in mutants if one.id in kept and kept[one.id].end != "refused")
            noticed = [id for id in built if kept[id].end in ("ended", "timeout") and set(kept[id].seen) - {TWIN}]
            again = spread(noticed)
            found: dict[str, MutantOutcome] = {}

            def heard(report: Report) -> None:
                if not isinstance(report, Refused) and isinstance(report[1], MutantOutcome):
                    found[report[0]] = report[1]  # noqa: B023
                    progress("mutants run again", len(found), len(again))  # noqa: B023

            if again:
                suite = request.suite if study is studies[0] else WHOLE
                build = _build(study, settings, suite, replace(request, twin=0), sources, built, folder)
                judge_mutants(build, again, request.workers, heard)
            tried, among = tried + len(again), among + len(noticed)
            equal += sum(id in found and _same(kept[id], found[id]) for id in again)
    return Reruns("noticed mutants", equal, tried, among)


def _same(kept: MutantOutcome, found: MutantOutcome) -> bool:
    return found == kept or (not kept.facts and replace(found, facts="") == kept)  # older folders have no facts


def _build(
    study: Study, settings: Settings, suite: Suite, request: MutationRequest, sources: Sources,
    built: tuple[str, ...], kernels: Path,
) -> Build:  # fmt: skip
    return Build(request.of, study.where, dict(settings), request.seed, suite, request.cases, request.twin,
                 tuple(sources.modules), *sources.model_names, built, kernels.absolute())  # fmt: skip


def _judge(
    study: Study, settings: Settings, suite: Suite, request: MutationRequest, sources: Sources,
    mutants: Sequence[Mutant], journal: Journal, out: Path, progress: Progress,
) -> None:  # fmt: skip
    what = f"mutants in {study.name}"
    while True:
        refused = {id for id, entry in journal.done.items() if entry["end"] == "refused"}
        built = tuple(one.id for one in mutants if one.id not in refused)
        left = [id for id in built if id not in journal.done]
        progress(what, len(mutants) - len(left), len(mutants))
        if not left:
            return
        build = _build(study, settings, suite, request, sources, built, out)
        again = False

        def heard(report: Report) -> None:
            nonlocal again
            if isinstance(report, Refused):
                again = True
                for id in report.ids:
                    journal.add(id, entry_of(MutantOutcome("refused", {})))
            elif isinstance(report[1], MutantOutcome):
                journal.add(report[0], entry_of(report[1]))
                progress(what, sum(one.id in journal.done for one in mutants), len(mutants))
            else:
                progress(*report)

        judge_mutants(build, left, request.workers, heard)
        if not again:
            return
