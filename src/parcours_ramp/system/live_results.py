"""System cases run in real time -> their verdicts in a folder, a line each as soon as it is known, and recordings."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from parcours.errors import BadRequest, BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Page, Table
from parcours.run.atomic import require_writable
from parcours.run.faults import FaultPlan
from parcours.run.recording import Recorder, read_recording
from parcours.run.trace import TraceEvent
from parcours.study.components.archive import Form, incomplete, not_ours
from parcours.study.protocol import Measure, Rejudged, Reported
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.system.live import LiveRun, outcome_of, rerun
from parcours_ramp.system.study import LIVE_FILE, SystemStudy, system_study

_FORMAT = "live/1"


@dataclass(frozen=True, slots=True)
class LiveResult:
    """One judged case."""

    number: int
    id: str
    verdict: str
    outcome: str
    why: str
    deaths: dict[str, str]  # component -> how it ended, of those that did
    seconds: float  # how long the case lasted
    min_clearance: float

    def junit(self) -> CaseResult:
        """Return it as JUnit knows it."""
        return CaseResult(self.id, Verdict(self.verdict), self.seconds, self.why)

    def plain(self) -> dict[str, object]:
        """Return it as JSON knows it."""
        return asdict(self)


class LiveLog:
    """The results of one folder.

    Args:
        folder: made if it is not there; what is in it of the same study goes on.
        record: the format of recordings; None for none.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds results of something else, or damaged ones.
    """

    def __init__(
        self, folder: Path, study: SystemStudy, host: str, record: Form | None, faults: FaultPlan | None = None
    ) -> None:
        self._folder, self._study, self._record = folder, study, record
        require_writable(folder / "recordings" if record else folder)
        self._path = folder / LIVE_FILE
        cases = study.cases
        self._head = {
            "parcours": _FORMAT, "host": host, "schedule": study.parameters.schedule, "seed": cases.seed,
            "protocol": cases.protocol, "time_limit": study.time_limit, "robot_radius": cases.robot_radius,
            "obstacle_radius": cases.obstacle_radius, "faults": str(faults or ""),
        }  # fmt: skip
        self.done: dict[int, LiveResult] = {}
        if self._path.exists():
            self._read()
        else:
            self._append(self._head)

    def add(self, number: int, run: LiveRun) -> None:
        """Keep the result of a case; it is on disk when this returns."""
        facts = run.facts[0]
        judged, outcome = run.judgement, outcome_of(run.facts)
        self.done[number] = LiveResult(
            number, run.trace.case, str(judged.verdict), outcome, judged.why, run.deaths, float(facts["t_end"]) * 1e-9,
            float(facts["min_clearance"]),
        )  # fmt: skip
        self._append(asdict(self.done[number]))
        if self._recorder is not None:
            self._recorder.conclude(about={"verdict": str(judged.verdict), "why": judged.why})

    @contextlib.contextmanager
    def recording(self, number: int) -> Iterator[Callable[[TraceEvent], None] | None]:
        """Yield what writes the events of a case to its recording; None if none is wanted."""
        self._recorder: Recorder | None = None
        if self._record is None:
            yield None
            return
        cases, head = self._study.cases, self._head
        about = system_about(str(head["schedule"]), cases.seed, number, cases.protocol, self._study.time_limit)
        path = self._folder / "recordings" / f"system-{number:06d}.{self._record}"
        with Recorder(
            path, RampCodec(), clock="wall", host=str(head["host"]), case=cases.id(number), about=about
        ) as recorder:
            self._recorder = recorder
            yield recorder.write

    def _append(self, entry: dict[str, object]) -> None:
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, allow_nan=False) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def _read(self) -> None:
        """Read the results; a last line that was cut off is taken away."""
        text = self._path.read_text(encoding="utf-8")
        whole, _, cut = text.rpartition("\n")
        if not whole:  # killed while it wrote its first line
            self._path.unlink()
            self._append(self._head)
            return
        lines = whole.split("\n")
        try:
            head = json.loads(lines[0])
            if head != self._head:
                raise ValueError(f"its cases are those of {head}")
            for line in lines[1:]:
                result = LiveResult(**json.loads(line))
                self.done[result.number] = result
        except (ValueError, TypeError) as error:
            raise BadResults(str(self._path), f"results of the same cases are gone on with, but: {error}",
                             "choose another folder", slug="results-other") from error  # fmt: skip
        if cut:
            with self._path.open("r+b") as file:
                file.truncate(len((whole + "\n").encode()))


def live_table(results: Sequence[LiveResult], title: str) -> Table:
    """Return how many cases came to which outcome."""
    counts = Counter((one.outcome, one.verdict) for one in results)
    rows = tuple((outcome, verdict, n) for (outcome, verdict), n in sorted(counts.items()))
    return Table(title, (Column("outcome"), Column("verdict"), Column("cases")), rows)


@dataclass(frozen=True, slots=True)
class LiveResults:
    """The live cases of a folder, as every command wants them (`parcours.study.protocol.Results`)."""

    found: tuple[LiveResult, ...]
    label: str

    @property
    def planned(self) -> int:
        """As many as there are: a folder of live cases does not say how many more were wanted."""
        return len(self.found)

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        return [one.junit() for one in self.found]

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of failures and deaths, and the least clearance [m]."""
        clearance = np.array([one.min_clearance for one in self.found])
        return {
            "failed": Measure(np.array([one.verdict in ("fail", "error") for one in self.found], float)),
            "deaths": Measure(np.array([bool(one.deaths) for one in self.found], float)),
            "min_clearance": Measure(np.where(np.isfinite(clearance), clearance, np.nan), "quantity", "m", "less"),
        }

    def reported(self, name: str) -> Reported:
        """Return what a report says of them."""
        table = live_table(self.found, f"System cases in real time, {self.label}")
        return Reported([table], lambda: [table], {name: [each.plain() for each in self.found]})

    def replay(self, case: str) -> Page:
        """Refuse: a live case is judged again from its recording."""
        rule = f"case {case} ran in real time, which does not come again"
        raise BadRequest("replay", rule, "record it, and use `parcours judge`", slug="replay-live")


