"""System cases in real time: each judged and kept as soon as it is over; those that are there stay."""

from __future__ import annotations

from typing import TYPE_CHECKING

from parcours.report.junit import to_junit
from parcours.report.writing import write_text
from parcours.run.campaign import terminable
from parcours.run.faults import read_plan
from parcours.run.locations import require_folder
from parcours.study.hosting import Nodes, started
from parcours.study.journal import write_question
from parcours.study.protocol import Progress, Request, Run
from parcours_ramp.components.model import component_model
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.sample_payloads import specimens
from parcours_ramp.planner.component_factory import COMPONENTS
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import system_links
from parcours_ramp.system.live import run_live
from parcours_ramp.system.live_results import LiveLog

if TYPE_CHECKING:
    from parcours_ramp.system.door import RampSystem


def system_nodes() -> Nodes:
    """Return RAMP's components as nodes for system cases."""
    room = "parcours_ramp.system"
    return Nodes(
        component_model(), tuple(system_links()), tuple(COMPONENTS), f"{room}.live:SystemNodeProgram", RampCodec(),
        f"{room}.ros1:node_program", "parcours_ramp.components.ros1:codec", (f"{room}.live", f"{room}.warm"),
        shown=message_of, specimens=specimens,
    )  # fmt: skip


def run_live_cases(door: RampSystem, request: Request, progress: Progress) -> Run:
    """Run system cases in real time and keep their verdicts; a host that has lost a node is started again."""
    from parcours_navigation.study.case_parameters import numbers_of, question_of
    from parcours_ramp.system.door import LIVE_CASES

    settings = request.settings
    host, graph, schedule = (str(settings[name]) for name in ("host", "graph", "schedule"))
    study = door.study(settings, request.seed)
    faults = str(settings["faults"])
    plan = read_plan(faults) if faults else None
    if plan:
        plan.check([link.channel for link in system_links()], COMPONENTS)
    require_folder(request.out)
    log = LiveLog(request.out, study, host, settings["record"] or None, plan)  # type: ignore[arg-type]
    write_question(request.out, door.name, door.where, question_of(door, request))
    numbers = numbers_of(study.cases, request.chosen) or tuple(range(request.n_cases or LIVE_CASES))
    what = f"system cases, {schedule}, {host}"
    interrupted = False
    try:
        with terminable():
            while left := [number for number in numbers if number not in log.done]:
                progress(what, len(numbers) - len(left), len(numbers))
                with started(system_nodes(), host, graph) as hosted:
                    for number in left:
                        with log.recording(number) as listener:
                            run = run_live(
                                study, number, hosted.transport, hosted.codec, faults=plan, listener=listener
                            )
                            log.add(number, run)
                        progress(what, sum(one in log.done for one in numbers), len(numbers))
                        if run.deaths:
                            break  # the others are given a host with all its nodes
    except KeyboardInterrupt:
        interrupted = True
    finished = [log.done[number] for number in numbers if number in log.done]
    write_text(request.out / "junit.xml", to_junit(f"ramp_system, {host}", [one.junit() for one in finished]))
    kept = f"{len(finished)} of {len(numbers)} cases are finished and kept in {request.out}"
    if interrupted:
        return Run(True, f"interrupted: {kept}; run the same command again for the rest")
    return Run(False, f"all {len(numbers)} cases are finished in {request.out}")
