"""Failing cases of planners as world files that can be made small (`parcours.study.shrinking`); why a case fails."""

from __future__ import annotations

import dataclasses
import functools
import json
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
from parcours.study.protocol import Request, Results
from parcours.study.reducing import CaseShape, Data
from parcours_navigation.cases.family import LONGEST
from parcours_navigation.cases.running import CaseStudy
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import plan_of, staged
from parcours_navigation.outcomes import Outcome, outcomes
from parcours_navigation.requirements.judging import explained, holds
from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.requirements.syntax import is_safety
from parcours_navigation.study.campaigns import NavigationResults
from parcours_navigation.study.results import PlannerResults
from parcours_navigation.study.study import NavigationStudy, study_of
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.paper import ArenaCases
from parcours_navigation.worlds.writing import case_data, made_world, world_text

_TIMES = ("period", "command_delay", "watched_on", "call_timeout")
"""What of a scenario holds for a case also where it is written as a world."""

_SHAPE = CaseShape(
    lists=("others", "only", "walls", "polygons", "discs"),
    optional=("announced", "position_noise", "velocity_noise", "dropped", "late", "false", "occlusion", "noise"),
    zero=("heading", "turn", "speed", "speed_spread", "waits", "moves"),
    fixed=("robot", "start", "start_speed", "goal", "goals", "tolerance", "path", "radius", "number"),
)
_AT_END = " at the end"

_TEST = '''"""{doc}"""

from pathlib import Path

from parcours_navigation.study.shrinking import causes_of

HERE = Path(__file__).parent


def test_{name}() -> None:
    causes = causes_of(
        {given},
    )
    assert {holds}, causes
'''


def causes(record: np.void, requirements: Requirements) -> tuple[str, ...]:
    """Return why a case fails, the gravest cause first; () if it does not.

    What is only known at its end, or happens later, says so: a shorter case might show it for being shorter.
    """
    outcome = Outcome(int(outcomes(np.array([record]))[0]))
    if outcome is Outcome.ERROR:
        reason = record["reason"].decode("utf-8", "replace") if "reason" in (record.dtype.names or ()) else ""
        return (f"error: {re.sub('[0-9]+(.[0-9]+)?', '#', reason)}",)
    end, found = int(record["t_end"]), []
    if outcome is Outcome.COLLIDED:
        times = (int(record["t_robot_contact"]), int(record["t_shared_contact"]))
        late = min(time for time in times if time != NEVER) > end
        found.append(f"collided{_AT_END if late else ''}")
    for k, one in enumerate(requirements.formulas):
        if float(record["robustness"][k]) < 0.0:
            found.append(f"violates {one.name}{'' if is_safety(one.formula) else _AT_END}")
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
    def shape(self) -> CaseShape:
        """What may change; the time where the failure does not lie in how long it took."""
        return dataclasses.replace(_SHAPE, times=(("task", "time_limit"),)) if self._is_event else _SHAPE

    @property
    def _is_event(self) -> bool:
        return self.cause.startswith(("collided", "error", "violates")) and not self.cause.endswith(_AT_END)

    @property
    def _name(self) -> str:
        return "-".join(self.id.split("/")[1:])

    @functools.cached_property
    def _study(self) -> CaseStudy:
        found = self.results
        return study_of(found.label, found.cases, found.scenario, found.requirements)

    def causes(self, data: Data) -> Sequence[str]:
        """Run a case again. Raises ParcoursError, before, if it is not a case."""
        seed, found = self.results.cases.seed, self.results
        cases = WorldCases(seed, made_world(self._name, "", data, self.folder))
        scenario = dataclasses.replace(found.scenario, time_limit=LONGEST)
        staged(cases, scenario, np.array([self.number]))
        if isinstance(self._study, NavigationStudy):  # it knows its planner already
            study: CaseStudy = dataclasses.replace(self._study, cases=cases, scenario=scenario)
        else:
            study = study_of(found.label, cases, scenario, found.requirements)
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
        planner, shown = self.results.label, json.dumps(self.results.label)
        if is_target(planner) and (path := file_of(planner, Path.cwd())) is not None:
            near = os.path.relpath(path.resolve(), out.resolve())
            shown = f'f"{{HERE / {near!r}}}:{planner.rpartition(":")[2]}"'
        given = [shown, f'HERE / "{world.name}"', f"seed={seed}", f"number={self.number}"]
        given += [f"{key}={json.dumps(value)}" for key, value in self.settings.items()]
        said = f"{doc}.\n\nAs drawn: {self.said}.\n".replace("\\", "/").replace('"', "'")
        holds = f"{json.dumps(self.cause)} not in causes" if self._is_event else "not causes"
        test.write_text(_TEST.format(doc=said, name=name, given=",\n        ".join(given), holds=holds), "utf-8")
        asked = {"planner": planner, "world": str(world), "workers": 1, **self.settings}
        request = Request(settings_of(study().parameters, asked), seed, out / "run", chosen=(str(self.number),))
        study().run(request, lambda what, done, total: None)
        return world, test, request.out


def written(results: Results, folder: Path, case: str) -> WrittenWorld:
    """Return a failing case of a campaign as a world file.

    Args:
        results: the campaign.
        folder: in which it lies.
        case: its id, or its number.

    Raises BadRequest: there is no such case, it did not fail, or its planner has no name that runs it again.
    """
    if not isinstance(results, PlannerResults):
        rule = "its cases must be ones that can be written as a world, but they did not run in simulated time"
        raise BadRequest(str(folder), rule, "replay the case instead", slug="shrink-study")
    id, number = results.case(case)
    asked = cast("Mapping[str, Mapping[str, Scalar]]", read_question(folder)["question"])["settings"]
    return written_case(results.found.as_navigation(), id, number, asked)


def written_case(found: NavigationResults, id: str, number: int, asked: Mapping[str, Scalar]) -> WrittenWorld:
    """Return a failing case as a world file; `asked` are the parameters of its run.

    Raises BadRequest: it did not fail.
    """
    [record] = found.facts[found.facts["number"] == number]
    failed, said = causes(record, found.requirements), explained(record, found.requirements)
    if not failed:
        rule = f"a case that failed is made small, but this one did not: {said}"
        raise BadRequest(id, rule, "name one that failed: parcours results FOLDER --where 'verdict == fail'",
                         slug="shrink-passed")  # fmt: skip
    cases, scenario = found.cases, found.scenario
    given = cases.of if isinstance(cases, ArenaCases) else cases
    [one] = staged(given, scenario, np.array([number]))
    plan = plan_of(given, scenario, number)
    base = given.world.folder if isinstance(given, WorldCases) else Path.cwd()
    closed = one.scene.obstacles[: len(one.scene.obstacles) - len(one.scene.agents)]
    end = min(one.end, scenario.time_limit) if isinstance(given, WorldCases) else one.end
    data = case_data(plan, base, closed, end)
    plain = Scenario()
    settings = {name: getattr(scenario, name) for name in _TIMES if getattr(scenario, name) != getattr(plain, name)}
    settings |= {name: asked[name] for name in ("require", "fail", "measure") if asked.get(name)}
    return WrittenWorld(id, found, number, settings, failed[0], said, data, base)
