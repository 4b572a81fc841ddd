"""What happened in a run, in order of time: one form of record from every host, its repeats, and its file.

Verdicts are predicates over this record. Payloads of messages stay in memory: a file holds none, since a replay is a
re-simulation; it holds what components report of themselves.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import msgspec

from parcours.errors import BadResults
from parcours.run.atomic import write_atomically
from parcours.run.clocks import ClockName
from parcours.run.noise import Noise, noise_of
from parcours.run.port import StepReport

Kind = Literal["take", "send", "receive", "hold", "release", "drop", "deviation", "note"]
"""take: a transition was completed. send, receive: a message left its sender, was taken up. hold, release: a
gate kept a message back, let it go. drop: it was lost. deviation: something else than demanded; if nothing
came at all, its transition is the one that was demanded. note: any remark."""

FORMAT = "trace/2"
SHOWN = "shown"
"""The text of the note with which a gated case ends where an instance shows something of itself: channel, payload."""

BESIDE = "beside"
"""The text of what a tester hands to a component between two turns of a case, and of what this sends upon it.

Which transitions it took then is not seen, so only the data of such messages can be judged.
"""

REPEAT = "repeat"
"""The text of the note that parts one repeat of an exercise from the next: no duration reaches across it."""

_Line = tuple[int, Kind, str, str, str, int, str]
"""An event in a file: the fields of a TraceEvent but its payload."""


_REPORTED = "reported: "


class _Told(msgspec.Struct):
    variables: dict[str, bool | int | float | str]
    operations: tuple[str, ...] | None


class _Head(msgspec.Struct):
    clock: ClockName
    host: str
    case: str
    noise: list[object] | None


@dataclass(frozen=True, slots=True)
class TraceEvent:
    """One thing that happened. Fields that do not apply are empty; message number -1 is no message.

    `time` is in nanoseconds since the run began. Two events are equal if they say the same; payloads do not
    count.
    """

    time: int
    kind: Kind
    component: str = ""
    transition: str = ""
    channel: str = ""
    message: int = -1
    text: str = ""
    payload: object = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Trace:
    """A run: which clock its times are from, and its events, times never decreasing."""

    clock: ClockName
    events: tuple[TraceEvent, ...]
    host: str = ""
    case: str = ""
    noise: Noise | None = None


def transitions(trace: Trace, component: str | None = None) -> tuple[str, ...]:
    """Return the transitions taken, in order; of one component only, if named.

    >>> transitions(Trace("simulated", (TraceEvent(0, "take", "A", "p1"), TraceEvent(1, "note"))))
    ('p1',)
    """
    taken = (event for event in trace.events if event.kind == "take")
    return tuple(event.transition for event in taken if component is None or event.component == component)


def durations(trace: Trace, begin: str, end: str) -> tuple[int, ...]:
    """Return how long it took from each taking of `begin` to the next taking of `end` [ns].

    A `begin` followed by another `begin`, or by the end of its repeat, before any `end`, gives no duration.

    Args:
        trace: of any clock; judge its durations only if `trace.clock` is "wall".
        begin: a transition's name.
        end: a transition's name; may be `begin` itself, for its period.

    >>> taken = ((0, "p1"), (3, "p2"), (5, "p1"), (6, "p1"), (10, "p2"))
    >>> durations(Trace("wall", tuple(TraceEvent(t, "take", "A", p) for t, p in taken)), "p1", "p2")
    (3, 4)
    """
    found: list[int] = []
    opened: int | None = None
    for event in trace.events:
        if event.kind == "note" and event.text == REPEAT:
            opened = None
        elif event.kind == "take":
            if event.transition == end and opened is not None:
                found.append(event.time - opened)
                opened = None
            if event.transition == begin:
                opened = event.time
    return tuple(found)


def held(trace: Trace) -> dict[int, int]:
    """Return how long each released message was kept in its gate: message number -> time [ns].

    >>> held(Trace("wall", (TraceEvent(2, "hold", message=7), TraceEvent(9, "release", message=7))))
    {7: 7}
    """
    since: dict[int, int] = {}
    kept: dict[int, int] = {}
    for event in trace.events:
        if event.kind == "hold":
            since[event.message] = event.time
        elif event.kind == "release" and event.message in since:
            kept[event.message] = event.time - since[event.message]
    return kept


def told(event: TraceEvent) -> str:
    """Return what stands for an event's text in a file: with a transition, as JSON, what its component reported."""
    if not isinstance(event.payload, StepReport):
        return event.text
    said = {"variables": dict(event.payload.variables), "operations": event.payload.operations}
    return f"{_REPORTED}{json.dumps(said)}"


def retold(event: TraceEvent) -> TraceEvent:
    """Return the event that `told` was asked about, with the report that its text holds as its payload.

    Raises ValueError: the text of a transition holds no report.
    """
    if event.kind != "take" or not event.text.startswith(_REPORTED):
        return event
    try:
        said = msgspec.json.decode(event.text.removeprefix(_REPORTED), type=_Told)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(f"no report of a component: {event.text[:60]!r}") from error
    return replace(event, text="", payload=StepReport(said.variables, said.operations))


