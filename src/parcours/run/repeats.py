"""Traces of the repeats of one exercise <-> one trace of them all: each behind the one before, parted by notes."""

from __future__ import annotations

from dataclasses import replace

from parcours.run.trace import REPEAT, Trace, TraceEvent


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
