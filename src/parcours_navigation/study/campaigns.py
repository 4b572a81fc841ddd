"""Folders of campaigns of any planner on system cases -> results, tables, replays and verdicts for reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Piece, Table
from parcours.run.store import open_results
from parcours.study.campaign.running import facts_of
from parcours.study.finding import find, registered
from parcours.verdict.judgement import Verdict
from parcours_navigation.cases.family import Protocol, SystemCases
from parcours_navigation.facts import FACTS as BASE
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes, published
from parcours_navigation.protocol import Limits
from parcours_navigation.study.distribution import (
    distribution_document,
    distribution_table,
    measured,
    oracle,
    survived,
)
from parcours_navigation.study.outcome_tables import Results, outcome_figure, outcome_table
from parcours_navigation.study.replay import Replay
from parcours_navigation.study.still import animation
from parcours_navigation.study.study import NavigationStudy

_FEW = 10
"""Reasons that a table of errors shows."""


@dataclass(frozen=True, slots=True)
class NavigationResults:
    """One campaign of a planner: what to run again, facts of its finished cases (FACTS, shape (n,)), cases planned."""

    label: str
    cases: SystemCases
    scenario: Scenario
    source: str
    facts: NDArray[np.void]
    planned: int

    @property
    def signals(self) -> bool:
        """Only RAMP signals what the paper's rule asks for."""
        return False

    def study(self) -> NavigationStudy:
        """Return the study that can run any of the cases again.

        Raises:
            BadRequest: the planner is not found.
            BadResults: its source was changed since.
        """
        study = NavigationStudy(self.label, self.cases, self.scenario)
        if study.digest != self.source:
            rule = "its source must be what it was when the campaign ran, but was changed"
            raise BadResults(f"planner {self.label!r}", rule, "run the campaign anew", slug="planner-changed")
        return study

    def replay(self, number: int) -> Replay:
        """Return the replay of one case: a re-simulation.

        Raises:
            BadRequest: the planner is not found.
            BadResults: the planner hung or died in the case, its source was changed, or the re-simulation differs from
                the facts that the campaign kept.
        """
        name = self.cases.id(number)
        kept = self.facts[self.facts["number"] == number]
        if len(kept) and kept[0]["error"] in (PlannerFault.HUNG, PlannerFault.DIED):
            rule = f"there is nothing to see of it: {explain(kept[0])}"
            raise BadResults(name, rule, "replay another case", slug="replay-lost")
        facts, track, places = self.study().track(number)
        judged = list(BASE.names or ())
        if [row[judged].tolist() for row in kept] != [facts[0][judged].tolist()]:
            raise BadResults(
                name, "a replay must give the facts that were kept, but gives others",
                "the planner remembers earlier cases, or draws random numbers of its own: see parcours planner check",
                slug="replay-differs",
            )  # fmt: skip
        scenario = self.scenario
        return Replay(
            title=f"{name}, {self.label}",
            subtitle=f"{name}: {explain(facts[0])}",
            times=track["time"] * 1e-9,
            x=track["x"],
            y=track["y"],
            heading=track["heading"],
            halted=track["halted"] == 1,
            obstacle_x=places[:, :, 0],
            obstacle_y=places[:, :, 1],
            robot_radius=self.cases.robot_radius,
            obstacle_radii=(self.cases.obstacle_radius,) * places.shape[1],
            arena=(scenario.arena, scenario.arena),
            goal=scenario.goal,
            goal_tolerance=scenario.goal_tolerance,
        )


def load_results(folder: Path) -> Results:
    """Return the finished cases of a campaign folder, of RAMP or of any planner; the planner itself is not loaded.

    Raises:
        BadResults: there is no such campaign in the folder, or it is damaged or of another version.
    """
    store = open_results(folder)
    campaign = store.campaign
    if campaign.study != "navigation":
        known = {one.name for one in registered()}
        load = getattr(find(campaign.study), "load_campaign", None) if campaign.study in known else None
        if load is None:
            rule = f"results of a planner on system cases are expected, but these are of {campaign.study!r}"
            raise BadResults(str(folder), rule, slug="results-study")
        return cast(Results, load(folder))
    if campaign.dtype.names != FACTS.names:
        rule = "results must have the fields that this version keeps, but have others"
        raise BadResults(str(folder), rule, "run the campaign anew", slug="results-study")
    try:
        given = dict(campaign.parameters)
        setting = dict(cast("dict[str, object]", given["scenario"]))
        limits = Limits(**cast("dict[str, float]", setting.pop("limits")))
        lists = {name: tuple(cast("list[float]", setting.pop(name))) for name in ("start", "goal")}
        scenario = Scenario(limits=limits, **lists, **setting)  # type: ignore[arg-type]
        radii = [float(cast(float, given[name])) for name in ("robot_radius", "obstacle_radius")]
        cases = SystemCases(campaign.seed, cast(Protocol, given["protocol"]), radii[0], radii[1])
        source = str(given["planner_source"])
    except (KeyError, TypeError, ValueError, BadRequest) as error:
        rule = f"the manifest must hold the study's parameters, but: {error}"
        raise BadResults(str(folder), rule, "run the campaign anew", slug="results-parameters") from error
    return NavigationResults(campaign.schedule, cases, scenario, source, facts_of(store, folder), campaign.n_cases)


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


def common_summary(result: Results) -> dict[str, object]:
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


def campaign_pieces(results: Mapping[str, Results]) -> list[Piece]:
    """Return what a page shows of campaigns: their outcomes, and replays of two failed cases each."""
    if not results:
        return []
    pieces: list[Piece] = [outcome_table(results), outcome_figure(results), measure_table(results)]
    for result in results.values():
        codes = outcomes(result.facts)
        failed = np.flatnonzero([VERDICT_OF[Outcome(int(code))] is Verdict.FAIL for code in codes])
        pieces += [animation(result.replay(int(result.facts["number"][k]))) for k in failed[:2]]
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


def summary(result: Results) -> dict[str, object]:
    """Return the outcomes of one campaign as JSON values; of planners other than RAMP with the reasons of errors."""
    common = common_summary(result)
    if not isinstance(result, NavigationResults):
        return common
    for name in ("schedule", "feasible", "imminent_collision", "stuck"):  # RAMP alone gives the signals they need
        del common[name]
    return {"planner": result.label, **common, "errors": dict(_reasons(result.facts).most_common())}


def _reasons(facts: NDArray[np.void]) -> Counter[str]:
    return Counter(reason.decode("utf-8", "replace") for reason in facts["reason"][facts["error"] != 0].tolist())


def error_table(results: Mapping[str, Results]) -> Table | None:
    """Return the commonest reasons of errors of each campaign, and a case of each; None if there were no errors."""
    rows = []
    for name, result in results.items():
        if not isinstance(result, NavigationResults):
            continue
        for reason, count in _reasons(result.facts).most_common(_FEW):
            first = result.facts["number"][result.facts["reason"] == reason.encode()][0]
            rows.append((name, reason, count, int(first)))
    if not rows:
        return None
    columns = (Column("campaign"), Column("reason"), Column("cases"), Column("first case"))
    note = f"What the planners themselves did wrong; the {_FEW} commonest reasons of each."
    return Table("Errors", columns, tuple(rows), note)
