"""Folders of system campaigns -> results, tables, replays and verdicts, for any report that shows them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.planners.ramp.latency import Duration, Latencies
from parcours.planners.ramp.parameters import Parameters
from parcours.report.junit import CaseResult
from parcours.report.pieces import Piece, Replay, Table
from parcours.run.store import open_results
from parcours.studies.ramp_system.cases import Protocol, SystemCases
from parcours.studies.ramp_system.distribution import (
    distribution_document,
    distribution_table,
    measured,
    oracle,
    survived,
)
from parcours.studies.ramp_system.facts import FACTS
from parcours.studies.ramp_system.outcome_tables import Results, outcome_figure, outcome_table
from parcours.studies.ramp_system.study import SystemStudy
from parcours.study.campaign.running import facts_of
from parcours.verdict.facts import FACTS as BASE
from parcours.verdict.judgement import Verdict
from parcours.verdict.navigation import VERDICT_OF, Outcome, explain, outcomes, published


@dataclass(frozen=True, slots=True)
class SystemResults:
    """One campaign: its study, the facts of its finished cases (array of FACTS, shape (n,)), and how many it plans."""

    study: SystemStudy
    facts: NDArray[np.void]
    planned: int

    @property
    def signals(self) -> bool:
        """RAMP signals all that the paper's rule asks for."""
        return True

    @property
    def label(self) -> str:
        """The schedule."""
        return self.study.parameters.schedule

    @property
    def cases(self) -> SystemCases:
        """The family of cases."""
        return self.study.cases

    def replay(self, number: int) -> Replay:
        """Return the replay of one case."""
        return replay(self, number)


def load_campaign(folder: Path) -> SystemResults:
    """Return the finished cases of a campaign folder, with the study that can run any of them again.

    Raises:
        BadResults: there is no campaign of system cases in the folder, or it is damaged or of another version.
    """
    store = open_results(folder)
    campaign = store.campaign
    if campaign.study != "ramp_system" or campaign.dtype.names != FACTS.names:
        raise BadResults(
            str(folder),
            f"results of ramp_system are expected, but these are of {campaign.study!r}",
            slug="results-study",
        )
    try:
        given = cast(dict[str, dict[str, object]], dict(campaign.parameters))
        latencies = Latencies(
            **{k: Duration(**v) if isinstance(v, dict) else v for k, v in given["latencies"].items()}  # type: ignore[arg-type]
        )
        radii = [float(cast(float, given[name])) for name in ("robot_radius", "obstacle_radius")]
        cases = SystemCases(campaign.seed, cast(Protocol, given["protocol"]), *radii)
        study = SystemStudy(
            cases, Parameters(**given["planner"]), latencies,  # type: ignore[arg-type]
            float(cast(float, given["time_limit"])), float(cast(float, given["watched_on"])),
        )  # fmt: skip
    except (BadRequest, KeyError, TypeError, ValueError) as error:
        raise BadResults(
            str(folder), f"the manifest must hold the study's parameters, but: {error}", "run the campaign anew",
            slug="results-parameters",
        ) from error  # fmt: skip
    return SystemResults(study, facts_of(store, folder), campaign.n_cases)


def known_of(result: Results) -> dict[str, NDArray[np.float64]]:
    """Return what was measured in a campaign, by the names of `distribution.SHOWN`.

    The earliest conceivable arrival, which SCT needs, is asked for the first _ASKED cases only.
    """
    facts = result.facts
    earliest = np.full(len(facts), np.nan)
    earliest[:_ASKED] = oracle(result.cases, facts["number"][:_ASKED])["earliest_outer"]
    return measured(
        facts, facts["measures"], earliest=earliest, survival=survived(result.cases, facts["number"])
    )  # fmt: skip


_ASKED = 10_000


def measure_table(results: Mapping[str, Results]) -> Table:
    """Return what was measured in campaigns, side by side."""
    many = any(len(r.facts) > _ASKED for r in results.values())
    note = f"SCT over the first {_ASKED} cases." if many else ""
    return distribution_table("Measures", {name: known_of(r) for name, r in results.items()}, note)


def summary(result: Results) -> dict[str, object]:
    """Return the outcomes of one campaign as JSON values."""
    facts = result.facts
    flags = published(facts)
    codes = Counter(outcomes(facts).tolist())
    return {
        "schedule": result.label,
        "protocol": result.cases.protocol,
        "seed": result.cases.seed,
        "cases": len(facts),
        "planned": result.planned,
        "reached": int(flags.reached.sum()),
        "feasible": int(flags.feasible.sum()),
        "imminent_collision": int(flags.halted_once.sum()),
        "stuck": int(flags.stuck.sum()),
        "outcomes": {o.name.lower(): codes[int(o)] for o in Outcome},
        "measures": distribution_document(known_of(result)),
    }


def replay(campaign: SystemResults, number: int, words: str = "") -> Replay:
    """Return the replay of one case: a re-simulation, shown up to 3 s beyond its end.

    Raises:
        BadResults: the re-simulation differs from the facts that the campaign kept.
    """
    study = campaign.study
    facts, track, places = study.track(number)
    kept = campaign.facts[campaign.facts["number"] == number]
    if [row[list(BASE.names or ())].tolist() for row in kept] != [facts[0][list(BASE.names or ())].tolist()]:
        raise BadResults(
            study.cases.id(number), "a replay must give the facts that were kept, but gives others",
            "they were made by another version of Parcours, or changed; run the campaign anew", slug="replay-differs",
        )  # fmt: skip
    n_shown = int(np.searchsorted(track["time"], int(facts[0]["t_end"]) + 3_000_000_000, "right"))
    shown, places = track[:n_shown], places[:n_shown]
    schedule = study.parameters.schedule
    title = f"{words}: {schedule}" if words else f"{study.cases.id(number)}, {schedule}"
    return Replay(
        title=title,
        subtitle=f"{study.cases.id(number)}: {explain(facts[0])}",
        times=shown["time"] * 1e-9,
        x=shown["x"],
        y=shown["y"],
        heading=shown["heading"],
        halted=shown["halted"] == 1,
        obstacle_x=places[:, :, 0],
        obstacle_y=places[:, :, 1],
        robot_radius=study.parameters.robot_radius,
        obstacle_radii=(study.cases.obstacle_radius,) * 3,
        arena=(study.parameters.arena, study.parameters.arena),
        goal=(2.0, 2.0),
        goal_tolerance=0.2,
    )


def campaign_pieces(results: Mapping[str, Results]) -> list[Piece]:
    """Return what a page shows of campaigns: their outcomes, and replays of two failed cases each."""
    if not results:
        return []
    pieces: list[Piece] = [outcome_table(results), outcome_figure(results), measure_table(results)]
    for result in results.values():
        codes = outcomes(result.facts)
        failed = np.flatnonzero([VERDICT_OF[Outcome(int(code))] is Verdict.FAIL for code in codes])
        pieces += [result.replay(int(result.facts["number"][k])) for k in failed[:2]]
    return pieces


def case_results(result: Results) -> list[CaseResult]:
    """Return the sound verdict of every case of a campaign."""
    return [
        CaseResult(result.cases.id(int(record["number"])), VERDICT_OF[Outcome(int(code))],
                   float(record["t_end"]) * 1e-9, explain(record))
        for record, code in zip(result.facts, outcomes(result.facts), strict=True)
    ]  # fmt: skip


def junit_results(results: Mapping[str, Results]) -> Iterable[CaseResult]:
    """Yield the sound verdict of every case, its id led by the name given to its campaign."""
    for name, result in results.items():
        yield from (replace(one, id=f"{name}/{one.id}") for one in case_results(result))
