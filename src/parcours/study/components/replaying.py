"""The page on one component case that was executed again: its verdict, inputs, events and messages."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import msgspec

from parcours.report.pieces import Column, Page, Section, Table
from parcours.run.trace import SHOWN, Trace
from parcours.study.parameters import Settings
from parcours.suite import Case

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

_LONG = 200  # Characters of a message that are shown


def page_of(study: ComponentStudy, case: Case, settings: Settings) -> Page:
    """Return a page on one case, executed again in simulated time."""
    from parcours.study.components.running import run_again

    judgement, trace = run_again(study, case, settings)
    values = tuple((name, value) for name, value in zip(case.names, case.values, strict=True))
    heads = (Column("time", ",d", unit="us"), Column("component"), Column("event"))
    columns = (*heads, Column("what", code=True), Column("message", code=True))
    note = "In simulated time an event takes a millisecond: the order counts, not the duration."
    pieces = (
        Table("Test inputs", (Column("input"), Column("value", ".6g")), values),
        Table("What happened", columns, event_rows(trace), note),
    )
    section = Section(f"{judgement.verdict}: {judgement.why}", "Executed again, in simulated time.", pieces)
    return Page(case.id, section.title, (("study", study.name), ("case", case.id)), (section,))


def event_rows(trace: Trace) -> tuple[tuple[str | int, ...], ...]:
    """Return the events of a trace as rows: time [us], component, kind, transition or channel, message."""
    return tuple(
        (event.time // 1000, event.component, event.kind, event.transition or event.channel,
         event.text if event.kind == "deviation" else _shown(event.payload) if event.text != SHOWN else "")
        for event in trace.events
    )  # fmt: skip


def _shown(payload: object) -> str:
    if payload is None:
        return ""
    try:
        text = json.dumps(msgspec.to_builtins(payload), ensure_ascii=False)
    except (TypeError, ValueError):
        text = type(payload).__name__
    return text if len(text) <= _LONG else text[: _LONG - 3] + "..."
