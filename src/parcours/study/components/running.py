"""A request -> the cases of a component study, executed on a host, judged, and kept one by one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadResults, HostFailure
from parcours.report.pieces import Page, Piece, Table
from parcours.run.atomic import require_writable
from parcours.run.campaign import terminable
from parcours.run.clocks import WallClock
from parcours.run.enforcement import Execution
from parcours.run.noise import Noise
from parcours.run.trace import Trace, TraceEvent
from parcours.study.components.executing import (
    Execute,
    TimingGroup,
    in_process,
    judge_trace,
    on_transport,
    run_functional,
    run_timing,
)
from parcours.study.components.isolation import Done, Lost, longest, run_apart, watched
from parcours.study.components.results import (
    FILE,
    ComponentResult,
    ComponentResults,
    StudyResults,
    component_table,
    entry_of,
    failure_table,
    functional_result,
    read_components,
    results_of_journal,
    timed,
    timing_pieces,
    timing_result,
    write_components,
)
from parcours.study.hosting import Hosted, started
from parcours.study.journal import Journal, read_journal, read_question, write_question
from parcours.study.parameters import Settings
from parcours.study.protocol import Progress, Reported, Request, Results, Run
from parcours.study.selection import chosen_cases
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict

if TYPE_CHECKING:
    from parcours.study.components.archive import Archive
    from parcours.study.components.study import ComponentStudy

Kept = tuple[ComponentResult, "Noise | None"]
"""A result, and the noise beside its repeats if it was timed."""


def run_study(study: ComponentStudy, request: Request, progress: Progress) -> Run:
    """Execute the cases that are missing in a folder, functional ones first, then those that are timed.

    Raises:
        BadRequest: the folder cannot be written to, or a chosen case is none of the study's.
        BadResults: it holds another run.
        HostFailure: the host cannot be had here.
    """
    settings = request.settings
    host = str(settings["host"])
    plan = study.plan(request.seed, request.n_cases)
    cases = chosen_cases(plan, request.chosen, study.name)
    require_writable(request.out)
    groups = [] if request.chosen else study.timing(request.seed, settings)
    decides = {one.name: settings[one.name] for one in study.parameters if one.decides}
    question = {"seed": request.seed, "settings": decides, "files": dict(study.digests)}
    write_question(request.out, study.name, study.where, question)
    archive = _archive(study, request.out, settings)
    n_timed = sum(len(group.cases) for group in groups)
    with Journal(request.out) as journal, terminable():
        interrupted = False
        try:
            _execute(study, request, journal, cases, groups, archive, progress)
        except KeyboardInterrupt:
            interrupted = True
        found = results_of_journal(request.out, host, len(cases) + n_timed, journal.done)
    write_components(request.out, found)
    total = len(cases) + n_timed
    if interrupted:
        text = f"interrupted: {len(found.results)} of {total} cases are finished and kept in {request.out}"
        return Run(True, f"{text}; run the same command again to compute the rest")
    return Run(False, f"all {total} cases are finished in {request.out}")


def _execute(
    study: ComponentStudy, request: Request, journal: Journal, cases: Sequence[Case], groups: Sequence[TimingGroup],
    archive: Archive | None, progress: Progress,
) -> None:  # fmt: skip
    settings = request.settings
    host = str(settings["host"])
    left = [case for case in cases if f"functional/{case.id}" not in journal.done]
    waiting = [group for group in groups if not _is_timed(group, journal)]
    total = len(cases)

    def keep(results: Sequence[Kept]) -> None:
        for result, noise in results:
            kind = "timing" if result.bound else "functional"
            journal.add(
                f"{kind}/{result.id}" + (f"/{result.interaction}" if result.bound else ""), entry_of(result, noise)
            )

    if left or waiting:
        progress(f"functional cases, {host}", total - len(left), total)
    if host == "simulated" and not study.trusted:
        _apart(study, settings, left, waiting, archive, keep, progress, total)
        return
    exercise = study.exercise(settings)
    with executors(study, settings) as (in_order, in_time):
        for done, case in enumerate(left, start=total - len(left) + 1):
            run = run_functional(exercise, case, in_order)
            if archive is not None:
                archive.functional(run)
            keep([(functional_result(run), None)])
            progress(f"functional cases, {host}", done, total)
        n = sum(len(group.cases) for group in waiting)
        listener = archive.repeat if archive is not None else _unheard
        for timing in run_timing(exercise, waiting, in_time, repeats=int(settings["repeats"]), listener=listener,
                                 progress=lambda done: progress(f"timing cases, {host}", done, n)):  # fmt: skip
            if archive is not None:
                archive.timing(timing)
            keep([(timing_result(timing), timing.noise)])


def _unheard(case: Case, trace: Trace) -> None:
    """Hear a repeat that nobody records."""


def _is_timed(group: TimingGroup, journal: Journal) -> bool:
    return all(f"timing/{case.id}/{group.name}" in journal.done for case, _ in group.cases)


def _apart(
    study: ComponentStudy, settings: Settings, left: Sequence[Case], waiting: Sequence[TimingGroup],
    archive: Archive | None, keep: Callable[[Sequence[Kept]], None], progress: Progress,
    total: int,
) -> None:  # fmt: skip
    """Execute cases in a process apart; what hangs or dies there fails its own case."""
    cases = {f"functional/{case.id}": case for case in left}
    groups = {f"timing/{group.name}": group for group in waiting}
    work = _Work(study, settings, cases, groups, archive)
    done = total - len(left)
    for item, answer in run_apart([*cases, *groups], work, study.patience):
        if isinstance(answer, Done):
            keep(answer.result)
        else:
            keep([(result, None) for result in _lost(item, answer, cases, groups)])
        if item in cases:
            done += 1
            progress("functional cases, simulated", done, total)
        else:
            progress("timing cases", list(groups).index(item) + 1, len(groups))


class _Work:
    """What a process apart does with an item."""

    def __init__(
        self, study: ComponentStudy, settings: Settings, cases: Mapping[str, Case], groups: Mapping[str, TimingGroup],
        archive: Archive | None,
    ) -> None:  # fmt: skip
        self._study, self._settings, self._cases, self._groups = study, settings, cases, groups
        self._archive = archive

    def __call__(self, item: str) -> list[Kept]:
        """Execute a case, or the cases of a timing group."""
        exercise, checked = self._study.exercise(self._settings), self._study.messages.checked
        watch = watched(self._study.patience)
        if item in self._cases:
            run = run_functional(exercise, self._cases[item], in_process(exercise, watch=watch, checked=checked))
            if self._archive is not None:
                self._archive.functional(run)
            return [(functional_result(run), None)]
        timings = run_timing(
            exercise, [self._groups[item]], in_process(exercise, WallClock, watch, checked),
            repeats=int(self._settings["repeats"]),
            listener=self._archive.repeat if self._archive is not None else _unheard,
        )  # fmt: skip
        results: list[Kept] = []
        for timing in timings:
            if self._archive is not None:
                self._archive.timing(timing)
            results.append((timing_result(timing), timing.noise))
        return results


def _lost(
    item: str, lost: Lost, cases: Mapping[str, Case], groups: Mapping[str, TimingGroup]
) -> Iterator[ComponentResult]:
    """Yield the results of an item whose process hung or died."""
    from parcours.study.components.results import interaction_of

    if item in cases:
        case = cases[item]
        yield ComponentResult(case.id, interaction_of(case.abstract), "fail", lost.why)
        return
    for case, bound in groups[item].cases:
        yield ComponentResult(case.id, groups[item].name, "fail", lost.why, str(bound))


def judged_apart(study: ComponentStudy, case: Case, settings: Settings) -> tuple[Judgement, list[str]]:
    """Return the verdict of one case executed in a process apart, and the transitions that were taken."""
    judgement, trace = executed_apart(study, case, settings)
    return judgement, [event.transition for event in trace.events if event.kind == "take"]


def executed_apart(study: ComponentStudy, case: Case, settings: Settings) -> tuple[Judgement, Trace]:
    """Return verdict and trace of one case executed in a process apart; an empty trace if it hung or died there."""

    def work(item: str) -> tuple[Judgement, Trace]:
        exercise = study.exercise(settings)
        execute = in_process(exercise, watch=watched(study.patience), checked=study.messages.checked)
        trace = execute(case).trace
        return judge_trace(exercise, case, trace), trace

    [(_, answer)] = run_apart([case.id], work, study.patience)
    if isinstance(answer, Done):
        return answer.result
    note = TraceEvent(0, "deviation", text=answer.why)
    return Judgement(Verdict.FAIL, answer.why), Trace("simulated", (note,), "here", case.id)


@contextlib.contextmanager
def executors(study: ComponentStudy, settings: Settings) -> Iterator[tuple[Execute, Execute]]:
    """Yield what executes functional cases, in their very order, and timing cases, in real time.

    A host that has lost a node is started again for the next case.
    """
    exercise = study.exercise(settings)
    host, graph = str(settings["host"]), str(settings["graph"])
    if host == "simulated":
        yield in_process(exercise), in_process(exercise, WallClock)
        return
    nodes, patience = study.nodes(), round(longest(study.patience) * 1e9)
    with contextlib.ExitStack() as running:

        def start() -> Hosted:
            running.close()
            return running.enter_context(started(nodes, host, graph))

        hosted = start()

        def execute(case: Case, strict: bool) -> Execution:
            nonlocal hosted
            try:
                return on_transport(exercise, hosted.transport, hosted.codec, strict=strict, patience=patience)(case)
            except HostFailure as failure:
                if failure.slug not in ("node-gone", "node-silent"):
                    raise
                hosted = start()
            try:
                return on_transport(exercise, hosted.transport, hosted.codec, strict=strict, patience=patience)(case)
            except HostFailure as failure:
                if failure.slug not in ("node-gone", "node-silent"):
                    raise
                hosted = start()  # with fresh nodes it came to the same: the case is to blame
                note = TraceEvent(0, "deviation", text=f"{failure.where}: {failure.rule}")
                return Execution(Trace("wall", (note,), host, case.id), None)

        yield lambda case: execute(case, True), lambda case: execute(case, False)


def _archive(study: ComponentStudy, out: Path, settings: Settings) -> Archive | None:
    from parcours.study.components.archive import Archive

    form = str(settings["record"])
    return Archive(study, out / "recordings", form, str(settings["host"]), settings) if form else None


def read_results(study: ComponentStudy, folder: Path) -> Results:
    """Return the results in a folder. Raises BadResults if there are none, or of another study."""
    if (folder / FILE).exists():
        found = read_components(folder)
    else:
        found = results_of_journal(folder, "unfinished", 0, read_journal(folder))
    foreign = next((one.id for one in found.results if not one.id.startswith(f"{study.name}/")), None)
    if foreign is not None:
        rule = f"results of {study.name} are expected, but it holds {foreign}"
        raise BadResults(str(folder), rule, slug="results-study")
    return StudyResults(study.name, found, lambda case: _page(study, folder, case))


def _page(study: ComponentStudy, folder: Path, id: str) -> Page:
    """Return a page on one case, executed again as it was in a folder."""
    from parcours.study.components.replaying import page_of

    document = read_question(folder)["question"]
    assert isinstance(document, dict)
    _, abstract, row = id.split("/")
    plan = study.plan(int(document["seed"]), None)
    number = int(row) * len(study.abstracts) + list(study.abstracts).index(abstract)
    case = study.plan(int(document["seed"]), max(len(plan), number + 1)).case(number)
    return page_of(study, case, {**document["settings"], "graph": "", "record": ""})


def report_results(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on component results."""
    tables: list[Table] = []
    pieces: list[Piece] = []
    documents: dict[str, object] = {}
    for folder, result in results.items():
        assert isinstance(result, StudyResults)
        found: ComponentResults = result.found
        where = f"{result.study}, {found.host}"
        tables.append(component_table(found.results, f"Component cases, {where}"))
        pieces.append(tables[-1])
        failures = failure_table(found.results, f"Cases that did not pass, {where}")
        if failures is not None:
            tables.append(failures)
            pieces.append(failures)
        if timed(found):
            made = timing_pieces(found, where)
            tables += [one for one in made if isinstance(one, Table)]
            pieces += made
        documents[folder] = [asdict(one) for one in found.results]
    return Reported(tables, lambda: pieces, documents)