def read_live(folder: Path) -> LiveResults:
    """Return the live cases of a folder. Raises BadResults if a line is damaged."""
    path = folder / LIVE_FILE
    try:
        lines = path.read_text(encoding="utf-8").rpartition("\n")[0].split("\n")
        head = json.loads(lines[0])
        if head["parcours"] != _FORMAT:
            raise ValueError(f"its format is {head['parcours']!r}, not {_FORMAT!r}")
        found = sorted((LiveResult(**json.loads(line)) for line in lines[1:]), key=lambda one: one.number)
        return LiveResults(tuple(found), f"{head['schedule']}, {head['host']}")
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise BadResults(str(path), f"results of live cases must be readable, but: {error}", "run them again",
                         slug="results-components") from error  # fmt: skip


def system_about(schedule: str, seed: int, number: int, protocol: str, time_limit: float) -> dict[str, str]:
    """Return what a recording must say of a system case."""
    said = {"schedule": schedule, "seed": seed, "number": number, "protocol": protocol, "time_limit": time_limit}
    return {"study": "ramp_system", "kind": "system", "system": json.dumps(said)}


def rejudge(path: Path) -> Rejudged:
    """Judge a recording of a live case by what is recorded alone.

    Raises BadResults: the file is no recording, or not one of a system case.
    """
    recording = read_recording(path, RampCodec())
    judgement = incomplete(recording)
    if judgement is None:
        try:
            given = json.loads(recording.about["system"])
            study = system_study(given["schedule"], seed=given["seed"], protocol=given["protocol"])
            limited = replace(study, time_limit=given["time_limit"])
            judgement = rerun(limited, given["number"], recording.trace).judgement
        except (KeyError, ValueError, TypeError, BadRequest) as error:
            raise not_ours(path, error) from error
    return Rejudged(path, recording.trace.case, recording.about.get("verdict", ""), judgement)
