"""RAMP's system study as commands meet it: its parameters, campaigns in simulated time, and live cases on any host."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from parcours.errors import BadRequest
from parcours.planners.ramp.latency import Latencies
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page, Piece, Table
from parcours.studies.ramp_system.cases import PROTOCOLS, SystemCases
from parcours.studies.ramp_system.outcome_tables import Results as Campaign
from parcours.studies.ramp_system.study import (
    LONGEST,
    PUBLISHED_CASES,
    SCHEDULES,
    TIME_LIMIT,
    SystemStudy,
    system_study,
)
from parcours.study.campaign.running import run_numbered
from parcours.study.faults import FaultReport, FaultRequest
from parcours.study.hosting import HOSTS
from parcours.study.parameters import Parameter, Settings, workers_parameter
from parcours.study.protocol import Finding, Judged, Measure, Progress, Rejudged, Reported, Request, Results, Run
from parcours.suite import Case

LIVE_CASES = 20
"""Cases of a run in real time if nothing is said."""

CASES = (
    Parameter("protocol", "text", "table-vii", "how obstacles move", choices=tuple(PROTOCOLS)),
    Parameter("robot_radius", "real", 0.125, unit="m", low=0.0, high=0.5),
    Parameter("obstacle_radius", "real", 0.1, unit="m", low=0.0, high=0.5),
)
"""What the cases of any planner depend on."""


@dataclasses.dataclass(frozen=True, slots=True)
class RampSystem:
    """RAMP among obstacles (`parcours.study.protocol.Study`)."""

    name: str = "ramp_system"
    kind: str = "campaign"
    doc: str = "complete RAMP among three obstacles, in simulated time or live (Tables VI, VII, IX)"
    where: str = "ramp_system"
    family: str = "navigation"
    compiles: bool = True

    @property
    def files(self) -> Mapping[str, Path]:
        """Where the model and the input domains lie."""
        here = Path(__file__).parent
        return {"model": here / "model.yaml", "data": here / "domains.yaml"}

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
                "time_limit", "real", TIME_LIMIT, "of a case, after its static second", "s", low=0.01, high=LONGEST
            ),
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
        return dataclasses.replace(plain, latencies=latencies, time_limit=float(settings["time_limit"]))

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""
        return cases_of(settings, seed).suite(n_cases)

    def run(self, request: Request, progress: Progress) -> Run:
        """Run a campaign in simulated time, or cases on a live host."""
        settings = request.settings
        if settings["host"] != "simulated":
            from parcours.studies.ramp_system.live_running import run_live_cases

            return run_live_cases(self, request, progress)
        for name in ("faults", "record", "graph"):
            if settings[name]:
                rule = f"it is for cases in real time, but the host is {settings['host']}"
                raise BadRequest(f"--{name}", rule, "give --host processes too, or see `parcours faults`",
                                 slug="option-study")  # fmt: skip
        study = self.study(settings, request.seed)
        question = question_of(self, request)
        return run_numbered(
            self.name, self.where, study, request.n_cases or PUBLISHED_CASES, numbers_of(study.cases, request.chosen),
            question, int(settings["workers"]), request, progress, str(settings["schedule"]),
        )  # fmt: skip

    def read(self, folder: Path) -> Results:
        """Return the results in a folder, of a campaign or of live cases."""
        return read_folder(folder, self.name)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on campaigns and live cases."""
        return report_folders(results)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Execute one case in simulated time and judge it."""
        from parcours.studies.ramp_system.judging import judge_system

        protocol = "published" if case.abstract.startswith("published-") else "table-vii"
        study = dataclasses.replace(
            self.study({**settings, "protocol": protocol}, case.seed), time_limit=case.time_budget
        )
        command = f"parcours run ramp_system --schedule {settings['schedule']} --protocol {protocol} --seed {case.seed}"
        return judge_system(study, study.cases, case, command)

    def rejudge(self, recording: Path) -> Rejudged:
        """Judge a recording of a live case by what is recorded alone."""
        from parcours.studies.ramp_system.live_results import rejudge

        return rejudge(recording)

    def faults(self, request: FaultRequest, progress: Progress) -> FaultReport:
        """Strike RAMP's channels and components; under both schedules if none is named."""
        from parcours.studies.ramp_faults.door import strike

        return strike(request, progress)

    def check(self, progress: Progress) -> Iterable[Finding]:
        """RAMP's own tests check it."""
        return ()


@functools.cache
def study() -> RampSystem:
    """Return the study."""
    return RampSystem()


def cases_of(settings: Settings, seed: int) -> SystemCases:
    """Return the family of cases that settings ask for."""
    radii = float(settings["robot_radius"]), float(settings["obstacle_radius"])
    return SystemCases(seed, settings["protocol"], *radii)  # type: ignore[arg-type]


