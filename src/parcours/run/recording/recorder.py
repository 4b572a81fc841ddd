"""Writes the events of a run to a recording that is readable up to its last chunk if its writer is killed."""

from __future__ import annotations

import contextlib
import json
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from parcours import __version__
from parcours.run.atomic import replacing, unwritable
from parcours.run.clocks import ClockName
from parcours.run.noise import Noise
from parcours.run.port import StepReport
from parcours.run.recording.content import BEGIN, END, EVENT, EVENTS, FORMAT, RUN, TEXT, Names
from parcours.run.recording.layout import MessageLayout, PayloadCodec
from parcours.run.recording.topic import Encoding, Format, Raw, Topic, format_of, open_writer
from parcours.run.trace import Trace, TraceEvent, told

_REMEMBERED = 1024
"""How many messages on their way are known by their payloads; an older payload would be written again."""


class Recorder:
    """Writes the events of a run to a file while it happens.

    Events may come in another order than they happened, and from several threads. A payload is written once: events
    that speak of the same message with the same payload object refer to it. As a context manager it closes the
    recording if nothing was raised; otherwise the recording stays incomplete, as after a kill.

    Args:
        path: the file to create or replace, .mcap or .bag.
        codec: knows the payloads; payloads it does not know are left out and named in the recording. `Raw` payloads
            need none.
        clock, host, case: as in a Trace.
        begin: when the run started [ns since the epoch].
        about: what else is to be known: seed, versions, study.
        encoding: of the whole file; `cdr` for messages of ROS 2, in MCAP only.

    Raises:
        BadRequest: the file cannot be written, or is named otherwise.

    >>> import tempfile
    >>> from parcours.run.recording.recording_file import read_recording
    >>> path = Path(tempfile.mkdtemp(), "run.mcap")
    >>> with Recorder(path, clock="wall", host="processes", case="c-1", about={"seed": "7"}) as recorder:
    ...     recorder.write(TraceEvent(1000, "take", "Planner", "p1"))
    ...     recorder.conclude(about={"verdict": "pass"})
    >>> recording = read_recording(path)
    >>> recording.trace.events[0].transition, recording.complete, recording.about["verdict"]
    ('p1', True, 'pass')
    """

    def __init__(
        self,
        path: Path,
        codec: PayloadCodec | None = None,
        *,
        clock: ClockName,
        host: str = "",
        case: str = "",
        begin: int = BEGIN,
        about: Mapping[str, str] | None = None,
        encoding: Encoding = "ros1",
    ) -> None:
        form = format_of(path)
        self._path = path
        self._lock = threading.Lock()
        self._noise: Noise | None = None
        self._about: dict[str, str] = {}
        with self._writing():
            self._file = path.open("wb")
            try:
                self._stream = _Stream(self._file, form, str(path), codec, begin, encoding)
                self._stream.begin(clock, host, case, about or {})
            except BaseException:
                with contextlib.suppress(OSError):
                    self._file.close()
                raise

    def write(self, event: TraceEvent) -> None:
        """Write one event, with its payload if it has one.

        Raises:
            BadRequest: the payload does not have the form its codec names, the time cannot be written, or the disk is
                full.
        """
        with self._writing():
            self._stream.event(event)

    def flush(self) -> None:
        """Let the file hold every event written so far; to be called when a run is quiet for long."""
        with self._writing():
            self._stream.writer.flush()

    def conclude(self, noise: Noise | None = None, about: Mapping[str, str] | None = None) -> None:
        """Say what is known at the end of the run only: the machine's noise, verdict, reason."""
        self._noise = noise or self._noise
        self._about |= about or {}

    def close(self) -> None:
        """Write the end of the recording and its index; from now on it is whole."""
        with self._writing():
            if not self._file.closed:
                self._stream.end(self._noise, self._about)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with self._lock:
                yield
        except OSError as error:
            raise unwritable(self._path, error) from error

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, place: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
            return
        with self._lock, self._file:
            self._stream.writer.flush()


