"""Campaigns of a planner on system cases, read from their folders: facts of the finished cases, and replays of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol as TypingProtocol
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.report.junit import CaseResult
from parcours.run.store import open_results
from parcours.study.campaign.running import GivenFacts, KeptFacts, Wanted
from parcours_navigation.cases.family import Protocol, SystemCases
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import Cases
from parcours_navigation.outcomes import explain
from parcours_navigation.protocol import Limits
from parcours_navigation.requirements.judging import explained, verdicts
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements, kept
from parcours_navigation.study.replay import Replay, StandingThings, replayed
from parcours_navigation.study.study import NavigationStudy
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import find_world


class FinishedCampaign(TypingProtocol):
    """The finished cases of one campaign of a planner, whichever loop ran it."""

    @property
    def label(self) -> str:
        """What ran: a planner's name, or a variant of it."""

    @property
    def signals(self) -> bool:
        """Whether it signals imminent collision and feasibility, without which the paper's rule tells little."""

    @property
    def cases(self) -> Cases:
        """The family of cases."""

    @property
    def facts(self) -> NDArray[np.void]:
        """Facts of its finished cases, shape (n,)."""

    def parts(self, wanted: Wanted = lambda name: True) -> Iterator[NDArray[np.void]]:
        """Yield the facts part by part: the wanted fields, without those that no table shows."""

    def holding(self, facts: NDArray[np.void]) -> FinishedCampaign:
        """Return it with facts of some of its cases."""

    @property
    def planned(self) -> int:
        """How many cases it plans."""

    @property
    def requirements(self) -> Requirements:
        """What is required beside the sound outcome; the facts have the robustness of it."""

    def replay(self, number: int) -> Replay:
        """Return the replay of one case."""

    def as_navigation(self) -> NavigationResults:
        """Return it as a campaign of the planner of that name. Raises BadRequest: the planner was changed for it."""