def numbers_of(cases: SystemCases, chosen: Sequence[str]) -> tuple[int, ...]:
    """Return the numbers of chosen cases, in ascending order. Raises BadRequest, naming all that are unknown."""
    found = {given: cases.number(given) for given in chosen}
    wrong = [given for given, number in found.items() if number is None]
    if wrong:
        rule = f"chosen cases must be the study's, but it has no {', '.join(wrong[:5])}"
        remedy = f"an id looks like {cases.id(0)}; its number will do, too"
        raise BadRequest("cases", rule, remedy, slug="case-unknown")
    return tuple(sorted({number for number in found.values() if number is not None}))


def question_of(study: object, request: Request) -> dict[str, object]:
    """Return what decides the results of a campaign, as its folder keeps it."""
    parameters: Sequence[Parameter] = study.parameters  # type: ignore[attr-defined]
    return {
        "seed": request.seed,
        "settings": {one.name: request.settings[one.name] for one in parameters if one.decides},
    }


class CampaignResults:
    """A campaign of any planner on system cases, as every command wants it (`parcours.study.protocol.Results`).

    Args:
        found: the campaign.
        folder: where it lies.
        study: name of the study, with which ids begin.
    """

    def __init__(self, found: Campaign, folder: Path, study: str) -> None:
        self.found, self._folder, self._study = found, folder, study
        self.label, self.planned = self.found.label, self.found.planned

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        from parcours.studies.ramp_system.campaigns import case_results

        listed = case_results(self.found)
        return [dataclasses.replace(one, id=f"{self._study}/{one.id.partition('/')[2]}") for one in listed]

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of outcomes, and the measures of the tracks."""
        from parcours.studies.ramp_system.gates import measures_of

        return measures_of(self.found)

    def replay(self, case: str) -> Page:
        """Return the replay of a case: a re-simulation that must give the same bits."""
        from parcours.report.pieces import Section

        number = self._number(case)
        drawn = self.found.replay(number)
        id = self.found.cases.id(number)
        ours = f"{self._study}/{id.partition('/')[2]}"
        drawn = dataclasses.replace(
            drawn, title=drawn.title.replace(id, ours), subtitle=drawn.subtitle.replace(id, ours)
        )
        section = Section("Replay", "Run again from the case number: the same bits as in the campaign.", (drawn,))
        return Page(drawn.title, drawn.subtitle, (("folder", str(self._folder)), ("case", str(number))), (section,))

    def _number(self, case: str) -> int:
        number, finished = self.found.cases.number(case), self.found.facts["number"]
        if number is not None and number in finished:
            return number
        rule = f"the campaign has cases 0 .. {self.planned - 1}, but case {case} was asked for"
        if number is not None and number < self.planned:
            rule = f"{len(finished) or 'no'} of {self.planned} cases are finished, and case {case} is not yet"
        if not len(finished):
            rule = f"no case is finished yet, but case {case} was asked for"
        raise BadRequest("replay", rule, "run the campaign on, or name another case", slug="case-number")


def read_folder(folder: Path, study: str) -> Results:
    """Return the results of system cases in a folder: a campaign of any planner, or live cases.

    Args:
        folder: of results.
        study: name of the study, with which ids begin.

    Raises:
        BadResults: there are none, or they are damaged.
    """
    from parcours.studies.navigation.campaigns import load_results
    from parcours.studies.ramp_system.live_results import FILE, read_live

    if (folder / FILE).exists():
        return read_live(folder)
    return CampaignResults(load_results(folder), folder, study)


def report_folders(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on campaigns and live cases of system cases."""
    from parcours.studies.navigation.campaigns import error_table, summary
    from parcours.studies.ramp_system.campaigns import campaign_pieces, measure_table
    from parcours.studies.ramp_system.live_results import LiveResults, live_table
    from parcours.studies.ramp_system.outcome_tables import outcome_table

    campaigns = {name: one.found for name, one in results.items() if isinstance(one, CampaignResults)}
    live = {name: one for name, one in results.items() if isinstance(one, LiveResults)}
    tables: list[Table] = []
    first: list[Piece] = []
    last: list[Piece] = []
    documents: dict[str, object] = {}
    if campaigns:
        errors = error_table(campaigns)
        first = [errors] if errors is not None else []
        tables += [outcome_table(campaigns), measure_table(campaigns), *([errors] if errors is not None else [])]
        documents |= {name: summary(campaign) for name, campaign in campaigns.items()}
    for name, one in live.items():
        table = live_table(one.found, f"System cases in real time, {one.label}")
        tables.append(table)
        last.append(table)
        documents[name] = [each.plain() for each in one.found]
    return Reported(tables, lambda: [*first, *campaign_pieces(campaigns), *last], documents)