class _Stream:
    """Events into messages of one file."""

    def __init__(self, file: BinaryIO, form: Format, where: str, codec: PayloadCodec | None, begin: int,
                 encoding: Encoding = "ros1") -> None:  # fmt: skip
        self.writer = open_writer(form, file, where, encoding)
        self._codec, self._begin = codec, begin
        self._names = Names()
        self._flat: dict[str, tuple[Topic, MessageLayout] | None] = {}
        self._raw: dict[tuple[str, str, str], Topic] = {}
        self._known: OrderedDict[tuple[str, int], tuple[int, object, bool]] = OrderedDict()
        self._left_out: set[str] = set()
        self._n = 0
        self._last = begin

    def begin(self, clock: ClockName, host: str, case: str, about: Mapping[str, str]) -> None:
        said = {"parcours": FORMAT, "version": __version__, "clock": clock, "host": host, "case": case}
        known = dict(about)
        self.writer.remark("parcours.run", {**known, **said})
        text = json.dumps({**said, "begin": self._begin, "about": known})
        self.writer.write(RUN, self._begin, TEXT.pack((text,)))
        self.writer.flush()

    def event(self, event: TraceEvent) -> None:
        time = self._begin + event.time
        self.writer.require_time(time)
        payload, raw, topic = self._payload(event, time)
        values = (
            self._n, event.time, event.message, payload, raw, event.kind, event.component, event.transition,
            event.channel, topic, told(event),
        )  # fmt: skip
        self.writer.write(EVENTS, time, EVENT.pack(values))
        self._n += 1
        self._last = max(self._last, time)

    def _payload(self, event: TraceEvent, time: int) -> tuple[int, bool, str]:
        """Write the event's payload if need be; return the number of the event that has it, whether raw, and where."""
        payload, channel = event.payload, event.channel
        if payload is None or isinstance(payload, StepReport):
            return -1, False, ""
        key = channel, event.message
        known = self._known.get(key)
        if known is not None and known[1] is payload:
            return known[0], known[2], ""
        raw = isinstance(payload, Raw)
        if isinstance(payload, Raw):
            topic = self._raw_topic(channel, payload)
            content = payload.content
        else:
            found = self._flat_topic(channel)
            if found is None or self._codec is None:
                self._left_out.add(channel)
                return -1, False, ""
            topic, layout = found
            content = layout.pack(self._codec.flatten(channel, payload))
        self.writer.write(topic, time, content)
        if event.message >= 0:
            self._known[key] = self._n, payload, raw
            self._known.move_to_end(key)
            if len(self._known) > _REMEMBERED:
                self._known.popitem(last=False)
        return self._n, raw, topic.name

    def _raw_topic(self, channel: str, payload: Raw) -> Topic:
        key = channel, payload.type, payload.md5
        if key not in self._raw:
            self._raw[key] = self._names.raw(channel, payload)
        return self._raw[key]

    def _flat_topic(self, channel: str) -> tuple[Topic, MessageLayout] | None:
        if channel not in self._flat:
            fields = self._codec.form(channel) if self._codec else None
            layout = None if fields is None else MessageLayout(fields, f"channel {channel!r}")
            self._flat[channel] = None if layout is None else (self._names.flat(channel, layout.definition), layout)
        return self._flat[channel]

    def end(self, noise: Noise | None, about: Mapping[str, str]) -> None:
        known = dict(about)
        numbers = noise and noise.listed()
        said = {"events": self._n, "noise": numbers, "left_out": sorted(self._left_out), "about": known}
        self.writer.write(END, self._last + 1, TEXT.pack((json.dumps(said),)))
        self.writer.remark("parcours.end", {**known, "events": str(self._n), "noise": json.dumps(numbers)})
        self.writer.close()


def write_recording(
    path: Path,
    trace: Trace,
    codec: PayloadCodec | None = None,
    *,
    begin: int = BEGIN,
    about: Mapping[str, str] | None = None,
) -> None:
    """Write a finished trace as MCAP or as a ROS 1 bag, whichever the file's name asks for.

    Args:
        path: the file to create or replace, atomically.
        trace: events and payloads.
        codec, begin, about: as of `Recorder`.

    Raises:
        BadRequest: the file cannot be written, or a payload does not have the form its codec names.
    """
    form = format_of(path)
    with replacing(path) as partial:
        stream = _Stream(partial.open("wb"), form, str(path), codec, begin)
        stream.begin(trace.clock, trace.host, trace.case, about or {})
        for event in trace.events:
            stream.event(event)
        stream.end(trace.noise, {})
