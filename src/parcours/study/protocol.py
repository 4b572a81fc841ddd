"""What a study offers to every command, and what a command gets back: structural types and plain values only.

A study joins a model, test data, a system under test and oracles. Commands know no study by name: they find one
(`parcours.study.finding`) and ask it. An author who needs full control writes an object of this protocol; all others
write `study.yaml`, from which `parcours.study.study_file` makes one.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.report.junit import CaseResult
from parcours.report.pieces import Page, Piece, Table
from parcours.study.parameters import Parameter, Settings
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict

# reports (what, how many are done, how many in all). A second line of `what` says what came of it so far
Progress = Callable[[str, int, int], None]

_WIDTH = 110  # where the lines of an explanation are broken [characters]


@dataclass(frozen=True, slots=True)
class Request:
    """What a user asks a study to run."""

    settings: Settings  # a value for each of the study's parameters
    seed: int  # campaign seed
    out: Path  # folder for the results; resumed if it holds part of the same run
    n_cases: int | None = None  # how many cases, the first ones; None leaves it to the study
    chosen: tuple[str, ...] = ()  # ids of the only cases to run, in the order of the plan; all if empty
    # rules that end the run (`parcours.study.stopping`), its longest time [s of wall clock], and the Dask scheduler
    # whose workers run the cases (`parcours.run.engine`); of studies that say `stops = True` only
    until: tuple[str, ...] = ()
    max_time: float | None = None
    address: str = ""


@dataclass(frozen=True, slots=True)
class Run:
    """How far a run came: whether Ctrl-C ended it, and one sentence about it."""

    interrupted: bool
    text: str


@dataclass(frozen=True, slots=True)
class Measure:
    """One figure for each case of a run, in the order of `Results.cases`."""

    values: NDArray[np.float64]  # shape (n_cases,); NaN where it is not known. Of a rate 0 or 1
    kind: Literal["rate", "quantity"] = "rate"  # a rate counts cases, a quantity is averaged
    unit: str = "1"  # of a quantity
    # which way is worse, for a comparison with a baseline; "" where neither is
    worse: Literal["more", "less", ""] = "more"


class Results(Protocol):
    """What lies in a folder that a study wrote."""

    @property
    def label(self) -> str:
        """What ran, in a word or two: a schedule, a planner, a host."""

    @property
    def planned(self) -> int:
        """How many cases the run was to have."""

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case; ids do not depend on the folder."""

    def measures(self) -> Mapping[str, Measure]:
        """Return what `--fail-if` and `--baseline` can ask for, by name."""

    def replay(self, case: str) -> Page:
        """Return a page on one case, run again; by its id, or by its number.

        Raises:
            BadRequest: there is no such case, or it is not finished.
            BadResults: it does not come out as it did.
        """


@dataclass(frozen=True, slots=True)
class Reported:
    """What a report says of one or several folders."""

    tables: Sequence[Table]  # for the terminal
    # makes what a page shows; called only where there is a page, since it may run cases again
    pieces: Callable[[], Sequence[Piece]]
    documents: Mapping[str, object]  # folder -> JSON values


@dataclass(frozen=True, slots=True)
class Judged:
    """One case, executed and judged."""

    case: Case  # what was executed
    verdict: Verdict  # what the study's oracle says
    why: str  # its reason, one sentence
    facts: tuple[tuple[str, str], ...]  # what the oracle looked at, as (name, value with unit)
    replay: str  # a command that shows the run

    def __str__(self) -> str:
        values = [f"{name} = {value:g}" for name, value in zip(self.case.names, self.case.values, strict=True)]
        facts = [f"{name} = {value}" for name, value in self.facts]
        paragraphs = ("case", [self.case.id]), ("values", values), ("facts", facts)
        lines = [f"{self.verdict}: {self.why}"]
        for head, parts in paragraphs:
            text = f"  {head:<7} {', '.join(parts)}"
            lines += textwrap.wrap(text, _WIDTH, subsequent_indent=" " * 10, break_long_words=False)
        return "\n".join([*lines, f"  replay  {self.replay}"])


