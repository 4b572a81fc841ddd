"""Recordings of component cases, one per case, and the judging of cases from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import msgspec

from parcours.errors import BadResults, ParcoursError
from parcours.filenames import file_name
from parcours.run.atomic import require_writable
from parcours.run.recording import PayloadCodec, Recorder, Recording, read_recording, write_recording
from parcours.run.trace import Row, Trace, repeats
from parcours.study.components.executing import CaseTiming, Functional, judge_trace, whole_case
from parcours.study.components.results import PER_VISIT
from parcours.study.parameters import Settings
from parcours.study.protocol import Rejudged
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import judge, parse_bound

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

Form = Literal["mcap", "bag"]


class Archive:
    """A folder of recordings of component cases."""

    def __init__(self, study: ComponentStudy, folder: Path, form: str, host: str, settings: Settings) -> None:
        self._study, self._folder, self._host, self._settings = study, folder, host, settings
        self._form = cast(Form, form)
        self._codec: PayloadCodec = study.recorded
        require_writable(folder)
        self._open: dict[str, tuple[Recorder, Row]] = {}
        self._timed: dict[str, int] = {}  # a case may be timed under several limits

    def path(self, kind: str, case: str) -> Path:
        """Return where the recording of a case lies."""
        return self._folder / f"{kind}-{file_name(case)}.{self._form}"

    def functional(self, run: Functional) -> None:
        """Record a functional case."""
        about = {**self._about("functional", run.case), **_verdict(run.judgement)}
        write_recording(self.path("functional", run.case.id), run.execution.trace, self._codec, about=about)

    def repeat(self, case: Case, trace: Trace) -> None:
        """Record one more repeat of a timing case."""
        if case.id not in self._open:
            self._timed[case.id] = n = self._timed.get(case.id, 0) + 1
            path, about = self.path("timing" if n == 1 else f"timing-{n}", case.id), self._about("timing", case)
            recorder = Recorder(path, self._codec, clock="wall", host=trace.host, case=case.id, about=about)
            self._open[case.id] = recorder, Row()
        recorder, row = self._open[case.id]
        for event in row.next(trace.events):
            recorder.write(event)

    def timing(self, run: CaseTiming) -> None:
        """Conclude the recording of a timing case."""
        recorder, _ = self._open.pop(run.case.id)
        recorder.conclude(run.noise, {"bound": str(run.bound), "group": run.group, **_verdict(run.judgement)})
        recorder.close()

    def _about(self, kind: str, case: Case) -> dict[str, str]:
        instances = {"instances": self._settings.get("instances", PER_VISIT)}
        kept = instances if self._study.trusted else dict(self._settings)
        settings = {"settings": json.dumps(kept)}
        where = {"where": self._study.where} if self._study.where != self._study.name else {}
        return {"study": case.study, "kind": kind, "case": msgspec.json.encode(case).decode(), **where, **settings}


def rejudge(study: ComponentStudy, path: Path) -> Rejudged:
    """Judge a recording of a component case by its trace alone.

    Raises BadResults: the file is no recording, or not one of the study's cases.
    """
    recording = read_recording(path, study.recorded)
    judgement = incomplete(recording) or _judged(study, path, recording)
    return Rejudged(path, recording.trace.case, recording.about.get("verdict", ""), judgement)


def incomplete(recording: Recording) -> Judgement | None:
    """Return the verdict on a recording that lacks what judging it needs; None if it does not."""
    if recording.missing:
        return Judgement(Verdict.INCONCLUSIVE, f"the recording is incomplete: {recording.missing}")
    if recording.left_out:
        return Judgement(Verdict.INCONCLUSIVE, f"recorded without payloads: {', '.join(recording.left_out)}")
    return None


def not_ours(path: Path, error: Exception | str) -> BadResults:
    """Return the complaint about a recording that does not say which case it is of."""
    return BadResults(str(path), f"a recording says of which case it is, but: {error}",
                      "only recordings of `parcours run --record` are judged again", slug="recording-case")  # fmt: skip


def _judged(study: ComponentStudy, path: Path, recording: Recording) -> Judgement:
    about, trace = recording.about, recording.trace
    try:
        case = msgspec.json.decode(about["case"], type=Case)
        if about["kind"] == "functional":
            settings = json.loads(about.get("settings", "{}"))
            return judge_trace(study.exercise(settings), case, trace)
        if about["kind"] != "timing":
            raise ValueError(f"its kind is {about['kind']!r}")
        spans = {group.name: group.span for group in study.timing(case.seed, {})}
        span = spans.get(about.get("group", ""), whole_case)
        return judge(tuple(map(span, repeats(trace))), parse_bound(about["bound"]), trace.noise)
    except (KeyError, ValueError, TypeError, ParcoursError, msgspec.DecodeError) as error:
        raise not_ours(path, error) from error


def _verdict(judged: Judgement) -> dict[str, str]:
    return {"verdict": str(judged.verdict), "why": judged.why}
