"""RAMP under the names by which planners are named, run by its own compiled loop (entry points `parcours.planners`)."""

from __future__ import annotations

from dataclasses import dataclass

from parcours.errors import BadRequest
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.scenario import Scenario
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.system.study import SystemStudy


@dataclass(frozen=True, slots=True)
class RampLoop:
    """RAMP with one schedule (`parcours_navigation.guests.planners.OwnLoop`).

    >>> GUARDED.study_of(SystemCases(1), Scenario()).watched_on
    0.0
    """

    schedule: str

    def study_of(self, cases: SystemCases, scenario: Scenario) -> SystemStudy:
        """Return the study that runs it. Raises BadRequest if the scenario is not the one that RAMP is built for."""
        plain = Scenario(
            time_limit=scenario.time_limit, watched_on=scenario.watched_on, call_timeout=scenario.call_timeout
        )
        if scenario != plain:
            rule = "of a scenario, RAMP's own loop can change time_limit and watched_on only"
            name = f"planner 'ramp-{self.schedule}'"
            raise BadRequest(name, rule, "leave the rest as it is", slug="planner-own-loop")
        make = original if self.schedule == "original" else guarded
        parameters = make(robot_radius=cases.robot_radius)
        return SystemStudy(cases, parameters, time_limit=scenario.time_limit, watched_on=scenario.watched_on)


ORIGINAL, GUARDED = RampLoop("original"), RampLoop("guarded")
