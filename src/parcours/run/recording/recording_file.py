"""Reads the trace back from a recording, whole or cut off, and converts MCAP into ROS 1 bags and back."""

from __future__ import annotations

import json
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from parcours.errors import BadResults
from parcours.run.atomic import replacing
from parcours.run.clocks import ClockName
from parcours.run.noise import noise_of
from parcours.run.recording.content import END, EVENT, EVENTS, FORMAT, RUN, TEXT
from parcours.run.recording.layout import MessageLayout, PayloadCodec, same_definition
from parcours.run.recording.source import ByteSource, CutOff, damaged
from parcours.run.recording.topic import BAG_MAGIC, MCAP_MAGIC, Message, Raw, Topic, format_of, messages, open_writer
from parcours.run.trace import Kind, Trace, TraceEvent, retold

MOST = 1 << 30
"""No more than this is read of a recording [bytes], unless asked for."""

_KINDS: dict[str, Kind] = {kind: kind for kind in get_args(Kind)}
_Values = tuple[int, int, int, int, bool, str, str, str, str, str, str]


@dataclass(frozen=True, slots=True)
class Recording:
    """What a recording holds.

    Attributes:
        trace: as it was recorded; payloads restored if their codec was given.
        missing: what is not there of the run, e.g. because its writer was killed; empty if all is. The verdict
            from an incomplete recording is inconclusive, with this as its reason.
        left_out: channels whose payloads the writer had no codec for; who judges them is inconclusive, too.
        about: seed, versions, study, verdict: whatever the writer said.
        begin: when the run began [ns since the epoch].
    """

    trace: Trace
    missing: str = ""
    left_out: tuple[str, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)
    begin: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing


def read_recording(path: Path, codec: PayloadCodec | None = None, *, most: int = MOST) -> Recording:
    """Return what was recorded; the format is found by the file's content.

    Args:
        path: what `Recorder` or `write_recording` wrote, perhaps cut off, compressed, or converted into the
            other format since.
        codec: restores the payloads; without it only those of foreign types are there.
        most: no more than this is read, expanded [bytes].

    Raises:
        BadResults: the file cannot be read, is no recording, is damaged or too large, holds another run or none, or its
            messages are of other types than the codec's.
    """
    gathered, cut = _Gathered(str(path)), ""
    with _opened(path, most) as found:
        try:
            for topic, time, content in found:
                gathered.add(topic, time, content)
        except CutOff as end:
            cut = str(end)
    return gathered.recording(cut, codec)


def convert(source: Path, target: Path, *, most: int = MOST) -> int:
    """Write the recording in the format that the target's name asks for, and return how many messages it has.

    Args:
        source: any MCAP of ROS 1 messages, or bag.
        target: the file to create or replace, atomically; .mcap or .bag.
        most: no more than this is read, expanded [bytes].

    Raises:
        BadRequest: the target cannot be written, or is named otherwise.
        BadResults: the source cannot be read, is damaged or too large.
    """
    form, n = format_of(target), 0
    with _opened(source, most) as found, replacing(target) as partial:
        writer = open_writer(form, partial.open("wb"), str(target))
        with suppress(CutOff):
            for topic, time, content in found:
                writer.write(topic, time, content)
                n += 1
                if topic in (RUN, END):
                    said = _said(content, str(source))
                    texts = {key: value if isinstance(value, str) else json.dumps(value) for key, value in said.items()}
                    writer.remark(f"parcours.{topic.name.rpartition('/')[2]}", texts)
        writer.close()
    return n


@contextmanager
def _opened(path: Path, most: int) -> Iterator[Iterator[Message]]:
    """Give the messages of a recording."""
    where = str(path)
    try:
        if path.exists() and not path.is_file():
            raise OSError("it is no ordinary file")
        file = path.open("rb")
    except OSError as error:
        rule = f"must be a readable recording, but: {error.strerror or error}"
        raise BadResults(where, rule, slug="recording-unreadable") from error
    with file:
        magic = file.read(len(BAG_MAGIC))
        if not magic.startswith(MCAP_MAGIC) and magic != BAG_MAGIC:
            rule = f"a recording begins as MCAP or as a ROS 1 bag of version 2.0, but this file with {magic!r}"
            raise BadResults(where, rule, "name the file that was recorded", slug="recording-magic")
        yield messages(ByteSource(file, where, most), "bag" if magic == BAG_MAGIC else "mcap")


class _Start(msgspec.Struct):
    """What the message on /parcours/run says."""

    clock: ClockName
    host: str
    case: str
    begin: int
    version: str = ""
    about: dict[str, object] = msgspec.field(default_factory=dict)


class _End(msgspec.Struct):
    """What the message on /parcours/end says."""

    events: int
    left_out: list[str]
    noise: list[object] | None = None
    about: dict[str, object] = msgspec.field(default_factory=dict)


_Said = TypeVar("_Said", _Start, _End)