@dataclass(frozen=True, slots=True)
class NavigationResults:
    """One campaign of a planner: what to run again, what is kept of its finished cases, and how many it plans."""

    label: str
    cases: Cases
    scenario: Scenario
    source: str
    kept: KeptFacts | GivenFacts
    planned: int
    signals: bool = False
    requirements: Requirements = NO_REQUIREMENTS

    @property
    def facts(self) -> NDArray[np.void]:
        """Facts of its finished cases, array of FACTS, shape (n,)."""
        return self.kept.whole

    def parts(self, wanted: Wanted = lambda name: True) -> Iterator[NDArray[np.void]]:
        """Yield the wanted fields of the facts part by part."""
        return self.kept.parts(wanted)

    def holding(self, facts: NDArray[np.void]) -> NavigationResults:
        """Return it with facts of some of its cases."""
        return replace(self, kept=GivenFacts(facts))

    def as_navigation(self) -> NavigationResults:
        """Return itself."""
        return self

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
        rows = self.facts[self.facts["number"] == number]
        if len(rows) and rows[0]["error"] in (PlannerFault.HUNG, PlannerFault.DIED, PlannerFault.TAMPERED):
            rule = f"there is nothing to see of it: {explain(rows[0])}"
            raise BadResults(self.cases.id(number), rule, "replay another case", slug="replay-lost")
        remedy = "the planner remembers earlier cases, or draws random numbers of its own: see parcours planner check"
        scene, case = self.scenario, self.cases
        if isinstance(case, WorldCases):
            return self._replay_in_world(case, number, rows, remedy)
        return replayed(
            case.id(number), self.label, self.study().track(number), rows, remedy, robot_radius=case.robot_radius,
            obstacle_radius=case.obstacle_radius, arena=scene.arena, goal=scene.goal, tolerance=scene.goal_tolerance,
            requirements=self.requirements,
        )  # fmt: skip

    def _replay_in_world(self, cases: WorldCases, number: int, kept: NDArray[np.void], remedy: str) -> Replay:
        study = self.study()
        facts, track, places, gaps = study.track_and_gaps(number)
        [staged] = cases.staged([number], self.scenario.period)
        goal, land = (staged.task, *staged.goals)[-1].goal, cases.land(number)
        walls = land.edges()
        xs = np.concatenate([track["x"], places[:, :, 0].ravel(), [goal[0]], walls[:, ::2].ravel()])
        ys = np.concatenate([track["y"], places[:, :, 1].ravel(), [goal[1]], walls[:, 1::2].ravel()])
        standing = StandingThings(
            walls, land.ground.discs, gaps, staged.scene.corners, np.array(land.goals[:-1], float).reshape(-1, 2),
            np.zeros((0, 2)) if staged.path is None else staged.path, staged.scene.scan[:4],
        )  # fmt: skip
        return replayed(
            cases.id(number), self.label, (facts, track, places), kept, remedy, obstacle_radius=0.1, arena=1.0,
            robot_radius=staged.task.robot_radius, goal=goal, tolerance=staged.task.goal_tolerance,
            obstacle_radii=tuple(staged.scene.obstacles["radius"].tolist()),
            box=(float(xs.min()), float(ys.min()), float(xs.max()), float(ys.max())), standing=standing,
            requirements=self.requirements,
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
    requirements = kept(campaign.parameters, str(folder))
    if campaign.dtype.names != requirements.facts(FACTS).names:
        rule = "results must have the fields that this version keeps, but have others"
        raise BadResults(str(folder), rule, "run the campaign again", slug="results-study")
    try:
        given = dict(campaign.parameters)
        setting = dict(cast("dict[str, object]", given["scenario"]))
        limits = Limits(**cast("dict[str, float]", setting.pop("limits")))
        lists = {name: tuple(cast("list[float]", setting.pop(name))) for name in ("start", "goal")}
        scenario = Scenario(limits=limits, **lists, **setting)  # type: ignore[arg-type]
        cases = kept_cases(given, campaign.seed, folder)
        source = str(given["planner_source"])
    except (KeyError, TypeError, ValueError, BadRequest) as error:
        rule = f"the manifest must hold the study's parameters, but: {error}"
        raise BadResults(str(folder), rule, "run the campaign again", slug="results-parameters") from error
    return NavigationResults(
        campaign.schedule, cases, scenario, source, KeptFacts(store), store.planned, requirements=requirements
    )


def kept_cases(given: Mapping[str, object], seed: int, folder: Path, study: str = "navigation") -> Cases:
    """Return the cases that a campaign's parameters name. Raises BadResults if their world was changed."""
    if "world" not in given:
        radii = [float(cast(float, given[name])) for name in ("robot_radius", "obstacle_radius")]
        return SystemCases(seed, cast(Protocol, given["protocol"]), radii[0], radii[1], study)
    world = find_world(str(given["world"]))
    if world.digest != given["world_digest"]:
        rule = f"the world {given['world']!r} must be what it was when the campaign ran, but was changed"
        raise BadResults(str(folder), rule, "run the campaign again, or restore the file", slug="results-parameters")
    return WorldCases(seed, world, criterion=str(given["criterion"]))


def case_results(campaign: FinishedCampaign, places: Sequence[int] | None = None) -> list[CaseResult]:
    """Return the sound verdict of every case of a campaign, or of those at some places of its facts."""
    facts = campaign.facts if places is None else campaign.facts[list(places)]
    return [
        CaseResult(campaign.cases.id(int(record["number"])), verdict, float(record["t_end"]) * 1e-9,
                   explained(record, campaign.requirements))
        for record, verdict in zip(facts, verdicts(facts, campaign.requirements), strict=True)
    ]  # fmt: skip


def junit_results(campaigns: Mapping[str, FinishedCampaign]) -> Iterable[CaseResult]:
    """Yield the sound verdict of every case, its id led by the name given to its campaign."""
    for name, campaign in campaigns.items():
        yield from (replace(one, id=f"{name}/{one.id}") for one in case_results(campaign))
