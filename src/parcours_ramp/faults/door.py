"""`parcours faults ramp_system`: the catalogue of faults under one schedule, or under both."""

from __future__ import annotations

from parcours.study.faults import FaultReport, FaultRequest
from parcours.study.protocol import Progress
from parcours_ramp.faults.catalogue import chosen
from parcours_ramp.faults.reporting import fault_document, fault_page, tables
from parcours_ramp.faults.running import run_faults
from parcours_ramp.system.study import SCHEDULES


def strike(request: FaultRequest, progress: Progress) -> FaultReport:
    """Run the catalogue, or what is chosen of it, under the schedule that the user named, or under both."""
    entries = chosen(request.only)
    lines = tuple(map(str, entries))
    if request.listed:
        return FaultReport(lines)
    schedules = (str(request.settings["schedule"]),) if "schedule" in request.given else SCHEDULES
    results = run_faults(
        entries, schedules, seed=request.seed, cases=request.cases, workers=request.workers, progress=progress
    )
    return FaultReport(lines, tables(results), fault_page(results), fault_document(results))
