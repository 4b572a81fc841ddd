"""`parcours run` on a host of choice: component cases anywhere, system cases in real time."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

    from parcours.run.gated import Execution
    from parcours.studies.hosting import Hosted
    from parcours.studies.ramp_components.study import Execute, Functional, Timing
    from parcours.suite import Case


def run_component_cases(
    host: str,
    graph: str,
    seed: int,
    cases: int | None,
    repeats: int,
    percent: float,
    record: str | None,
    out: Path,
    as_json: bool,
) -> None:
    """Run the component study, functional and timing, and keep its results."""
    from parcours.cli.options import print_json
    from parcours.cli.progress import progress, say_if_cold
    from parcours.report.terminal import print_table
    from parcours.report.timings import timing_table
    from parcours.run.atomic import require_writable
    from parcours.studies.archive import Archive
    from parcours.studies.ramp_components.results import component_results, component_table, timed, write_components
    from parcours.studies.ramp_components.study import component_plan, paper_sample, run_functional, run_timing

    n_abstract = len(component_plan(seed, 1))
    plan = component_plan(seed, 3 if cases is None else -(-cases // n_abstract))
    require_writable(out)
    archive = Archive(out / "recordings", record, host) if record else None  # type: ignore[arg-type]
    say_if_cold()
    functional: list[Functional] = []
    timing: list[Timing] = []
    wanted = len(plan) if cases is None else cases
    with progress() as report, _executors(host, graph) as (in_order, in_time):
        for case in plan.cases(0, wanted):
            functional.append(run_functional(case, in_order))
            if archive and host != "simulated":
                archive.functional(functional[-1])
            report(f"functional cases, {host}", len(functional), wanted)
        where = "here" if host == "simulated" else host
        write_components(out, component_results(where, functional, timing))
        sample = paper_sample(component_plan(seed))
        listener = archive.repeat if archive else lambda case, trace: None
        for one in run_timing(sample, in_time, repeats=repeats, percent=percent, listener=listener,
                              progress=lambda done: report(f"timing cases, {host}", done, len(sample))):  # fmt: skip
            timing.append(one)
            if archive:
                archive.timing(one)
            if len(timing) % 10 == 0:
                write_components(out, component_results(where, functional, timing))
    results = component_results(where, functional, timing)
    write_components(out, results)
    if as_json:
        print_json([{"id": r.id, "verdict": r.verdict, "why": r.why, "bound": r.bound} for r in results.results])
        return
    print_table(component_table(results.results, f"Component cases, {host}"))
    print_table(timing_table(f"Timing cases, {host}", timed(results)))
    for result in results.results:
        if result.verdict != "pass":
            click.echo(f"{result.id}: {result.verdict}: {result.why}")
    click.echo(f"results in {out}")


@contextlib.contextmanager
def _executors(host: str, graph: str) -> Iterator[tuple[Execute, Execute]]:
    """Yield what executes functional cases, in their very order, and timing cases, in real time.

    A host that has lost a node is started anew for the next case.
    """
    from parcours.errors import HostFailure
    from parcours.run.clocks import WallClock
    from parcours.run.port import links
    from parcours.studies.hosting import started
    from parcours.studies.ramp_components.model import component_model
    from parcours.studies.ramp_components.study import here, on
    from parcours.studies.ramp_system.component_form import system_links

    if host == "simulated":
        yield here(), here(WallClock)
        return
    model = component_model()
    inner = links(model)
    also = [link for link in system_links() if link.channel not in {one.channel for one in inner}]
    names = [component.name for component in model.components]
    with contextlib.ExitStack() as running:

        def start() -> Hosted:
            running.close()
            return running.enter_context(started("component", host, (*inner, *also), names, graph))

        hosted = start()

        def execute(case: Case, strict: bool) -> Execution:
            nonlocal hosted
            try:
                return on(hosted.fabric, hosted.codec, strict=strict)(case)
            except HostFailure as failure:
                if failure.slug not in ("node-gone", "node-silent"):
                    raise
                hosted = start()
                return on(hosted.fabric, hosted.codec, strict=strict)(case)

        yield lambda case: execute(case, True), lambda case: execute(case, False)


def run_system_cases(
    host: str, graph: str, schedule: str, seed: int, protocol: str, cases: int, time_limit: float, faults: str,
    record: str | None, out: Path, as_json: bool,
) -> None:  # fmt: skip
    """Run system cases in real time and keep their verdicts, each as soon as it is known; those that are there stay."""
    from dataclasses import replace

    from parcours.cli.options import print_json
    from parcours.cli.progress import progress, say_if_cold
    from parcours.report.junit import to_junit
    from parcours.report.terminal import print_table
    from parcours.report.writing import write_text
    from parcours.run.faults import read_plan
    from parcours.studies.hosting import started
    from parcours.studies.ramp_system.component_form import system_links
    from parcours.studies.ramp_system.live import COMPONENTS, run_live
    from parcours.studies.ramp_system.live_results import LiveLog, live_table
    from parcours.studies.ramp_system.study import system_study

    study = replace(system_study(schedule, seed=seed, protocol=protocol), time_limit=time_limit)  # type: ignore[arg-type]
    plan = read_plan(faults) if faults else None
    if plan:
        plan.check([link.channel for link in system_links()], COMPONENTS)
    log = LiveLog(out, study, host, record, plan)  # type: ignore[arg-type]
    say_if_cold()
    with progress() as report:
        while left := [number for number in range(cases) if number not in log.done]:
            report(f"system cases, {schedule}, {host}", cases - len(left), cases)
            with started("system", host, system_links(), COMPONENTS, graph) as hosted:
                for number in left:
                    with log.recording(number) as listener:
                        run = run_live(study, number, hosted.fabric, hosted.codec, faults=plan, listener=listener)
                        log.add(number, run)
                    report(f"system cases, {schedule}, {host}", len(log.done), cases)
                    if run.deaths:
                        break  # the others are given a host with all its nodes
    results = [log.done[number] for number in range(cases)]
    write_text(out / "junit.xml", to_junit(f"ramp_system, {host}", [one.junit() for one in results]))
    if as_json:
        print_json([one.plain() for one in results])
        return
    print_table(live_table(results, f"System cases in real time, {schedule}, {host}"))
    for one in results:
        if one.verdict != "pass":
            click.echo(f"{one.id}: {one.verdict}: {one.why}")
    click.echo(f"results in {out}")
