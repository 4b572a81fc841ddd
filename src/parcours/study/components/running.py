"""Runs the cases of a component study on a host, and keeps each result at once."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.abtc import MARK, Event
from parcours.errors import BadResults, HostFailure
from parcours.model.picture import PaintState
from parcours.report.pieces import Page, Piece, Table
from parcours.run.atomic import require_writable
from parcours.run.campaign import terminable
from parcours.run.clocks import WallClock
from parcours.run.enforcement import Execution
from parcours.run.locations import require_folder
from parcours.run.noise import Noise
from parcours.run.trace import Trace, TraceEvent
from parcours.study.components import executing, results
from parcours.study.components.archive import Archive
from parcours.study.components.executing import CaseTiming, Execute, Exercise, Functional, TimingGroup
from parcours.study.components.isolation import Done, longest, run_apart, watched
from parcours.study.components.landing import glance
from parcours.study.components.painting import machine_pieces, transition_states
from parcours.study.hosting import Hosted, started
from parcours.study.journal import Journal, read_journal, read_question, write_question
from parcours.study.parameters import Settings
from parcours.study.payload_fields import require_carried
from parcours.study.protocol import Progress, Reported, Request, Results, Run
from parcours.study.selection import chosen_cases
from parcours.suite import Case, Plan
from parcours.verdict.contracts import contracts_of
from parcours.verdict.judgement import Judgement, Verdict

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

Kept = tuple[results.ComponentResult, "Noise | None"]  # A result, and the noise beside its repeats if it was timed


def run_study(study: ComponentStudy, request: Request, progress: Progress) -> Run:
    """Execute the cases that are missing in a folder, functional ones first, then those that are timed."""
    settings = request.settings
    host = str(settings["host"])
    plan = study.plan(request.seed, request.n_cases)
    cases = _wanted(study, request, plan)
    require_folder(request.out)
    require_writable(request.out)
    nodes = study.nodes()
    require_carried(nodes.model, nodes.shown, nodes.specimens)
    groups = [] if request.chosen else study.timing(request.seed, settings)
    decides = {one.name: settings[one.name] for one in study.parameters if one.decides}
    question = {"seed": request.seed, "settings": decides, "files": dict(study.digests)}
    write_question(request.out, study.name, study.where, question)
    form = str(settings["record"])
    archive = Archive(study, request.out / "recordings", form, host, settings) if form else None
    n_timed = sum(len(group.cases) for group in groups)
    with Journal(request.out) as journal, terminable():
        interrupted = False
        try:
            _execute(study, request, journal, cases, groups, archive, progress)
        except KeyboardInterrupt:
            interrupted = True
    instances = str(settings["instances"])
    found = results.results_of_journal(request.out, host, len(cases) + n_timed, read_journal(request.out), instances)
    results.write_components(request.out, found)
    is_clean = not interrupted and all(one.verdict == "pass" for one in found.results if not one.bound)
    if is_clean and host == "simulated" and study.inputs.domains and not request.chosen and not settings["orders"]:
        results.write_landing(request.out, glance(study, plan, settings))
    total = len(cases) + n_timed
    if interrupted:
        text = f"interrupted: {len(found.results)} of {total} cases are finished and kept in {request.out}"
        return Run(True, f"{text}; run the same command again to compute the rest")
    return Run(False, f"all {total} cases are finished in {request.out}")


def _wanted(study: ComponentStudy, request: Request, plan: Plan) -> list[Case]:
    """Return the cases of a request: all, or the chosen ones, of which each may name an order."""
    if not request.chosen:
        return list(study.suite(request.settings, request.seed, request.n_cases))
    orders: dict[str, list[str]] = {}  # of abstract case and row -> the orders that are named; empty for what is wanted
    for id in request.chosen:
        abstract, _, rest = id.partition(MARK)
        order, _, row = rest.partition("/")
        orders.setdefault(f"{abstract}/{row}" if row else abstract, []).append(order)
    chosen_cases(plan, list(orders), study.name)  # says all that are wrong at once
    found: dict[str, Case] = {}
    for id, names in orders.items():
        for case in chosen_cases(plan, [id], study.name):
            named = [replace(case, abstract=f"{case.abstract}{MARK}{name}") if name else case for name in names]
            found |= {one.id: one for one in study.in_orders(named, request.settings)}
    for case in found.values():
        study.visits(case, request.settings)  # raises if an order is not one
    return sorted(found.values(), key=lambda case: case.number)


def _execute(
    study: ComponentStudy, request: Request, journal: Journal, cases: Sequence[Case], groups: Sequence[TimingGroup],
    archive: Archive | None, progress: Progress,
) -> None:  # fmt: skip
    settings, host = request.settings, request.settings["host"]
    left = [case for case in cases if f"functional/{case.id}" not in journal.done]
    waiting = [
        group
        for group in groups
        if any(f"timing/{case.id}/{group.name}" not in journal.done for case, _ in group.cases)
    ]
    if not left and not waiting:
        return
    done, total, n_timed = len(cases) - len(left), len(cases), sum(len(group.cases) for group in waiting)
    progress(f"functional cases, {host}", done, total)

    def timed(n: int) -> None:
        progress(f"timing cases, {host}", n, n_timed)

    apart = host == "simulated" and not study.trusted
    runs = (_apart if apart else _hosted)(study, settings, left, waiting, archive, timed)
    with contextlib.closing(runs):
        for result, noise in runs:
            if result.bound:
                journal.add(f"timing/{result.id}/{result.interaction}", results.entry_of(result, noise))
            else:
                journal.add(f"functional/{result.id}", results.entry_of(result))
                done += 1
                progress(f"functional cases, {host}", done, total)


def _hosted(
    study: ComponentStudy, settings: Settings, left: Sequence[Case], waiting: Sequence[TimingGroup],
    archive: Archive | None, timed: Callable[[int], None],
) -> Generator[Kept, None, None]:  # fmt: skip
    """Yield the results of cases that are executed by this process or its nodes."""
    exercise = study.exercise(settings)
    with executors(study, settings) as (in_order, in_time):
        for case in left:
            yield _kept(executing.run_functional(exercise, case, in_order), archive)
        yield from _timings(exercise, waiting, in_time, settings, archive, timed)


def _apart(
    study: ComponentStudy, settings: Settings, left: Sequence[Case], waiting: Sequence[TimingGroup],
    archive: Archive | None, timed: Callable[[int], None],
) -> Generator[Kept, None, None]:  # fmt: skip
    """Yield the results of cases that are executed in a process apart; what hangs or dies there fails its own case."""
    cases = {f"functional/{case.id}": case for case in left}
    groups = {f"timing/{group.name}": group for group in waiting}

    def work(item: str) -> list[Kept]:
        if item in cases:
            return [_kept(functional_here(study, cases[item], settings), archive)]
        exercise = study.exercise(settings, timed=True)
        execute = executing.in_process(exercise, WallClock, watched(study.patience), study.messages.checked)
        return list(_timings(exercise, [groups[item]], execute, settings, archive))

    n_timed = 0
    for item, answer in run_apart([*cases, *groups], work, study.patience):
        if isinstance(answer, Done):
            yield from answer.result
        elif item in cases:
            interaction = results.interaction_of(cases[item].abstract)
            yield results.ComponentResult(cases[item].id, interaction, "fail", answer), None
        else:
            for case, bound in groups[item].cases:
                yield results.ComponentResult(case.id, groups[item].name, "fail", answer, str(bound)), None
        if item in groups:
            n_timed += len(groups[item].cases)
            timed(n_timed)


def _timings(
    exercise: Exercise, groups: Sequence[TimingGroup], execute: Execute, settings: Settings, archive: Archive | None,
    timed: Callable[[int], None] = lambda n: None,
) -> Iterator[Kept]:  # fmt: skip
    listener = archive.repeat if archive is not None else lambda case, trace: None
    repeats = int(settings["repeats"])
    for timing in executing.run_timing(exercise, groups, execute, repeats=repeats, listener=listener, progress=timed):
        yield _kept(timing, archive)


def _kept(run: Functional | CaseTiming, archive: Archive | None) -> Kept:
    """Record a case if recordings are kept, and return its result."""
    if isinstance(run, Functional):
        if archive is not None:
            archive.functional(run)
        return results.functional_result(run), None
    if archive is not None:
        archive.timing(run)
    return results.timing_result(run), run.noise


def functional_here(study: ComponentStudy, case: Case, settings: Settings) -> Functional:
    """Execute a case in this process, which is one apart, and judge it."""
    exercise = study.exercise(settings)
    execute = executing.in_process(exercise, watch=watched(study.patience), checked=study.messages.checked)
    return executing.run_functional(exercise, case, execute)


def executed_apart(
    study: ComponentStudy, cases: Sequence[Case], settings: Settings
) -> Iterator[tuple[Case, Judgement, Trace | None]]:
    """Yield each case with its verdict and trace, executed in a process apart; without trace if it hung or died."""
    by_id = {case.id: case for case in cases}

    def work(id: str) -> tuple[Judgement, Trace]:
        run = functional_here(study, by_id[id], settings)
        return run.judgement, run.execution.trace

    for id, answer in run_apart(list(by_id), work, study.patience):
        if isinstance(answer, Done):
            yield by_id[id], *answer.result
        else:
            yield by_id[id], Judgement(Verdict.FAIL, answer), None


def run_again(study: ComponentStudy, case: Case, settings: Settings) -> tuple[Judgement, Trace]:
    """Execute a case in simulated time and judge it, apart from this process unless the study ships with Parcours."""
    if study.trusted:
        exercise = study.exercise(settings)
        run = executing.run_functional(exercise, case, executing.in_process(exercise))
        return run.judgement, run.execution.trace
    [(_, judgement, trace)] = executed_apart(study, [case], settings)
    note = TraceEvent(0, "deviation", text=judgement.why)
    return judgement, trace or Trace("simulated", (note,), "here", case.id)


@contextlib.contextmanager
def executors(study: ComponentStudy, settings: Settings) -> Iterator[tuple[Execute, Execute]]:
    """Yield what executes functional cases, in their very order, and timing cases, in real time.

    A host that has lost a node is started again for the next case.
    """
    exercise, timed = study.exercise(settings), study.exercise(settings, timed=True)
    host, graph = str(settings["host"]), str(settings["graph"])
    if host == "simulated":
        yield executing.in_process(exercise), executing.in_process(timed, WallClock)
        return
    nodes, patience = study.nodes(), round(longest(study.patience) * 1e9)
    with contextlib.ExitStack() as running:

        def start() -> Hosted:
            running.close()
            return running.enter_context(started(nodes, host, graph))

        hosted = start()

        def execute(exercise: Exercise, case: Case, strict: bool) -> Execution:
            nonlocal hosted
            why = ""
            for _ in range(2):  # if fresh nodes come to the same, the case is to blame
                run = executing.on_transport(exercise, hosted.transport, hosted.codec, strict=strict, patience=patience)
                try:
                    return run(case)
                except HostFailure as failure:
                    if failure.slug not in ("node-gone", "node-silent"):
                        raise
                    why = f"{failure.where}: {failure.rule}"
                    hosted = start()
            return Execution(Trace("wall", (TraceEvent(0, "deviation", text=why),), host, case.id), None)

        yield lambda case: execute(exercise, case, True), lambda case: execute(timed, case, False)


def read_results(study: ComponentStudy, folder: Path) -> Results:
    """Return the results in a folder. Raises BadResults if there are none, or of another study."""
    if (folder / results.FILE).exists():
        found = results.read_components(folder)
    else:
        found = results.results_of_journal(folder, "unfinished", 0, read_journal(folder))
    foreign = next((one.id for one in found.results if not one.id.startswith(f"{study.name}/")), None)
    if foreign is not None:
        rule = f"results of {study.name} are expected, but it holds {foreign}"
        raise BadResults(str(folder), rule, slug="results-study")
    return results.StudyResults(
        study.name, found, lambda case: _page(study, folder, case), contracts_of(study.model).checks,
        results.read_landing(folder), functools.partial(_painted, study, found.results),
        functools.partial(_states, study, found.results),
    )  # fmt: skip


def _order_of(study: ComponentStudy, abstract: str) -> Sequence[Event]:
    return study.order_of(abstract) if abstract in study.abstracts else ()


def _painted(study: ComponentStudy, found: Sequence[results.ComponentResult], where: str) -> Sequence[Piece]:
    order_of = functools.partial(_order_of, study)
    return machine_pieces(study.model, order_of, found, where, untaken=study.untaken, prefix="functional/")


def _states(study: ComponentStudy, found: Sequence[results.ComponentResult]) -> Collection[PaintState]:
    return transition_states(study.model, functools.partial(_order_of, study), found, study.untaken).values()


def _page(study: ComponentStudy, folder: Path, id: str) -> Page:
    """Return a page on one case, executed again as it was in a folder."""
    document = read_question(folder)["question"]
    assert isinstance(document, dict)
    _, abstract, row = id.split("/")
    plan = study.plan(int(document["seed"]), None)
    number = int(row) * len(study.abstracts) + list(study.abstracts).index(abstract.partition(MARK)[0])
    case = replace(study.plan(int(document["seed"]), max(len(plan), number + 1)).case(number), abstract=abstract)
    settings = {**document["settings"], "graph": "", "record": ""}
    return results.page_of(study.name, case, *run_again(study, case, settings))


def report_results(folders: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on component results."""
    tables: list[Table] = []
    pieces: list[Piece] = []
    drawn: list[Callable[[], Sequence[Piece]]] = []
    documents: dict[str, object] = {}
    for folder, result in folders.items():
        assert isinstance(result, results.StudyResults)
        found: results.ComponentResults = result.found
        where = f"{result.study}, {found.host}"
        tables.append(results.component_table(found.results, f"Component cases, {where}", found.instances))
        pieces.append(tables[-1])
        data = results.data_table(found.results, result.checks, f"Data, {where}")
        failures = results.failure_table(found.results, f"Cases that did not pass, {where}")
        for table in (data, result.landing(f"Test data, {where}")):
            if table is not None:
                tables.append(table)
                pieces.append(table)
        if failures is not None:
            tables.append(failures)
        drawn.append(functools.partial(result.machines, where if len(folders) == 1 else f"{where}, {folder}"))
        if results.timed(found):
            made = results.timing_pieces(found, where)
            tables += [one for one in made if isinstance(one, Table)]
            pieces += made
        documents[folder] = [asdict(one) for one in found.results]
    return Reported(tables, lambda: [*pieces, *(piece for draw in drawn for piece in draw())], documents)
