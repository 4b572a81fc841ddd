"""Cases run in real time -> recordings, one a case, that say all that judging them again needs; and that judging."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from parcours.errors import BadRequest, BadResults
from parcours.run.atomic import require_writable
from parcours.run.recording import Recorder, Recording, read_recording, write_bag, write_mcap
from parcours.run.repeats import Row, repeats
from parcours.run.trace import Trace
from parcours.studies.ramp_components.resident import RampCodec
from parcours.studies.ramp_components.study import Functional, Timing, duration_of, judge_trace
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import judge, parse_bound

Form = Literal["mcap", "bag"]
_WRITE = {"mcap": write_mcap, "bag": write_bag}


class Archive:
    """A folder of recordings of component cases.

    Args:
        folder: made if it is not there.
        form: the format of the recordings.
        host: where the components are.

    Raises:
        BadRequest: the folder cannot be written to.
    """

    def __init__(self, folder: Path, form: Form, host: str) -> None:
        self._folder, self._form, self._host = folder, form, host
        require_writable(folder)
        self._open: dict[str, tuple[Recorder, Row]] = {}

    def path(self, kind: str, case: str) -> Path:
        """Return where the recording of a case lies."""
        return self._folder / f"{kind}-{case.replace('/', '-')}.{self._form}"

    def functional(self, run: Functional) -> None:
        """Record a functional case."""
        about = {**_about("functional", run.case), **_verdict(run.judgement)}
        _WRITE[self._form](self.path("functional", run.case.id), run.execution.trace, RampCodec(), about=about)

    def repeat(self, case: Case, trace: Trace) -> None:
        """Record one more repeat of a timing case."""
        if case.id not in self._open:
            path = self.path("timing", case.id)
            recorder = Recorder(
                path, RampCodec(), clock="wall", host=trace.host, case=case.id, about=_about("timing", case)
            )
            self._open[case.id] = recorder, Row()
        recorder, row = self._open[case.id]
        for event in row.next(trace.events):
            recorder.write(event)

    def timing(self, run: Timing) -> None:
        """Conclude the recording of a timing case."""
        recorder, _ = self._open.pop(run.case.id)
        recorder.conclude(run.noise, {"bound": str(run.bound), **_verdict(run.judgement)})
        recorder.close()


@dataclass(frozen=True, slots=True)
class Rejudged:
    """A recording judged again.

    Attributes:
        case: its id.
        recorded: the verdict that stands in it; empty if none does.
        judgement: the verdict it earns now.
    """

    path: Path
    case: str
    recorded: str
    judgement: Judgement

    @property
    def agrees(self) -> bool:
        """Whether both verdicts are the same."""
        return self.recorded == str(self.judgement.verdict)


def rejudge(path: Path) -> Rejudged:
    """Judge a recording of RAMP by its trace alone.

    Raises:
        BadResults: the file is no recording, or not one of RAMP's cases.
    """
    recording = read_recording(path, RampCodec())
    about = recording.about
    if recording.missing:
        judgement = Judgement(Verdict.INCONCLUSIVE, f"the recording is incomplete: {recording.missing}")
    elif recording.left_out:
        judgement = Judgement(Verdict.INCONCLUSIVE, f"recorded without payloads: {', '.join(recording.left_out)}")
    else:
        judgement = _judged(path, recording)
    return Rejudged(path, recording.trace.case, about.get("verdict", ""), judgement)


def _judged(path: Path, recording: Recording) -> Judgement:
    about, trace = recording.about, recording.trace
    try:
        match about.get("kind"):
            case "functional":
                return judge_trace(msgspec.json.decode(about["case"], type=Case), trace)
            case "timing":
                durations = tuple(map(duration_of, repeats(trace)))
                return judge(durations, parse_bound(about["bound"]), trace.noise)
            case "system":
                return _system(about["system"], trace)
            case kind:
                raise ValueError(f"its kind is {kind!r}")
    except (KeyError, ValueError, TypeError, BadRequest, msgspec.DecodeError) as error:
        raise BadResults(str(path), f"a recording says of which case it is, but: {error}",
                         "only recordings of `parcours run --record` are judged again", slug="recording-case",
                         ) from error  # fmt: skip


def system_about(schedule: str, seed: int, number: int, protocol: str, time_limit: float) -> dict[str, str]:
    """Return what a recording must say of a system case."""
    told = {"schedule": schedule, "seed": seed, "number": number, "protocol": protocol, "time_limit": time_limit}
    return {"study": "ramp_system", "kind": "system", "system": json.dumps(told)}


def _system(told: str, trace: Trace) -> Judgement:
    from parcours.studies.ramp_system.live import rerun
    from parcours.studies.ramp_system.study import system_study

    given = json.loads(told)
    study = system_study(given["schedule"], seed=given["seed"], protocol=given["protocol"])
    return rerun(dataclasses.replace(study, time_limit=given["time_limit"]), given["number"], trace).judgement


def _about(kind: str, case: Case) -> dict[str, str]:
    return {"study": case.study, "kind": kind, "case": msgspec.json.encode(case).decode()}


def _verdict(judged: Judgement) -> dict[str, str]:
    return {"verdict": str(judged.verdict), "why": judged.why}
