"""Folders of RAMP's system campaigns -> results, with the study that can run any of their cases again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.run.store import open_results
from parcours.study.campaign.running import GivenFacts, KeptFacts, Wanted
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.requirements.requirement import kept as kept_requirements
from parcours_navigation.study.campaigns import NavigationResults, kept_cases
from parcours_navigation.study.replay import Replay, replayed
from parcours_navigation.worlds.paper import arena_cases
from parcours_ramp.planner.latency import Duration, Latencies
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.system.as_planner import RampLoop
from parcours_ramp.system.ramp_facts import FACTS
from parcours_ramp.system.study import STUDY, SystemStudy


@dataclass(frozen=True, slots=True)
class SystemResults:
    """One campaign: its study, what is kept of its finished cases, and how many it plans."""

    study: SystemStudy
    kept: KeptFacts | GivenFacts
    planned: int

    @property
    def facts(self) -> NDArray[np.void]:
        """Facts of its finished cases, array of FACTS, shape (n,)."""
        return self.kept.whole

    def parts(self, wanted: Wanted = lambda name: name != "transitions") -> Iterator[NDArray[np.void]]:
        """Yield the wanted fields of the facts part by part; by default all but the counts of transitions, a third."""
        return self.kept.parts(wanted)

    def holding(self, facts: NDArray[np.void]) -> SystemResults:
        """Return it with facts of some of its cases."""
        return replace(self, kept=GivenFacts(facts))

    @property
    def signals(self) -> bool:
        """RAMP signals all that the paper's rule asks for."""
        return True

    @property
    def requirements(self) -> Requirements:
        """What is required of the cases."""
        return self.study.requirements

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

    def as_navigation(self) -> NavigationResults:
        """Return it as a campaign of the planner of that name. Raises BadRequest: the planner was changed for it."""
        study = self.study
        scenario = Scenario(time_limit=study.time_limit, watched_on=study.watched_on)
        plain = RampLoop(self.label).study_of(study.cases, scenario, study.requirements)
        if plain != study:
            rule = "its planner must be the one that has a name, but it has added delays or other parameters"
            raise BadRequest(f"planner 'ramp-{self.label}'", rule, "replay the case instead", slug="shrink-study")
        return NavigationResults(
            f"ramp-{self.label}", study.cases, scenario, "", self.kept, self.planned, True, study.requirements
        )


def load_campaign(folder: Path) -> SystemResults:
    """Return the finished cases of a campaign folder, with the study that can run any of them again.

    Raises BadResults: there is no campaign of system cases in the folder, or it is damaged or of another version.
    """
    store = open_results(folder)
    campaign = store.campaign
    requirements = kept_requirements(campaign.parameters, str(folder))
    if campaign.study != "ramp_system" or campaign.dtype.names != requirements.facts(FACTS).names:
        raise BadResults(
            str(folder), f"results of ramp_system are expected, but these are of {campaign.study!r}",
            slug="results-study",
        )  # fmt: skip
    try:
        given = cast(dict[str, dict[str, object]], dict(campaign.parameters))
        latencies = Latencies(
            **{k: Duration(**v) if isinstance(v, dict) else v for k, v in given["latencies"].items()}  # type: ignore[arg-type]
        )
        kept = kept_cases(cast(dict[str, object], given), campaign.seed, folder, STUDY)
        cases = kept if isinstance(kept, SystemCases) else arena_cases(kept)
        study = SystemStudy(
            cases, Parameters(**given["planner"]), latencies,  # type: ignore[arg-type]
            float(cast(float, given["time_limit"])), float(cast(float, given["watched_on"])),
            bool(given["solid"]), requirements,
        )  # fmt: skip
    except (BadRequest, KeyError, TypeError, ValueError) as error:
        raise BadResults(
            str(folder), f"the manifest must hold the study's parameters, but: {error}", "run the campaign again",
            slug="results-parameters",
        ) from error  # fmt: skip
    return SystemResults(study, KeptFacts(store), store.planned)


def replay(campaign: SystemResults, number: int, words: str = "") -> Replay:
    """Return the replay of one case: a re-simulation, shown up to 3 s beyond its end.

    Raises BadResults: the re-simulation differs from the facts that the campaign kept.
    """
    study, kept = campaign.study, campaign.facts[campaign.facts["number"] == number]
    [obstacles] = study.cases.obstacles(np.array([number]))
    remedy = "they were made by another version of Parcours, or changed; run the campaign again"
    return replayed(
        study.cases.id(number), campaign.label, study.track(number), kept, remedy, goal=(2.0, 2.0), tolerance=0.2,
        robot_radius=study.parameters.robot_radius, obstacle_radius=study.cases.obstacle_radius,
        arena=study.parameters.arena, title=f"{words}: {campaign.label}" if words else "", beyond=3_000_000_000,
        obstacle_radii=tuple(obstacles["radius"].tolist()), requirements=study.requirements,
    )  # fmt: skip
