"""A case while it runs -> a recording, written beside the relay; a recording -> the verdict, judged again."""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping
from pathlib import Path

from parcours.errors import BadResults, HostFailure, ParcoursError
from parcours.filenames import file_name
from parcours.run.binding import Binding, MessageTypes, compile_binding
from parcours.run.hosts.ros1.ends import Kind
from parcours.run.hosts.ros1.foreign_types import ForeignTypes
from parcours.run.recording import Raw, Recorder, read_recording
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.cases import find_scene
from parcours_navigation.foreign.judging import AbstractJudge, Judged, SystemJudge
from parcours_navigation.foreign.world import Scene


class Tape:
    """Records a case in a thread of its own: the relay must not wait for a disk.

    Args:
        path: *.mcap or *.bag.
        case: its id.
        begin: when the run began [ns since the epoch].
        about: what is needed to judge it again.

    Raises:
        BadRequest: the file cannot be written.
    """

    def __init__(self, path: Path, case: str, begin: int, about: Mapping[str, str]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._recorder = Recorder(path, clock="wall", host="ros1, foreign", case=case, begin=begin, about=about)
        self._queue: queue.SimpleQueue[TraceEvent | None] = queue.SimpleQueue()
        self._failed: list[ParcoursError] = []
        self._thread = threading.Thread(target=self._write, daemon=True, name="recording")
        self._thread.start()

    def _write(self) -> None:
        try:
            while (event := self._queue.get()) is not None:
                self._recorder.write(event)
        except ParcoursError as error:  # told to who closes it
            self._failed.append(error)

    def write(self, event: TraceEvent) -> None:
        """Record an event, soon."""
        self._queue.put(event)

    def close(self, judgement: Judgement) -> None:
        """Write what is left, with the verdict.

        Raises:
            BadRequest: an event could not be written.
        """
        self._queue.put(None)
        self._thread.join()
        if self._failed:
            raise self._failed.pop()
        self._recorder.conclude(about={"verdict": str(judgement.verdict), "why": judgement.why})
        self._recorder.close()


def recording_place(id: str, form: str) -> str:
    """Return where the recording of a case lies in the folder of results.

    >>> recording_place("ITP1-tp1.tp2-0.0/0", "mcap")
    'recordings/ITP1-tp1.tp2-0.0~0.mcap'
    """
    return f"recordings/{file_name(id)}.{form}"


def rejudge(path: Path, binding: Binding) -> tuple[Judged, str]:
    """Return what a recording is judged to be, and what was recorded as the verdict.

    Args:
        path: what `Tape` wrote.
        binding: the same as when it was recorded.

    Raises:
        BadResults: it cannot be read, or is not of this binding.
        HostFailure: there is no genpy.
    """
    recording = read_recording(path)
    about = recording.about
    if about.get("binding") != binding.name or about.get("kind") not in ("abstract", "system"):
        rule = f"must be of the binding {binding.name!r}, but is of {about.get('binding', 'none')!r}"
        raise BadResults(str(path), rule, "name the binding it was recorded with", slug="foreign-recording")
    types = ForeignTypes(binding.python_paths, binding.interfaces)
    for event in recording.trace.events:
        if isinstance(event.payload, Raw):
            types.learn(Kind(event.payload.type, event.payload.md5, event.payload.definition))
    compiled = compile_binding(binding, MessageTypes(types.find))
    names = tuple(filter(None, about.get("names", "").split()))
    seed = int(about.get("seed", "0"))
    judge: SystemJudge | AbstractJudge
    if about["kind"] == "system":
        if binding.system is None:
            raise BadResults(
                str(path), "is of a system case, but the binding has no 'system'", slug="foreign-recording"
            )
        protocol = about.get("protocol", "table-vii")
        scene = Scene(seed, int(about.get("number", "0")), protocol)  # type: ignore[arg-type]
        judge = SystemJudge(compiled, scene, names)
    else:
        judge = AbstractJudge(compiled, find_scene(binding, seed, recording.trace.case).events, names)
    for event in recording.trace.events:
        judge.observe(event)
    judged = judge.judged()
    if recording.missing:
        judged = Judged(Judgement(Verdict.INCONCLUSIVE, f"the recording is not whole: {recording.missing}"))
    return judged, about.get("verdict", "")


__all__ = ["HostFailure", "Tape", "recording_place", "rejudge"]
