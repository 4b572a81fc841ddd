"""Folders of navigation campaigns, of RAMP or of any planner -> results, and what only planners of others need told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.planners.protocol import Limits
from parcours.report.pieces import Column, Replay, Table
from parcours.run.store import open_results
from parcours.studies.navigation.facts import FACTS, PlannerFault
from parcours.studies.navigation.scenario import Scenario
from parcours.studies.navigation.study import NavigationStudy
from parcours.studies.ramp_system.campaigns import load_campaign
from parcours.studies.ramp_system.campaigns import summary as common_summary
from parcours.studies.ramp_system.cases import Protocol, SystemCases
from parcours.studies.ramp_system.outcome_tables import Results
from parcours.study.campaign.running import facts_of
from parcours.verdict.facts import FACTS as BASE
from parcours.verdict.navigation import explain

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
    if store.campaign.study != "navigation":
        return load_campaign(folder)
    campaign = store.campaign
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
        cases = SystemCases(campaign.seed, cast(Protocol, given["protocol"]), *radii)
        source = str(given["planner_source"])
    except (KeyError, TypeError, ValueError, BadRequest) as error:
        rule = f"the manifest must hold the study's parameters, but: {error}"
        raise BadResults(str(folder), rule, "run the campaign anew", slug="results-parameters") from error
    return NavigationResults(campaign.schedule, cases, scenario, source, facts_of(store, folder), campaign.n_cases)


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