class Row:
    """Puts repeats one behind the other: times go on, and so do the numbers of messages.

    >>> row = Row()
    >>> one = (TraceEvent(5, "send", "A", message=0), TraceEvent(9, "take", "A", "p1"))
    >>> [event.time for event in row.next(one)], [event.time for event in row.next(one)]
    ([0, 5, 9], [9, 14, 18])
    """

    def __init__(self) -> None:
        self._elapsed = self._number = 0

    def next(self, events: tuple[TraceEvent, ...]) -> list[TraceEvent]:
        """Return the events of the next repeat, and the note before them."""
        begin, first = self._elapsed, self._number
        placed = [TraceEvent(begin, "note", text=REPEAT)]
        for event in events:
            number = event.message + first if event.message >= 0 else -1
            placed.append(replace(event, time=event.time + begin, message=number))
            self._number = max(self._number, number + 1)
        self._elapsed = placed[-1].time
        return placed


def repeats(trace: Trace) -> list[Trace]:
    """Return the repeats of a trace that `Row` has made, each with the times it has there.

    >>> row = Row()
    >>> events = (TraceEvent(1, "take", "A", "p1"),)
    >>> len(repeats(Trace("wall", (*row.next(events), *row.next(events)))))
    2
    """
    parts: list[list[TraceEvent]] = []
    for event in trace.events:
        if event.kind == "note" and event.text == REPEAT:
            parts.append([])
        elif parts:
            parts[-1].append(event)
    return [Trace(trace.clock, tuple(part), trace.host, trace.case, trace.noise) for part in parts]


def write_trace(path: Path, trace: Trace) -> None:
    """Write the trace as JSON Lines: a header, one array an event, and a last line that counts them.

    Args:
        path: the file to create or replace, atomically.
        trace: its payloads are left out.

    Raises:
        BadRequest: the file cannot be written.
    """
    write_atomically(path, "".join(line + "\n" for line in _lines(trace)).encode())


def _lines(trace: Trace) -> Iterator[str]:
    noise = trace.noise and trace.noise.listed()
    head = {"parcours": FORMAT, "clock": trace.clock, "host": trace.host, "case": trace.case, "noise": noise}
    yield json.dumps(head)
    for e in trace.events:
        yield json.dumps([e.time, e.kind, e.component, e.transition, e.channel, e.message, told(e)])
    yield json.dumps({"events": len(trace.events)})


def read_trace(path: Path) -> Trace:
    """Return the trace that `write_trace` wrote.

    Args:
        path: a JSON Lines file.

    Raises:
        BadResults: the file is missing, cut short, of another version, or no trace at all.
    """
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise BadResults(str(path), f"must be a readable trace file, but: {error}", slug="trace-unreadable") from error
    head = _parsed(path, 1, lines[0], object)
    given = head.get("parcours") if isinstance(head, dict) else None
    if given != FORMAT:
        rule = f"a trace begins with the format {FORMAT!r}, but this file names {given!r}"
        remedy = "read it with the version of Parcours that wrote it, or run the case again"
        raise BadResults(f"{path}:1", rule, remedy, slug="trace-version")
    n = len(lines) - 3
    if n < 0 or lines[-1] != "" or _parsed(path, n + 2, lines[-2], object) != {"events": n}:
        rule = f"a trace ends with the count of its {n + 1} events, but this file is cut short"
        raise BadResults(str(path), rule, "run the case again", slug="trace-cut-short")
    said = _parsed(path, 1, lines[0], _Head)
    try:
        noise = None if said.noise is None else noise_of(said.noise)
    except ValueError as error:
        raise _malformed(path, 1, lines[0]) from error
    events: list[TraceEvent] = []
    for number, line in enumerate(lines[1:-2], start=2):
        try:
            events.append(retold(TraceEvent(*_parsed(path, number, line, _Line))))
        except ValueError as error:
            raise _malformed(path, number, line) from error
        if len(events) > 1 and events[-1].time < events[-2].time:
            rule = f"time never runs backwards, but {events[-1].time} ns follows {events[-2].time} ns"
            remedy = "the file was edited or mixed up: run the case again"
            raise BadResults(f"{path}:{number}", rule, remedy, slug="trace-backwards")
    return Trace(said.clock, tuple(events), said.host, said.case, noise)


def _parsed(path: Path, number: int, line: str, kind: Any) -> Any:
    try:
        return msgspec.json.decode(line, type=kind)
    except (msgspec.DecodeError, RecursionError) as error:
        raise _malformed(path, number, line) from error


def _malformed(path: Path, number: int, line: str) -> BadResults:
    rule = f"each line of a trace is a JSON header, event or count, but this one is {line[:60]!r}"
    return BadResults(f"{path}:{number}", rule, "run the case again", slug="trace-line")
