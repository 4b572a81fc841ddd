"""Campaigns of a planner on system cases, read from their folders: facts of the finished cases, and replays of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol as TypingProtocol
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.report.junit import CaseResult
from parcours.run.store import open_results
from parcours.study.campaign.running import facts_of
from parcours_navigation.cases.family import Protocol, SystemCases
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes
from parcours_navigation.protocol import Limits
from parcours_navigation.study.replay import Replay, replayed
from parcours_navigation.study.study import NavigationStudy


class Campaign(TypingProtocol):
    """The finished cases of one campaign of a planner, whichever loop ran it."""

    @property
    def label(self) -> str:
        """What ran: a planner's name, or a variant of it."""

    @property
    def signals(self) -> bool:
        """Whether it signals imminent collision and feasibility, without which the paper's rule tells little."""

    @property
    def cases(self) -> SystemCases:
        """The family of cases."""

    @property
    def facts(self) -> NDArray[np.void]:
        """Facts of its finished cases, shape (n,)."""

    @property
    def planned(self) -> int:
        """How many cases it plans."""

    def replay(self, number: int) -> Replay:
        """Return the replay of one case."""


@dataclass(frozen=True, slots=True)
class NavigationResults:
    """One campaign of a planner: what to run again, facts of its finished cases (FACTS, shape (n,)), cases planned."""

    label: str
    cases: SystemCases
    scenario: Scenario
    source: str
    facts: NDArray[np.void]
    planned: int
    signals: bool = False

    def study(self) -> NavigationStudy:
        """Return the study that can run any of the cases again; BadResults if the planner's source was changed."""
        study = NavigationStudy(self.label, self.cases, self.scenario)
        if study.digest != self.source:
            rule = "its source must be what it was when the campaign ran, but was changed"
            raise BadResults(f"planner {self.label!r}", rule, "run the campaign again", slug="planner-changed")
        return study

    def replay(self, number: int) -> Replay:
        """Return the replay of one case: a re-simulation.

        Raises:
            BadRequest: the planner is not found.
            BadResults: the planner hung or died in the case, its source was changed, or the re-simulation differs from
                the facts that the campaign kept.
        """
        kept = self.facts[self.facts["number"] == number]
        if len(kept) and kept[0]["error"] in (PlannerFault.HUNG, PlannerFault.DIED):
            rule = f"there is nothing to see of it: {explain(kept[0])}"
            raise BadResults(self.cases.id(number), rule, "replay another case", slug="replay-lost")
        remedy = "the planner remembers earlier cases, or draws random numbers of its own: see parcours planner check"
        scene, case = self.scenario, self.cases
        return replayed(
            case.id(number), self.label, self.study().track(number), kept, remedy, robot_radius=case.robot_radius,
            obstacle_radius=case.obstacle_radius, arena=scene.arena, goal=scene.goal, tolerance=scene.goal_tolerance,
        )  # fmt: skip


def load_results(folder: Path) -> NavigationResults:
    """Return the finished cases of a campaign folder; the planner itself is not loaded.

    Raises BadResults if there is no such campaign in the folder, or it is damaged or of another version.
    """
    store = open_results(folder)
    campaign = store.campaign
    if campaign.study != "navigation":
        rule = f"results of a planner on system cases are expected, but these are of {campaign.study!r}"
        raise BadResults(str(folder), rule, slug="results-study")
    if campaign.dtype.names != FACTS.names:
        rule = "results must have the fields that this version keeps, but have others"
        raise BadResults(str(folder), rule, "run the campaign again", slug="results-study")
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
        raise BadResults(str(folder), rule, "run the campaign again", slug="results-parameters") from error
    return NavigationResults(campaign.schedule, cases, scenario, source, facts_of(store, folder), campaign.n_cases)


def case_results(campaign: Campaign) -> list[CaseResult]:
    """Return the sound verdict of every case of a campaign."""
    return [
        CaseResult(campaign.cases.id(int(record["number"])), VERDICT_OF[Outcome(int(code))],
                   float(record["t_end"]) * 1e-9, explain(record))
        for record, code in zip(campaign.facts, outcomes(campaign.facts), strict=True)
    ]  # fmt: skip


def junit_results(campaigns: Mapping[str, Campaign]) -> Iterable[CaseResult]:
    """Yield the sound verdict of every case, its id led by the name given to its campaign."""
    for name, campaign in campaigns.items():
        yield from (replace(one, id=f"{name}/{one.id}") for one in case_results(campaign))
