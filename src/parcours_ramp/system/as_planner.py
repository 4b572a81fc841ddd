"""RAMP under the names by which planners are named, run by its own compiled loop (entry points `parcours.planners`)."""

from __future__ import annotations

from dataclasses import dataclass

from parcours.errors import BadRequest
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.cases.running import Family
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld
from parcours_navigation.worlds.paper import arena_cases
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.system.study import SystemStudy


@dataclass(frozen=True, slots=True)
class RampLoop:
    """RAMP with one schedule (`parcours_navigation.guests.planners.OwnLoop`).

    >>> GUARDED.study_of(SystemCases(1), Scenario()).watched_on
    0.0
    """

    schedule: str

    def study_of(self, cases: Family, scenario: Scenario, requirements: Requirements = NO_REQUIREMENTS) -> SystemStudy:
        """Return the study that runs it. Raises BadRequest if the scenario is not the one that RAMP is built for."""
        solid = False
        if isinstance(cases, WorldCases):
            try:
                solid, cases = cases.plan(0).solid, arena_cases(cases)
            except BadWorld as error:
                rule = "it reads the paper's arena only: discs that stop, move and stop, no walls, a unicycle"
                raise BadRequest(f"planner 'ramp-{self.schedule}'", rule, "run it in the world `paper`",
                                 slug="planner-own-loop") from error  # fmt: skip
        assert isinstance(cases, SystemCases)
        plain = Scenario(
            time_limit=scenario.time_limit, watched_on=scenario.watched_on, call_timeout=scenario.call_timeout
        )
        if scenario != plain:
            rule = "of a scenario, RAMP's own loop can change time_limit and watched_on only"
            name = f"planner 'ramp-{self.schedule}'"
            raise BadRequest(name, rule, "leave the rest as it is", slug="planner-own-loop")
        make = original if self.schedule == "original" else guarded
        parameters = make(robot_radius=cases.robot_radius)
        return SystemStudy(
            cases, parameters, time_limit=scenario.time_limit, watched_on=scenario.watched_on, solid=solid,
            requirements=requirements,
        )  # fmt: skip


ORIGINAL, GUARDED = RampLoop("original"), RampLoop("guarded")
