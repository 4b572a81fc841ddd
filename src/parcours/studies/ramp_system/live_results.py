"""System cases run in real time -> their verdicts in a folder, a line each as soon as it is known, and recordings."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from parcours.errors import BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Table
from parcours.run.atomic import require_writable
from parcours.run.faults import FaultPlan
from parcours.run.recording import Recorder
from parcours.run.trace import TraceEvent
from parcours.studies.archive import Form, system_about
from parcours.studies.ramp_components.resident import RampCodec
from parcours.studies.ramp_system.live import LiveRun, outcome_of
from parcours.studies.ramp_system.study import SystemStudy
from parcours.verdict.judgement import Verdict

FILE = "live.jsonl"
_FORMAT = "live/1"


@dataclass(frozen=True, slots=True)
class LiveResult:
    """One judged case.

    Attributes:
        deaths: component -> how it ended, of those that did.
        seconds: how long the case lasted.
    """

    number: int
    id: str
    verdict: str
    outcome: str
    why: str
    deaths: dict[str, str]
    seconds: float
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
        study: of the cases.
        host: that runs them.
        record: the format of recordings; None for none.
        faults: on purpose.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds results of something else, or damaged ones.
    """

    def __init__(
        self, folder: Path, study: SystemStudy, host: str, record: Form | None, faults: FaultPlan | None = None
    ) -> None:
        self._folder, self._study, self._record = folder, study, record
        require_writable(folder / "recordings" if record else folder)
        self._path = folder / FILE
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
        """Read what is there; a last line that was cut off is taken away."""
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