@dataclass(frozen=True, slots=True)
class Rejudged:
    """A recording judged again."""

    path: Path  # of the recording
    case: str  # its id
    recorded: str  # the verdict that stands in it; empty if none does
    judgement: Judgement  # the verdict it earns now

    @property
    def agrees(self) -> bool:
        """Whether both verdicts are the same."""
        return self.recorded == str(self.judgement.verdict)


Level = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True)
class StudyFinding:
    """Something that the battery for authors found: how bad, where, which rule, what to do."""

    level: Level
    where: str
    rule: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.level}: {self.where}: {self.rule}" + (f"; {self.remedy}" if self.remedy else "")


# What `parcours run STUDY` does, from name to verdict:
#
#     "lift" -> finding.find ---> Study <--- study_file: study.yaml is checked as a whole, its code parsed, not run
#                                   |
#      parameters, selection -> Request(settings, seed, out, cases)
#                                   |
#                    run: each case apart from this process; cases.jsonl or a shard grows as cases finish
#                                   |
#                    read -> Results.cases()    -> gate.exit_code, JUnit
#                            Results.measures() -> gate: --fail-if, --baseline
#                                   |
#                    report -> tables, pages        replay -> one case again, which must come out the same
class Study(Protocol):
    """What joins a model, test data, a system under test and oracles."""

    @property
    def name(self) -> str:
        """A short name: letters, digits and _ . + @ = , - (the first part of every case id)."""

    @property
    def kind(self) -> str:
        """components, campaign, or what an add-on calls its kind."""

    @property
    def doc(self) -> str:
        """A sentence about it."""

    @property
    def where(self) -> str:
        """How a command line names it: its registered name, or the path of its file."""

    @property
    def parameters(self) -> Sequence[Parameter]:
        """What its users may set."""

    @property
    def family(self) -> str:
        """Studies of one family are reported together: `report` is called once for all their folders."""

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases, one by one; by default as many as the combination criterion needs."""

    def run(self, request: Request, progress: Progress) -> Run:
        """Execute cases and keep the results, each as soon as it is there; resume what was begun."""

    def read(self, folder: Path) -> Results:
        """Return the results in a folder. Raises BadResults if it holds others, or damaged ones."""

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on results of this family, by folder."""

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Execute one case of this study again and judge it.

        Raises BadSuite: it has no such case, or other values than the case's number and seed give.
        """

    def rejudge(self, recording: Path) -> Rejudged:
        """Judge a recording of this study by what is recorded alone."""

    def check(self, progress: Progress) -> Iterable[StudyFinding]:
        """Run the battery for its author, and return what is wrong."""


@dataclass(frozen=True, slots=True)
class Described:
    """What `parcours studies` lists of a study that it has not loaded."""

    name: str
    package: str
    target: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class FaultRequest:
    """What `parcours faults STUDY` asks."""

    settings: Settings  # a value for each parameter of the study
    given: frozenset[str]  # names of the parameters that the user set
    seed: int  # campaign seed
    cases: int  # how many cases a fault
    only: str  # faults whose line contains this
    workers: int  # processes
    listed: bool = False  # only list the catalogue


@dataclass(frozen=True, slots=True)
class FaultReport:
    """What became of the faults: the catalogue as lines, tables, a page, JSON values."""

    catalogue: Sequence[str]
    tables: Sequence[Table] = ()
    page: Page | None = None
    document: Mapping[str, object] = field(default_factory=dict)


@runtime_checkable
class Strikeable(Protocol):
    """A study that can be put under faults."""

    def faults(self, request: FaultRequest, progress: Progress) -> FaultReport:
        """Strike, one fault at a time, and say what became of the cases."""


@runtime_checkable
class Showing(Protocol):
    """A study whose cases can be run in a slower form that shows the messages of its components."""

    def show(self, case: Case, settings: Settings) -> Judged:
        """Execute a case of the study in that form, and judge what was sent by the model."""
