"""A campaign study: numbered cases, drawn from input domains, simulated into facts that formulas judge.

The simulation is anybody's code, a Python function or a program in any language. It runs in worker processes only: an
exception, bad facts, a hang or a crash cost the case in which they happen, and no other.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import BadRequest, BadSuite
from parcours.run.campaign import run_campaign
from parcours.run.exception_text import REASON_LENGTH, words_of
from parcours.run.heartbeat import write_place
from parcours.study.campaign.calling import Alarm, PythonCaller, Target, rows_of, shown
from parcours.study.campaign.judging import judge, rated_by, rates_of
from parcours.study.campaign.results import Trace, read_results, report_results
from parcours.study.campaign.rules import (
    ABSTRACT,
    KINDS,
    RATES,
    Fact,
    Rows,
    Rule,
    Worse,
    clashes,
    outcome_of,
    types_of,
)
from parcours.study.campaign.running import Chosen, run_numbered
from parcours.study.campaign.simulating import Simulation
from parcours.study.components.isolation import Done, run_apart
from parcours.study.components.systems import ProgramPart
from parcours.study.covering import closing
from parcours.study.loading import file_of, read_source
from parcours.study.parameters import Parameter, Scalar, Settings, natural, workers_parameter
from parcours.study.protocol import Judged, Progress, Rejudged, Reported, Request, Results, Run, StudyFinding
from parcours.study.selection import chosen_cases
from parcours.study.stopping import Rates
from parcours.suite import Case, Plan, combine

PATIENCE = 10.0  # so long a case may take [s of wall clock] if the study says nothing else
_EVERY = 2**62


@dataclass(frozen=True, eq=False)
class CampaignStudy:
    """A study of numbered cases (`parcours.study.protocol.Study`).

    Raises:
        BadRequest: a name means two things, or there is no fact, or one of an unknown type.
        BadModel: a formula cannot be parsed, is neither true nor false, or speaks of what is unknown.

    >>> from parcours.data import split
    >>> inputs = InputModel("speeds", (split("speed", "m/s", [0.0, 1.0, 2.0]),))
    >>> stop = CampaignStudy("stop", lambda speed: {"way": speed**2 / 2}, inputs, (Fact("way"),), (Rule("way > 1.5"),))
    >>> [round(float(way), 2) for way in stop.simulated((0, 1), {}, seed=1)["way"]]
    [0.33, 0.55]
    """

    name: str  # first part of every case id
    # what turns a case into facts: a function that is given those of its parameters that are called `case` (a
    # `parcours.suite.Case`), `seed` (int below 2**53, of the case), `rng` (a numpy Generator, of the case), or like a
    # test input or a parameter of the study; or a program that answers a JSON line with one. A function object runs
    # in processes forked of this one; code that must not be forked is named, not given
    simulate: Target | ProgramPart
    inputs: InputModel  # test inputs
    facts: tuple[Fact, ...]  # what it gives
    fail: tuple[Rule, ...]  # what fails a case; the first rule that holds gives the reason
    inconclusive: tuple[Rule, ...] = ()  # what leaves the verdict open; looked at first
    # fact -> which way is worse, where the `fail` formulas do not imply it or imply the wrong one. They imply it for
    # facts that occur on one side only: in `hit || speed < least`, more of `hit` and less of `speed`
    worse: Mapping[str, Worse] = field(default_factory=dict)
    # a function like `simulate` that returns what happened over time: a list of mappings, or (names, rows)
    trace: Target | None = None
    doc: str = ""  # a sentence about the study
    where: str = ""  # how a command line names it
    own: tuple[Parameter, ...] = ()  # parameters of its own
    criterion: str = "each_choice"  # how blocks of inputs are combined
    n_cases: int | None = None  # how many cases are run by default; None for what the criterion needs
    # what results depend on beside settings: name of a file -> digest
    digests: Mapping[str, str] = field(default_factory=dict)
    patience: float = PATIENCE  # longest time for a case [s of wall clock]
    folder: Path = field(default_factory=Path.cwd)  # from which files count
    mutants: tuple[str, ...] = ()  # files and modules that mutants are made of; empty for that of `simulate`

    kind = "campaign"
    family = "campaign"
    stops = True

    def __post_init__(self) -> None:
        where = f"study {self.name!r}"
        for _, rule, remedy in clashes(self.facts, self.inputs, self.own):
            raise BadRequest(where, rule, remedy, slug="study-double")
        if (
            not self.facts
            or any(fact.kind not in KINDS for fact in self.facts)
            or set(self.worse) - set(self._fact_names)
        ):
            rule = f"it has facts of type {', '.join(KINDS)}, and `worse` speaks of them, but has {list(self.facts)}"
            raise BadRequest(where, rule, slug="study-facts")
        for one in (*self.inconclusive, *self.fail):
            one.require_sound(types_of(self.facts, self.inputs, self.own))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its own, then how many workers."""
        return (*self.own, workers_parameter())

    def measure_names(self, settings: Settings) -> tuple[str, ...]:
        """Return what `--fail-if` may ask for: rates of verdicts, and facts."""
        return (*(name for name, _, _ in RATES), *self._fact_names)

    @property
    def _fact_names(self) -> tuple[str, ...]:
        return tuple(fact.name for fact in self.facts)

    @functools.cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The record of one case; after an error its facts are 0, false or NaN."""
        facts = [(fact.name, KINDS[fact.kind][0]) for fact in self.facts]
        return np.dtype([("number", "<i8"), *facts, ("error", "<i8"), ("reason", f"S{REASON_LENGTH}")])

    @functools.cached_property
    def inputs_digest(self) -> str:
        """A digest of the test inputs and how they are combined: whatever the values of a case depend on."""
        plain = dataclasses.replace(self.inputs, source="", doc="")
        return hashlib.sha256(repr((plain, self.criterion)).encode()).hexdigest()[:16]

    def plan(self, seed: int, n_cases: int | None = None) -> Plan:
        """Return the plan of the first `n_cases` cases."""
        return combine(
            self.name, (ABSTRACT,), self.inputs, criterion=self.criterion, time_budgets=(self.patience,), seed=seed,
            n_cases=n_cases or self.n_cases,
        )  # fmt: skip

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""
        return self.plan(seed, n_cases).cases()

    def id(self, number: int) -> str:
        """Return the id of a case."""
        return f"{self.name}/{ABSTRACT}/{number}"

    def number(self, given: str) -> int:
        """Return the number of a case: of `parking/cases/17`, `cases/17` or `17`; -1 if it is not one."""
        number = given.removeprefix(f"{self.name}/").removeprefix(f"{ABSTRACT}/")
        return int(number) if number.isdecimal() and len(number) < 16 else -1

    def values(self, numbers: NDArray[np.int64], seed: int) -> list[tuple[float, ...]]:
        """Return the values of the test inputs of cases."""
        return [tuple(row) for row in self.drawn(numbers, seed).tolist()]

    def drawn(self, numbers: NDArray[np.int64], seed: int) -> NDArray[np.float64]:
        """Return the same as an array, shape (n_cases, n_inputs)."""
        return self.plan(seed, _EVERY).values(numbers)

    def case(self, number: int, seed: int) -> Case:
        """Return one case."""
        return self.plan(seed, _EVERY).case(number)

    def natural(self, values: Sequence[float]) -> dict[str, Scalar]:
        """Return drawn values as functions, programs and formulas see them, by name."""
        return {one.name: natural(one, value) for one, value in zip(self.inputs.domains, values, strict=True)}

    def known(self, values: Sequence[float], settings: Settings) -> dict[str, Scalar]:
        """Return the values of test inputs and of its own parameters, by name."""
        return {**{one.name: settings.get(one.name, one.default) for one in self.own}, **self.natural(values)}

    @functools.cached_property
    def units(self) -> Mapping[str, str]:
        """The units of facts, test inputs and parameters, by name."""
        units = {one.name: one.unit for one in self.facts}
        units |= {one.name: one.unit for one in self.inputs.domains}
        return units | {one.name: one.unit for one in self.own}

    def shown(self, values: Mapping[str, object]) -> list[str]:
        """Return values in words: `distance = 0.31 m`."""
        units = {name: unit for name in values if (unit := self.units.get(name, "1")) != "1"}
        return [f"{name} = {shown(value)} {units.get(name, '')}".rstrip() for name, value in values.items()]

    def simulation(self, settings: Settings, seed: int) -> Simulation:
        """Return what simulates its cases, the parameters being set."""
        file = file_of(self.simulate, self.folder) if isinstance(self.simulate, str) else None
        source = read_source(str(self.simulate), file) if file is not None else None
        return Simulation(self, dict(settings), seed, source)

    def simulated(self, numbers: Sequence[int], settings: Settings, seed: int) -> Rows:
        """Return the facts of cases, simulated one after the other in one process apart, array of `dtype`.

        Raises BadRequest, HostFailure: the simulation cannot be loaded or started.
        """
        simulation = self.simulation(settings, seed)
        campaign = simulation.campaign(len(numbers), shard_size=len(numbers))
        with tempfile.TemporaryDirectory(prefix="parcours-") as folder:
            outcome = run_campaign(Chosen(simulation, tuple(numbers)), campaign, Path(folder))
            if outcome.interrupted:
                raise KeyboardInterrupt
            return outcome.store.load()

    def traced(self, case: Case, settings: Settings) -> Trace | str:
        """Return what its `trace` says of a case, run in a process apart; or why there is nothing, in words."""

        def work(item: str) -> Trace | str:
            assert self.trace is not None
            write_place("the loading of its trace")
            with Alarm() as alarm:
                caller = PythonCaller(self, self.trace, "trace", settings, case.seed, alarm)
                write_place("its trace")
                alarm.set(case.number, self.patience)
                try:
                    return rows_of(caller(case))
                except BaseException as error:  # of whatever kind: the process does nothing else
                    return f"its trace raised {words_of(error, caller.file)}"

        [(_, answer)] = run_apart([case.id], work, self.patience)
        return answer.result if isinstance(answer, Done) else answer

    def run(self, request: Request, progress: Progress) -> Run:
        """Simulate the cases that are missing in a folder."""
        chosen = [f"{ABSTRACT}/{one}" if one.isdecimal() else one for one in request.chosen]
        numbers = (
            tuple(case.number for case in chosen_cases(self.plan(request.seed), chosen, self.name)) if chosen else ()
        )
        numbers = numbers or closing(
            request, self.inputs, self.plan(request.seed, _EVERY).values, lambda of: [""] * len(of), [""]
        )
        simulation = self.simulation(request.settings, request.seed)
        question = {"seed": request.seed, "settings": simulation.decides, "files": simulation.files}
        return run_numbered(
            self.name, self.where, simulation, len(self.plan(request.seed, request.n_cases)), numbers, question,
            int(request.settings["workers"]), request, progress, simulation.label,
            Rates(lambda of: rates_of(self, of, judge(self, of, request.settings, request.seed)), rated_by(self)),
            {one.name: one.unit for one in self.facts},
        )  # fmt: skip

    def read(self, folder: Path) -> Results:
        """Return the results in a folder."""
        return read_results(self, folder)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on campaigns."""
        return report_results(results)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Simulate one case again, in a process apart, and judge it."""
        same = self.case(case.number, case.seed)
        if dataclasses.replace(case, time_budget=same.time_budget) != same:
            rule = f"a case must be one that the study has, but case {case.number} of seed {case.seed} is another"
            raise BadSuite(f"case {case.id!r}", rule, "write the suite again with this version", slug="foreign-case")
        row = self.simulated((case.number,), settings, case.seed)[0]
        outcome = outcome_of(self, row, self.known(case.values, settings))
        seen = [] if row["error"] else self.shown({name: row[name].item() for name in self._fact_names})
        facts = tuple((name, shown) for name, _, shown in (one.partition(" = ") for one in seen))
        options = "".join(f" {one.option} {settings[one.name]}" for one in self._set(settings))
        command = f"parcours run {self.where or self.name} --seed {case.seed}{options} --case {case.id} --out out"
        return Judged(case, outcome.verdict, outcome.why, facts, f"{command} && parcours replay out {case.id}")

    def _set(self, settings: Settings) -> list[Parameter]:
        return [one for one in self.own if settings.get(one.name, one.default) != one.default]

    def rejudge(self, recording: Path) -> Rejudged:
        """Refuse: campaigns are not recorded."""
        raise BadRequest(str(recording), "campaigns are not recorded", "replay a case instead", slug="recording-case")

    def check(self, progress: Progress) -> Sequence[StudyFinding]:
        """Run the battery for its author."""
        from parcours.study.campaign.campaign_file import check_campaign

        return check_campaign(self, progress)
