"""All runs of the paper's study -> one folder of results, from which the report is composed.

Results are computed by campaigns, so an interrupted demo goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from parcours.run.campaign import Interrupted, run_campaign
from parcours.run.store import create
from parcours.study.campaign.running import KeptFacts
from parcours_navigation.cases.family import PROTOCOLS, PUBLISHED_CASES, Protocol
from parcours_ramp.components.study import (
    CaseTiming,
    Functional,
    component_plan,
    paper_sample,
    run_functional,
    run_timing,
)
from parcours_ramp.system.campaigns import SystemResults
from parcours_ramp.system.delays import DelayResults, DelayStudy
from parcours_ramp.system.study import SCHEDULES, system_study

Progress = Callable[[str, int, int], None]  # Told (what, done, in all)
DELAYED_CASES = 300  # How many cases are run with each added delay, unless fewer are asked for


@dataclass(frozen=True, slots=True)
class PaperResults:
    """Everything the report stands on."""

    seed: int  # of all campaigns
    functional: tuple[Functional, ...]  # every component case: 67 abstract cases times the rows of Each Choice
    sample: tuple[str, ...]  # ids of the 60 of them that Table VIII counts
    timing: tuple[CaseTiming, ...]  # the 60 timing cases
    system: dict[tuple[Protocol, str], SystemResults]  # (protocol, schedule) -> campaign
    delays: DelayResults  # the first cases, with delays added to RAMP's work


def run_paper(
    folder: Path, *, cases: int, seed: int, workers: int, delayed: int | None = None,
    progress: Progress = lambda what, done, total: None,
) -> PaperResults:  # fmt: skip
    """Run the whole study and return its results.

    Args:
        cases: system cases per schedule; the published protocol runs its 905, or as many if fewer are asked for.
        delayed: cases per point of the curves over delays; DELAYED_CASES, or `cases` if that is fewer, if None.

    Raises Interrupted: Ctrl-C during a campaign.
    """
    studies = {
        (protocol, schedule): system_study(schedule, seed=seed, protocol=protocol)
        for protocol in PROTOCOLS
        for schedule in SCHEDULES
    }
    counts = {"table-vii": cases, "published": min(cases, PUBLISHED_CASES)}
    for (protocol, schedule), study in studies.items():  # refuse what cannot be resumed before anything is computed
        create(folder / f"{protocol}-{schedule}", study.campaign(counts[protocol]))
    late = DelayStudy(seed, min(cases, DELAYED_CASES) if delayed is None else delayed)
    create(folder / "delays", late.campaign())
    plan = component_plan(seed)
    functional: list[Functional] = []
    for case in plan.cases():
        functional.append(run_functional(case))
        progress("component cases", len(functional), len(plan))
    sample = paper_sample(plan)
    timing: list[CaseTiming] = []
    for timed in run_timing(sample, progress=lambda done: progress("timing cases", done, len(sample))):
        timing.append(timed)
    system: dict[tuple[Protocol, str], SystemResults] = {}
    for (protocol, schedule), study in studies.items():
        what = f"system cases, {schedule}" + (", published protocol" if protocol == "published" else "")
        outcome = run_campaign(
            study,
            study.campaign(counts[protocol]),
            folder / f"{protocol}-{schedule}",
            workers=workers,
            progress=lambda done, total, what=what: progress(what, done, total),  # type: ignore[misc]
        )
        if outcome.interrupted:
            raise Interrupted(str(outcome))
        system[protocol, schedule] = SystemResults(study, KeptFacts(outcome.store), counts[protocol])
    outcome = run_campaign(
        late, late.campaign(), folder / "delays", workers=workers,
        progress=lambda done, total: progress("system cases, added delays", done, total),
    )  # fmt: skip
    if outcome.interrupted:
        raise Interrupted(str(outcome))
    delays = DelayResults(late, outcome.store.load())
    return PaperResults(seed, tuple(functional), tuple(case.id for case in sample), tuple(timing), system, delays)
