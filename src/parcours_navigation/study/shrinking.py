"""Failing cases of planners as world files that can be made small (`parcours.study.shrinking`), and why a case fails."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from parcours.errors import BadRequest
from parcours.study.journal import read_question
from parcours.study.loading import file_of, is_target
from parcours.study.parameters import Scalar, settings_of
from parcours.study.protocol import Request
from parcours.study.reducing import Data, Shape
from parcours_navigation.cases.family import LONGEST
from parcours_navigation.guests.staging import staged
from parcours_navigation.outcomes import Outcome, outcomes
from parcours_navigation.requirements.judging import explained, holds
from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.study.campaigns import NavigationResults
from parcours_navigation.study.study import study_of
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.writing import case_data, closed_of, made_world, plan_of_arena, world_text

SETTINGS = ("period", "command_delay", "watched_on", "call_timeout", "require", "fail", "measure")
"""Parameters that hold for a case also where it is written as a world."""

_SHAPE = Shape(
    lists=("others", "only", "walls", "polygons", "discs"),
    optional=("announced", "position_noise", "velocity_noise", "dropped", "late", "false", "occlusion", "noise"),
    fixed=("robot",),
)
_AT_END = " at its end"

_TEST = '''"""{doc}"""

from pathlib import Path

from parcours_navigation.study.shrinking import causes_of

HERE = Path(__file__).parent


def test_{name}() -> None:
    causes = causes_of(
        {planner}, HERE / "{file}", seed={seed}, number={number},{settings}
    )
    assert {holds}, causes
'''


def causes(record: np.void, requirements: Requirements) -> tuple[str, ...]:
    """Return why a case fails, the gravest cause first; () if it does not.

    A requirement that is violated when the case ends, and not before, says so: a shorter case would violate it, too.
    """
    outcome = Outcome(int(outcomes(np.array([record]))[0]))
    if outcome is Outcome.ERROR:
        reason = record["reason"].decode("utf-8", "replace") if "reason" in (record.dtype.names or ()) else ""
        return (f"error: {re.sub('[0-9]+(.[0-9]+)?', '#', reason)}",)
    found = ["collided"] if outcome is Outcome.COLLIDED else []
    for k, one in enumerate(requirements.formulas):
        if float(record["robustness"][k]) < 0.0:
            late = float(record["violated_at"][k]) * 1e9 > int(record["t_end"]) - 1e6
            found.append(f"violates {one.name}{_AT_END if late else ''}")
    found += [f"fails by {one.text}" for one in requirements.rules if holds(one.formula, np.array([record]))[0]]
    return (*found, *([outcome.name.lower()] if outcome in (Outcome.STUCK, Outcome.ASTRAY) else []))


def causes_of(
    planner: str, world: str | Path, *, seed: int = 1, number: int = 0, **settings: Scalar
) -> tuple[str, ...]:  # fmt: skip
    """Run one case of a planner in a world, and return why it fails: `collided`, `violates keeps-away`; () if not.

    Raises BadRequest, BadWorld: there is no such planner, or no such world.

    >>> causes_of("straight-ahead", "crossing-flows", number=2)
    ('collided',)
    """
    from parcours_navigation.study.door import study

    given = {"planner": planner, "world": str(world), **settings}
    asked = study().study(settings_of(study().parameters, given), seed)
    return causes(asked.run(np.array([number]))[0], asked.requirements)


@dataclass(frozen=True)
class WrittenWorld:
    """A failing case of a planner as a world file (`parcours.study.shrinking.WrittenCase`)."""

    id: str
    results: NavigationResults
    number: int
    settings: Mapping[str, Scalar]  # parameters of its run, other than their defaults
    cause: str
    said: str  # why it failed, with all numbers
    data: Data
    folder: Path  # from which files count

    @property
    def shape(self) -> Shape:
        """What may change; the time where the failure does not lie in how long it took."""
        return dataclasses.replace(_SHAPE, times=(("task", "time_limit"),)) if self._is_event else _SHAPE

    @property
    def _is_event(self) -> bool:
        first = self.cause.partition(" ")[0]
        return first in ("collided", "error:") or (first == "violates" and not self.cause.endswith(_AT_END))

    @property
    def _name(self) -> str:
        return "-".join(self.id.split("/")[1:])

    def causes(self, data: Data) -> Sequence[str]:
        """Run a case again. Raises ParcoursError, before, if it is none."""
        seed, found = self.results.cases.seed, self.results
        cases = WorldCases(seed, made_world(self._name, "", data, self.folder))
        scenario = dataclasses.replace(found.scenario, time_limit=LONGEST)
        study = study_of(found.label, cases, scenario, found.requirements)
        staged(cases, scenario, np.array([self.number]))
        return causes(study.run(np.array([self.number]))[0], found.requirements)

    def sizes(self, data: Data) -> Mapping[str, float]:
        """Return how many move, how long the case may last, and how many digits its numbers have."""
        others = data.get("others", [])
        move = sum(len(one["only"]) if "only" in one else int(one.get("number", 1)) for one in others)
        digits = sum(map(str.isdigit, world_text("", "", {**data, "robot": {}})))
        return {"things that move": move, "time limit [s]": data["task"]["time_limit"], "digits": digits}

    def write(self, data: Data, out: Path) -> Sequence[Path]:
        """Write the world, a test, and a run of it."""
        from parcours_navigation.study.door import study

        out.mkdir(parents=True, exist_ok=True)
        for entry in data.get("others", []):
            if "only" in entry and len(entry["only"]) == entry["number"]:
                del entry["only"]
        world, test = out / f"{self._name}.yaml", out / f"test_{re.sub('[^A-Za-z0-9]', '_', self._name)}.py"
        seed, name = self.results.cases.seed, test.stem.removeprefix("test_")
        doc = f"{self.id} of seed {seed}, made small: {self.cause}"
        world.write_text(world_text(self._name, doc, data), encoding="utf-8")
        planner, shown = self.results.label, repr(self.results.label)
        if is_target(planner) and (path := file_of(planner, Path.cwd())) is not None:
            near = os.path.relpath(path.resolve(), out.resolve())
            shown = f"f\"{{HERE / {near!r}}}:{planner.rpartition(':')[2]}\""
        settings = "".join(f"\n        {name}={value!r}," for name, value in self.settings.items())
        asserted = f"{self.cause!r} not in causes" if self._is_event else "not causes"
        test.write_text(
            _TEST.format(doc=f"{doc}. As drawn: {self.said}.".replace('"', "'"), name=name, planner=shown,
                         file=world.name, seed=seed, number=self.number, settings=settings, holds=asserted),
            encoding="utf-8",
        )  # fmt: skip
        given = {"planner": planner, "world": str(world), "workers": 1, **self.settings}
        request = Request(settings_of(study().parameters, given), seed, out / "run", chosen=(str(self.number),))
        study().run(request, lambda what, done, total: None)
        return world, test, request.out


def written(results: NavigationResults, folder: Path, id: str, number: int) -> WrittenWorld:
    """Return a failing case of a campaign as a world file.

    Args:
        results: the campaign.
        folder: in which it lies.
        id: of the case, as it is shown.
        number: of the case.

    Raises BadRequest: it did not fail.
    """
    cases, scenario = results.cases, results.scenario
    [record] = results.facts[results.facts["number"] == number]
    found = causes(record, results.requirements)
    if not found:
        rule = f"a case that failed is made small, but this one did not: {explained(record, results.requirements)}"
        raise BadRequest(id, rule, "name one that failed: parcours results FOLDER --where 'verdict == fail'",
                         slug="shrink-passed")  # fmt: skip
    [one] = staged(cases, scenario, np.array([number]))
    end = min(one.end, scenario.time_limit) if isinstance(cases, WorldCases) else one.end
    if isinstance(cases, WorldCases):
        plan, base = cases.plan(number), cases.world.folder
    else:
        plan, base = plan_of_arena(
            scenario.start, scenario.start_speed, scenario.goal, scenario.goal_tolerance, end, cases.robot_radius,
            scenario.limits,
        ), Path.cwd()  # fmt: skip
    data = case_data(plan, base, closed_of(one.scene.obstacles, len(one.scene.agents)), end)
    asked = cast("Mapping[str, Mapping[str, Scalar]]", read_question(folder)["question"])["settings"]
    from parcours_navigation.study.door import study

    plain = {parameter.name: parameter.default for parameter in study().parameters}
    settings = {name: asked[name] for name in SETTINGS if name in asked and asked[name] != plain[name]}
    return WrittenWorld(id, results, number, settings, found[0], explained(record, results.requirements), data, base)
