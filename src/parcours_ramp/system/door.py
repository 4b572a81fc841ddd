"""RAMP's system study as commands meet it: its parameters, campaigns in simulated time, and live cases on any host."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadRequest
from parcours.run.hosts import HOSTS
from parcours.study import protocol
from parcours.study.campaign.running import run_numbered
from parcours.study.parameters import Parameter, Settings, workers_parameter
from parcours.study.protocol import Judged, Progress, Rejudged, Reported, Request, Results, Run, StudyFinding
from parcours.suite import Case
from parcours_navigation.cases.family import FILES, LONGEST, PUBLISHED_CASES, TIME_LIMIT
from parcours_navigation.requirements.requirement import read_requirements
from parcours_navigation.study.case_parameters import (
    CASES,
    KEPT_UNITS,
    REQUIREMENTS,
    TIME_LIMIT_DOC,
    asked_for,
    cases_of,
    question_of,
    watched,
)
from parcours_navigation.study.results import measure_names
from parcours_ramp.planner import DECIDING
from parcours_ramp.planner.latency import Latencies
from parcours_ramp.system.study import LIVE_FILE, SCHEDULES, SystemStudy, system_study

if TYPE_CHECKING:
    from parcours.study.shrinking import WrittenCase

JUDGED_DOC = "one case in this many is run again, component by component, and its messages are judged; 0: none"
LIVE_CASES = 20  # Cases of a run in real time by default


@dataclasses.dataclass(frozen=True, slots=True)
class RampSystem:
    """RAMP among obstacles (`parcours.study.protocol.Study`)."""

    name: str = "ramp_system"
    kind: str = "campaign"
    doc: str = "complete RAMP among three obstacles, in simulated time or live (Tables VI, VII, IX)"
    where: str = "ramp_system"
    family: str = "navigation"
    compiles: bool = True
    stops: bool = True
    mutants: tuple[str, ...] = DECIDING

    @property
    def files(self) -> Mapping[str, Path]:
        """Where the model and the input domains lie."""
        return dict(FILES)

    @property
    def parameters(self) -> Sequence[Parameter]:
        """Schedule, cases, added delays; the host, and what only live cases have."""
        return (
            Parameter("schedule", "text", "original", "of RAMP", choices=SCHEDULES),
            *CASES,
            Parameter("added_sensing", "real", 0.0, "obstacles seen later", "s", low=0.0),
            Parameter("added_planning", "real", 0.0, "cycles longer", "s", low=0.0),
            Parameter("added_stop", "real", 0.0, "halts later", "s", low=0.0),
            Parameter(
                "solid", "bool", False, "an obstacle that touches the robot stops for good; else it drives through"
            ),
            Parameter("judged", "int", 0, JUDGED_DOC, low=0, decides=False),
            *REQUIREMENTS,
            Parameter("time_limit", "real", TIME_LIMIT, TIME_LIMIT_DOC, "s", low=0.01, high=LONGEST),
            workers_parameter(),
            Parameter("host", "text", "simulated", "where the components run", choices=HOSTS),
            Parameter(
                "graph",
                "text",
                "",
                "address of a running ROS 1 master, or a ROS 2 domain; else one of its own",
                decides=False,
            ),
            Parameter("faults", "text", "", "in real time: a file of faults, or lines: 'Planner: crash at 3 s'"),
            Parameter(
                "record",
                "text",
                "",
                "in real time: keep a recording of every case",
                choices=("", "mcap", "bag"),
                decides=False,
            ),
        )

    def study(self, settings: Settings, seed: int) -> SystemStudy:
        """Return the study with its parameters set. Raises BadRequest if one is out of range."""
        plain = system_study(
            str(settings["schedule"]), seed=seed, protocol=settings["protocol"],  # type: ignore[arg-type]
            radius=float(settings["robot_radius"]), obstacle_radius=float(settings["obstacle_radius"]),
        )  # fmt: skip
        sensing, planning, stop = (float(settings[f"added_{name}"]) for name in ("sensing", "planning", "stop"))
        latencies = Latencies(added_sensing=sensing, added_planning=planning, added_stop=stop)
        return dataclasses.replace(
            plain, latencies=latencies, time_limit=float(settings["time_limit"]), solid=bool(settings["solid"]),
            requirements=read_requirements(str(settings["require"]), str(settings["fail"])),
        )  # fmt: skip

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""
        return cases_of(settings, seed, self.name).suite(n_cases)

    def measure_names(self, settings: Settings) -> tuple[str, ...]:
        """Return what `--fail-if` may ask for of cases in simulated time."""
        if settings["host"] != "simulated":
            return ()
        return measure_names(read_requirements(str(settings["require"]), str(settings["fail"])))

    def run(self, request: Request, progress: Progress) -> Run:
        """Run a campaign in simulated time, or cases on a live host."""
        settings = request.settings
        if settings["host"] != "simulated":
            if settings["solid"]:
                rule = f"it is for cases in simulated time, but the host is {settings['host']}"
                raise BadRequest("--solid", rule, "leave it out, or --host", slug="option-study")
            for name in ("require", "fail", "until", "max-time", "address"):
                if settings.get(name) or getattr(request, name.replace("-", "_"), None):
                    rule = f"it is for cases in simulated time, but the host is {settings['host']}"
                    raise BadRequest(f"--{name}", rule, "leave it out, or --host", slug="option-study")
            from parcours_ramp.system.live_running import run_live_cases

            return run_live_cases(self, request, progress)
        for name in ("faults", "record", "graph"):
            if settings[name]:
                rule = f"it is for cases in real time, but the host is {settings['host']}"
                raise BadRequest(f"--{name}", rule, "give --host processes too, or see `parcours faults`",
                                 slug="option-study")  # fmt: skip
        study = self.study(settings, request.seed)
        question = question_of(self, request)
        n_cases, chosen = request.n_cases or PUBLISHED_CASES, asked_for(study.cases, request)
        run = run_numbered(
            self.name, self.where, study, n_cases, chosen, question, int(settings["workers"]), request, progress,
            str(settings["schedule"]), watched(study.requirements), KEPT_UNITS,
        )  # fmt: skip
        if (every := int(settings["judged"])) and not run.interrupted:
            from parcours_ramp.system.sampling import sample

            sample(study, (chosen or range(n_cases))[::every], request.out, progress)
        return run

    def read(self, folder: Path) -> Results:
        """Return the results in a folder, of a campaign or of live cases."""
        if (folder / LIVE_FILE).exists():
            from parcours_ramp.system.live_results import read_live

            return read_live(folder)
        from parcours_ramp.system.campaigns import load_campaign
        from parcours_ramp.system.sampled_results import SampledCampaign

        return SampledCampaign(load_campaign(folder), folder, self.name)

    def written(self, folder: Path, case: str) -> WrittenCase:
        """Return a failing case as a world file."""
        from parcours_navigation.study.shrinking import written

        return written(self.read(folder), folder, case)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on campaigns and live cases."""
        from parcours_navigation.study.results import report_folders

        return report_folders(results)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Execute one case in simulated time and judge it."""
        from parcours_navigation.study.judging import judge_system

        study, command = self._of(case, settings)
        return judge_system(study, study.cases, case, command)

    def show(self, case: Case, settings: Settings) -> Judged:
        """Execute one case component by component, and judge its messages, and its facts by the compiled loop's."""
        from parcours_ramp.system.sampling import judge_sampled

        study, command = self._of(case, settings)
        judgement = judge_sampled(study, case.number).judgement
        return Judged(case, judgement.verdict, judgement.why, (), f"{command} --case {case.id} --judged 1")

    def _of(self, case: Case, settings: Settings) -> tuple[SystemStudy, str]:
        protocol = "published" if case.abstract.startswith("published-") else "table-vii"
        study = dataclasses.replace(
            self.study({**settings, "protocol": protocol}, case.seed), time_limit=case.time_budget
        )
        command = f"parcours run ramp_system --schedule {settings['schedule']} --protocol {protocol} --seed {case.seed}"
        return study, command

    def rejudge(self, recording: Path) -> Rejudged:
        """Judge a recording of a live case by what is recorded alone."""
        from parcours_ramp.system.live_results import rejudge

        return rejudge(recording)

    def faults(self, request: protocol.FaultRequest, progress: Progress) -> protocol.FaultReport:
        """Strike RAMP's channels and components; under both schedules if none is named."""
        from parcours_ramp.faults.reporting import strike

        return strike(request, progress)

    def check(self, progress: Progress) -> Iterable[StudyFinding]:
        """RAMP's own tests check it."""
        return ()


@functools.cache
def study() -> RampSystem:
    """Return the study."""
    return RampSystem()
