"""Records a case while it runs, and judges a recording again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from parcours.errors import BadResults
from parcours.filenames import file_name
from parcours.run.binding import Binding, compile_binding
from parcours.run.hosts.foreign.graph import types_of
from parcours.run.recording import Raw, Recorder, read_recording
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.cases import find_scenes
from parcours_navigation.foreign.judging import AbstractJudge, Beside, JudgedCase, SystemJudge
from parcours_navigation.foreign.world import CaseKey


class Tape:
    """Records a case in a thread of its own: the relay must not wait for a disk.

    Args:
        path: *.mcap or *.bag.
        case: its id.
        begin: when the run began [ns since the epoch].
        about: what is needed to judge it again.
        host: where it ran.

    Raises:
        BadRequest: the file cannot be written.
    """

    def __init__(self, path: Path, case: str, begin: int, about: Mapping[str, str], host: str) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._recorder = Recorder(path, clock="wall", host=host, case=case, begin=begin, about=about,
                                  encoding="cdr" if host.startswith("ros2") else "ros1")  # fmt: skip
        self._beside: Beside[TraceEvent] = Beside(self._recorder.write, "recording")
        self.write = self._beside.put

    def close(self, judgement: Judgement) -> None:
        """Write what is left, with the verdict. Raises BadRequest if an event could not be written."""
        self._beside.close()
        self._recorder.conclude(about={"verdict": str(judgement.verdict), "why": judgement.why})
        self._recorder.close()


def recording_place(id: str, form: str) -> str:
    """Return where the recording of a case lies in the folder of results.

    >>> recording_place("ITP1-tp1.tp2-0.0/0", "mcap")
    'recordings/ITP1-tp1.tp2-0.0~0.mcap'
    """
    return f"recordings/{file_name(id)}.{form}"


def rejudge(path: Path, binding: Binding) -> tuple[JudgedCase, str, str]:
    """Return what a recording is judged to be, the verdict that was recorded, and the case's id without the study.

    Args:
        path: what `Tape` wrote.
        binding: the same as when it was recorded.

    Raises:
        BadResults: it cannot be read, or is not of this binding.
        HostFailure: there is no such ROS.
    """
    recording = read_recording(path)
    about, case = recording.about, recording.trace.case
    if about.get("binding") != binding.name or about.get("kind") not in ("abstract", "system"):
        rule = f"must be of the binding {binding.name!r}, but is of {about.get('binding', 'none')!r}"
        raise BadResults(str(path), rule, "name the binding it was recorded with", slug="foreign-recording")
    learned = {one.type: one for event in recording.trace.events if isinstance(one := event.payload, Raw)}
    compiled = compile_binding(binding, types_of(binding, learned.values()))
    names = about.get("names", "").split()
    seed, number = int(about.get("seed", "0")), about.get("number", "0")
    judge: SystemJudge | AbstractJudge
    if about["kind"] == "system":
        if binding.system is None:
            rule = "is of a system case, but the binding has no 'system'"
            raise BadResults(str(path), rule, slug="foreign-recording")
        scene = CaseKey(seed, int(number), about.get("protocol", "table-vii"))  # type: ignore[arg-type]
        judge, case = SystemJudge(compiled, scene, names), f"system/{number}"
    else:
        found = find_scenes(binding, seed, [case])
        if case not in found:
            raise BadResults(
                str(path), f"is of {case}, which is no case of the model any more", slug="foreign-recording"
            )
        judge = AbstractJudge(compiled, found[case].events, names)
    for event in recording.trace.events:
        judge.observe(event)
    judged = judge.judged()
    if recording.missing:
        judged = JudgedCase(Judgement(Verdict.INCONCLUSIVE, f"the recording is not whole: {recording.missing}"))
    return judged, about.get("verdict", ""), case