class _Gathered:
    """Messages of one recording, in any order."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._begun: _Start | None = None
        self._ended: _End | None = None
        self._events: dict[int, tuple[_Values, int]] = {}
        self._payloads: defaultdict[tuple[str, int], deque[tuple[Topic, bytes]]] = defaultdict(deque)
        self._sound: Topic | None = None
        self._layouts: dict[tuple[str, str], MessageLayout] = {}

    def add(self, topic: Topic, time: int, content: bytes) -> None:
        """Take up a message."""
        if topic.name == EVENTS.name:
            self._event(topic, time, content)
        elif topic.name == RUN.name:
            said = _said(content, self._where)
            if said.get("parcours") != FORMAT:
                given = str(said.get("parcours"))[:40]
                rule = f"a recording has the format {FORMAT!r}, but this one names {given!r}"
                remedy = "read it with the version of Parcours that wrote it"
                raise BadResults(self._where, rule, remedy, slug="recording-version")
            start = self._converted(said, _Start, topic)
            if self._begun is not None and self._begun != start:
                raise self._mixed()
            self._begun = start
        elif topic.name == END.name:
            self._ended = self._converted(_said(content, self._where), _End, topic)
        else:
            self._payloads[topic.name, time].append((topic, content))

    def _event(self, topic: Topic, time: int, content: bytes) -> None:
        if topic is not self._sound:
            if not same_definition(topic.definition, EVENTS.definition):
                raise self._other_type(topic, EVENTS.definition)
            self._sound = topic
        values: Any = EVENT.unpack(content, self._where)
        known: _Values = values
        if known[5] not in _KINDS:
            raise damaged(self._where, f"an event is of the kind {known[5][:40]!r}")
        if known[0] in self._events:
            raise self._mixed()
        self._events[known[0]] = known, time

    def recording(self, cut: str, codec: PayloadCodec | None) -> Recording:
        """Return what the messages say."""
        begun = self._begun
        if begun is None:
            rule = "a recording by Parcours begins with a message on /parcours/run, but this file has none"
            remedy = "name a recording that Parcours wrote; of a run killed at its very start nothing is left"
            raise BadResults(self._where, rule, remedy, slug="recording-no-run")
        ended, n = self._ended, len(self._events)
        noise, missing = None, f"the recording stops after {n} events" + (f": {cut}" if cut else "")
        if ended is not None:
            missing = "" if n == ended.events else f"{n} of {ended.events} events are there"
            try:
                noise = None if ended.noise is None else noise_of(ended.noise)
            except ValueError as error:
                raise damaged(self._where, f"the message on /parcours/end does not say the {error}") from error
        events, lacking = self._trace_events(codec)
        if lacking and not missing:
            missing = f"the payloads of {lacking} events are not there"
        said = {**begun.about, **(ended.about if ended else {})}
        about = {key: str(value) for key, value in said.items()}
        if begun.version:
            about.setdefault("version", begun.version)
        trace = Trace(begun.clock, tuple(events), begun.host, begun.case, noise)
        return Recording(trace, missing, tuple(ended.left_out) if ended else (), about, begun.begin)

    def _converted(self, said: dict[str, Any], kind: type[_Said], topic: Topic) -> _Said:
        try:
            return msgspec.convert(said, kind)
        except msgspec.ValidationError as error:
            raise damaged(self._where, f"the message on {topic.name} makes no sense: {error}") from error

    def _trace_events(self, codec: PayloadCodec | None) -> tuple[list[TraceEvent], int]:
        """Return the events in order of time, and how many payloads are lacking."""
        restored: dict[int, object] = {}
        lacking = 0
        for number, (values, time) in sorted(self._events.items()):
            if values[3] != number:
                continue
            waiting = self._payloads.get((values[9], time))
            if waiting:
                topic, content = waiting.popleft()
                restored[number] = self._restored(topic, content, values[8], values[4], codec)
        events: list[TraceEvent] = []
        for values, _ in sorted(self._events.values(), key=lambda one: (one[0][1], one[0][0])):
            _, time, message, payload, _, kind, component, transition, channel, _, text = values
            lacking += payload >= 0 and payload not in restored
            known = restored.get(payload)
            event = TraceEvent(time, _KINDS[kind], component, transition, channel, message, text, known)
            try:
                events.append(retold(event))
            except ValueError as error:
                raise damaged(self._where, f"an event makes no sense: {error}") from error
        return events, lacking

    def _restored(self, topic: Topic, content: bytes, channel: str, raw: bool, codec: PayloadCodec | None) -> object:
        if raw:
            return Raw(topic.type, topic.md5, topic.definition, content, topic.encoding)
        if codec is None:
            return None
        layout = self._layouts.get((channel, topic.name))
        if layout is None:
            fields = codec.form(channel)
            layout = None if fields is None else MessageLayout(fields, f"channel {channel!r}")
            if layout is None or not same_definition(topic.definition, layout.definition):
                raise self._other_type(topic, "" if layout is None else layout.definition)
            self._layouts[channel, topic.name] = layout
        values = layout.unpack(content, self._where)
        try:
            return codec.restore(channel, values)
        except Exception as error:  # whatever a codec raises at values that it never wrote
            raise damaged(self._where, f"a payload on {channel!r} makes no sense: {error}") from error

    def _other_type(self, topic: Topic, wanted: str) -> BadResults:
        needed, given = (text.replace("\n", "; ")[:120] for text in (wanted, topic.definition))
        rule = f"messages on {topic.name} must be of the fields {needed!r}, but they are of {given!r}"
        remedy = "read it with the version of Parcours, and for the study, that wrote it"
        return BadResults(self._where, rule, remedy, slug="recording-schema")

    def _mixed(self) -> BadResults:
        rule = "a recording holds one run, but several lie in this file"
        remedy = "take them apart with its own tools, or name the file of one run"
        return BadResults(self._where, rule, remedy, slug="recording-mixed")


def _said(content: bytes, where: str) -> dict[str, Any]:
    (text,) = TEXT.unpack(content, where)
    try:
        said = json.loads(str(text))
    except (ValueError, RecursionError) as error:
        raise damaged(where, "a message on /parcours/run or /parcours/end is no JSON") from error
    if not isinstance(said, dict):
        raise damaged(where, "a message on /parcours/run or /parcours/end is no JSON object")
    return said
