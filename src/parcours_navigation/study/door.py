"""The study `navigation` as commands meet it: the system cases with any planner."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadRequest
from parcours.run.store import open_results
from parcours.study.campaign.running import run_numbered
from parcours.study.parameters import Parameter, Settings, workers_parameter
from parcours.study.protocol import Judged, Progress, Rejudged, Reported, Request, Results, Run, StudyFinding
from parcours.suite import Case
from parcours_navigation.cases.family import LONGEST, PUBLISHED_CASES
from parcours_navigation.cases.running import CaseStudy
from parcours_navigation.guests.planners import names, own_loop
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.requirements.remarks import remarks
from parcours_navigation.requirements.requirement import Requirements, read_requirements
from parcours_navigation.study.case_parameters import (
    CASES,
    KEPT_UNITS,
    MEASURES,
    REQUIREMENTS,
    TIME_LIMIT_DOC,
    WORLDS,
    asked_for,
    question_of,
    watched,
    world_cases,
)
from parcours_navigation.study.judging import judge_system
from parcours_navigation.study.results import measure_names, read_folder, report_folders
from parcours_navigation.study.study import study_of
from parcours_navigation.worlds.family import WorldCases

if TYPE_CHECKING:
    from parcours.study.falsifying import Search
    from parcours.study.shrinking import WrittenCase

_TIMES = {
    "period": ("between observations", 0.001, 10.0),
    "command_delay": ("from an answer to the robot", 0.0, 10.0),
    "time_limit": (TIME_LIMIT_DOC, 0.01, 3600.0),
    "watched_on": ("beyond the end of an unfinished case", 0.0, 3600.0),
    "call_timeout": ("an answer that takes longer is an error; of wall clock", 0.001, 86400.0),
}
"""The times of the scenario that a user may set [s]: what each is, and its bounds."""


@dataclasses.dataclass(frozen=True, slots=True)
class Navigation:
    """Any planner among obstacles (`parcours.study.protocol.Study`)."""

    name: str = "navigation"
    kind: str = "campaign"
    doc: str = "the system cases with any planner: a shipped one, or your own"
    where: str = "navigation"
    family: str = "navigation"
    compiles: bool = True
    stops: bool = True
    planner: str = ""  # the planner that is run if none is named; a study.yaml of kind `planner` names one
    defaults: tuple[tuple[str, object], ...] = ()
    n_cases: int = PUBLISHED_CASES

    @property
    def parameters(self) -> Sequence[Parameter]:
        """The planner, the cases, and the scenario."""
        plain = Scenario()
        given = dict(self.defaults)
        times = [
            Parameter(name, "real", getattr(plain, name), doc, "s", low=low, high=high)
            for name, (doc, low, high) in _TIMES.items()
        ]
        listed = (
            Parameter("planner", "text", self.planner, f"{', '.join(names())}, module:Name or file.py:Name"),
            *WORLDS,
            *CASES,
            *times,
            *REQUIREMENTS,
            *MEASURES,
            workers_parameter(),
        )
        return tuple(dataclasses.replace(one, default=one.read(given.get(one.name, one.default))) for one in listed)

    def study(self, settings: Settings, seed: int) -> CaseStudy:
        """Return the study with its parameters set.

        Raises BadRequest if no planner is named, the name leads nowhere, or a parameter is out of range.
        """
        scenario = Scenario(**{name: float(settings[name]) for name in _TIMES})  # type: ignore[arg-type]
        planner = str(settings["planner"])
        if not planner:
            remedy = f"name one of {', '.join(names())}, or module:Name, or file.py:Name"
            raise BadRequest("--planner", "a planner must be named, but none is", remedy, slug="planner-unknown")
        cases = world_cases(settings, seed)
        if isinstance(cases, WorldCases) and scenario.time_limit == Scenario().time_limit:
            scenario = dataclasses.replace(scenario, time_limit=LONGEST)  # the world has a limit of its own
        return study_of(planner, cases, scenario, _requirements(settings))

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""
        cases = world_cases(settings, seed)
        for case in cases.suite(n_cases):
            budget = float(settings["time_limit"])
            if isinstance(cases, WorldCases) and budget == Scenario().time_limit:
                budget = cases.plan(case.number).task.time_limit
            yield dataclasses.replace(case, study=self.name, time_budget=budget)

    def measure_names(self, settings: Settings) -> tuple[str, ...]:
        """Return what `--fail-if` may ask for."""
        return measure_names(_requirements(settings))

    def run(self, request: Request, progress: Progress) -> Run:
        """Run a campaign."""
        study = self.study(request.settings, request.seed)
        chosen = asked_for(study.cases, request)
        return run_numbered(
            self.name, self.where, study, request.n_cases or self.n_cases, chosen, question_of(self, request),
            int(request.settings["workers"]), request, progress, str(request.settings["planner"]),
            watched(study.requirements), KEPT_UNITS,
        )  # fmt: skip

    def read(self, folder: Path) -> Results:
        """Return the results in a folder."""
        study = open_results(folder).campaign.study
        if study == "navigation":
            return read_folder(folder, self.name)
        from parcours.study.finding import find  # of a planner with a loop of its own

        return find(study).read(folder)

    def written(self, folder: Path, case: str) -> WrittenCase:
        """Return a failing case as a world file."""
        from parcours_navigation.study.shrinking import written

        return written(self.read(folder), folder, case)

    def search(self, settings: Settings, seed: int) -> Search:
        """Return its cases by the values of their test inputs."""
        from parcours_navigation.study.falsifying import PlannerSearch

        study = self.study(settings, seed)
        scenario = Scenario(**{name: float(settings[name]) for name in _TIMES})  # type: ignore[arg-type]
        if isinstance(study.cases, WorldCases):
            scenario = dataclasses.replace(scenario, time_limit=LONGEST)
        return PlannerSearch(study, scenario, settings)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents."""
        return report_folders(results)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Execute one case with the planner and judge it."""
        protocol = "published" if case.abstract.startswith("published-") else "table-vii"
        study = self.study({**settings, "protocol": protocol, "time_limit": case.time_budget}, case.seed)
        where = f"--world {settings['world']}" if settings["world"] else f"--protocol {protocol}"
        command = f"parcours run {self.where} --planner {settings['planner']} {where} --seed {case.seed}"
        return judge_system(study, study.cases, case, command)

    def rejudge(self, recording: Path) -> Rejudged:
        """Refuse: campaigns are not recorded."""
        raise BadRequest(str(recording), "campaigns of planners are not recorded", "replay a case instead",
                         slug="recording-case")  # fmt: skip

    def check(self, progress: Progress) -> Iterable[StudyFinding]:
        """Look at the requirements, and run the battery for authors of planners."""
        own = own_loop(self.planner)
        given = {one.name: str(one.default) for one in self.parameters}
        asked = _requirements(given)
        noted = [StudyFinding("warning", *one) for one in remarks(asked, signals_imminent=own is not None)]
        if not self.planner or own is not None:
            return noted
        from parcours_navigation.checking.battery import check_apart

        report = check_apart(
            self.planner, None, world=given["world"], progress=lambda name, done, total: progress("checks", done, total)
        )  # fmt: skip
        found = [StudyFinding(one.level.value, one.check or one.slug, one.seen, one.remedy) for one in report.findings]
        return [*noted, *found]


def _requirements(settings: Settings) -> Requirements:
    return read_requirements(*(str(settings[one.name]) for one in (*REQUIREMENTS, *MEASURES)))


@functools.cache
def study() -> Navigation:
    """Return the study."""
    return Navigation()
