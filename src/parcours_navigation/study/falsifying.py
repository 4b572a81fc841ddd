"""Cases of a planner by the values of their test inputs, and how far each is from failing."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import ParcoursError
from parcours.study.parameters import Settings
from parcours_navigation.cases.family import GivenCases, SystemCases
from parcours_navigation.cases.running import CaseStudy
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.requirements.judging import FAR, finite_robustness
from parcours_navigation.requirements.requirement import Requirements, requirements_of
from parcours_navigation.study.campaigns import NavigationResults
from parcours_navigation.study.shrinking import causes, written_case
from parcours_navigation.worlds.family import GivenWorldCases, WorldCases

Floats = NDArray[np.float64]

_CLEAR = "(clearance > 0 or speed < 0.05)"
NEARNESS = f"always {_CLEAR} or ({_CLEAR} until (clearance < 0 and speed < 0.05))"
"""What measures how far a case is from failing where nothing is required [m]: the gap that is left until the robot
comes to rest. Whether anybody then runs into it does not count.
"""


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

    def simulate(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, list[tuple[str, ...]]]:
        """Run cases; values that make no case pass it, far from failing."""
        try:
            return self._simulated(values, numbers)
        except ParcoursError:
            if len(numbers) == 1:
                return np.array([FAR]), [()]
        found = [self.simulate(values[k : k + 1], numbers[k : k + 1]) for k in range(len(numbers))]
        return np.concatenate([far for far, _ in found]), [why for _, [why] in found]

    def _simulated(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, list[tuple[str, ...]]]:
        asked = self.study.requirements
        study = self._with(values, int(numbers[0]))
        study = study if asked.formulas else dataclasses.replace(study, requirements=_probe())  # type: ignore[type-var]
        facts = study.run(numbers)
        far = np.nan_to_num(finite_robustness(facts, study.requirements), nan=FAR).min(axis=1)
        return far, [causes(one, asked) for one in facts]

    def _with(self, values: Floats, first: int) -> CaseStudy:
        cases, given = self.study.cases, tuple(map(tuple, values.tolist()))
        kind = GivenCases if isinstance(cases, SystemCases) else GivenWorldCases
        own = {one.name: getattr(cases, one.name) for one in dataclasses.fields(cases)}  # type: ignore[arg-type]
        found: CaseStudy = dataclasses.replace(
            self.study,
            cases=kind(**own, given=given, first=first),  # type: ignore[type-var]
        )
        return found

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        """Write a failing case as a world."""
        study = self._with(values[np.newaxis], number)
        cases = study.cases
        assert isinstance(cases, SystemCases | WorldCases)
        found = NavigationResults(
            str(self.settings["planner"]), cases, self.scenario, "", study.run(np.array([number])), 1,
            requirements=study.requirements,
        )  # fmt: skip
        name = f"{cases.study}/found-{cases.protocol}/{number}"
        case = dataclasses.replace(written_case(found, name, number, self.settings), cause=cause)
        return case.write(case.data, out)
