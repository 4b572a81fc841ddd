"""Cases of a planner by the values of their test inputs, and how far each is from failing."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import BadRequest
from parcours.study.campaign.running import GivenFacts
from parcours.study.parameters import Settings
from parcours_navigation.cases.family import GivenCases, SystemCases
from parcours_navigation.cases.running import CaseStudy, Family
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import touched
from parcours_navigation.requirements.judging import FAR, distance, finite_robustness
from parcours_navigation.requirements.requirement import Requirements, requirements_of
from parcours_navigation.study.campaigns import NavigationResults
from parcours_navigation.study.shrinking import causes, written_case
from parcours_navigation.worlds.family import GivenWorldCases, WorldCases
from parcours_navigation.worlds.file import BadWorld
from parcours_navigation.worlds.paper import ArenaCases

Floats = NDArray[np.float64]
_TOUCH = 1e-9  # how deep a collision is at least [m]

NEARNESS = "always time_to_collision > 0"
"""How near a case came to a collision where nothing is required [s].

A body that runs into the robot from behind, or while it rests, does not count; nor does one that it creeps past,
however close. That the robot collided, the outcome says.
"""


def _given(cases: Family, given: Mapping[int, tuple[float, ...]]) -> Family:
    """Return the family in which cases have the given values, by number."""
    if isinstance(cases, ArenaCases):
        return dataclasses.replace(cases, world=cast(WorldCases, _given(cases.of, given)))
    assert isinstance(cases, SystemCases | WorldCases)
    own = {one.name: getattr(cases, one.name) for one in dataclasses.fields(cases)}
    return (GivenCases if isinstance(cases, SystemCases) else GivenWorldCases)(**own, given=given)


@functools.cache
def _probe() -> Requirements:
    return requirements_of({"nearness": NEARNESS})


@dataclass(frozen=True, slots=True)
class PlannerSearch:
    """Cases of a planner (`parcours.study.falsifying.Search`)."""

    study: CaseStudy
    scenario: Scenario
    settings: Settings  # of the study

    @property
    def inputs(self) -> InputModel:
        """The test inputs."""
        return self.study.cases.inputs

    @property
    def event(self) -> str:
        """What it is to fail, in words."""
        asked = self.study.requirements
        rules = [f"not ({one.text})" for one in asked.formulas] + [one.text for one in asked.rules]
        return " or ".join(rules) or "collided"

    @property
    def period(self) -> int:
        """By how much numbers differ of cases that differ in nothing but what is drawn beside the values."""
        return self.study.cases.period

    def drawn(self, numbers: NDArray[np.int64]) -> Floats:
        """Return the values that a campaign draws, shape (n, n_inputs).

        Raises BadRequest: its blocks are not all equally likely, whatever the others are.
        """
        combined = getattr(self.study.cases, "criterion", "each_choice")
        if combined not in ("each_choice", "random", "all_combinations"):
            rule = f"the blocks of an input must be equally likely whatever the others are, but combine={combined}"
            raise BadRequest("rare", rule, "leave `combine` out", slug="rare-blocks")
        return self.study.cases.values(numbers)

    def settled(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, NDArray[np.bool_]]:
        """Return what cases a campaign makes of drawn values, shape (n, n_inputs), and whether it takes them."""
        return self.study.cases.settled(values, numbers)

    def simulate(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, list[tuple[str, ...]]]:
        """Run cases; values that make no case pass it, far from failing.

        Raises BadWorld, BadRequest: none of several cases can be.
        """
        try:
            return self._simulated(values, numbers)
        except (BadWorld, BadRequest) as error:
            if len(numbers) == 1:
                return np.array([FAR]), [()]
            found = [self.simulate(values[k : k + 1], numbers[k : k + 1]) for k in range(len(numbers))]
            if all(far[0] == FAR for far, _ in found):
                raise error
        return np.concatenate([far for far, _ in found]), [why for _, [why] in found]

    def _simulated(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, list[tuple[str, ...]]]:
        asked, study = self.study.requirements, self._with(values, numbers)
        if not (asked.formulas or asked.rules):
            watched = dataclasses.replace(asked, formulas=_probe().formulas)
            study = dataclasses.replace(study, requirements=watched)  # type: ignore[type-var]
        facts = study.run(numbers)
        far = [*finite_robustness(facts, study.requirements).T, *(distance(one.formula, facts) for one in asked.rules)]
        least = np.nan_to_num(np.array(far), nan=FAR).min(axis=0)
        if study.requirements is not asked:
            least = np.where(touched(facts), np.minimum(least, -_TOUCH), np.maximum(least, 0.0))
        return np.where(facts["error"] != 0, FAR, least), [causes(one, asked) for one in facts]

    def _with(self, values: Floats, numbers: NDArray[np.int64]) -> CaseStudy:
        given = dict(zip(numbers.tolist(), map(tuple, values.tolist()), strict=True))
        found: CaseStudy = dataclasses.replace(self.study, cases=_given(self.study.cases, given))  # type: ignore[type-var]
        return found

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        """Write a failing case as a world."""
        study = self._with(values[np.newaxis], np.array([number]))
        cases = study.cases
        assert isinstance(cases, SystemCases | WorldCases)
        found = NavigationResults(
            str(self.settings["planner"]), cases, self.scenario, "", GivenFacts(study.run(np.array([number]))), 1,
            requirements=study.requirements,
        )  # fmt: skip
        name = f"{cases.study}/found-{cases.protocol}/{number}"
        case = dataclasses.replace(written_case(found, name, number, self.settings), cause=cause)
        return case.write(case.data, out)
