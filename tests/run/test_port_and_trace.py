"""Links derived from a model; traces written and read back; broken trace files refused."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest, BadResults
from parcours.model.model_file import read_model
from parcours.run.noise import Noise
from parcours.run.port import Link, LinkKind, links
from parcours.run.trace import Kind, Trace, TraceEvent, durations, read_trace, write_trace


def test_the_channels_of_ramp_become_services_and_topics_as_table_1_has_them() -> None:
    model = read_model(Path(str(files("parcours_ramp") / "components" / "model.yaml")))
    kinds = {link.channel: link.kind for link in links(model)}
    services = {channel for channel, kind in kinds.items() if kind is LinkKind.SERVICE}
    assert services == {
        f"{what}_{way}" for what in ("trajectory", "evaluation", "modification") for way in ("request", "response")
    }
    assert {channel for channel, kind in kinds.items() if kind is LinkKind.TOPIC} == {
        "odometry", "obstacles", "best_trajectory", "update",
    }  # fmt: skip


@pytest.mark.parametrize(("capacity", "kind"), [(0, LinkKind.TOPIC), (0, LinkKind.SERVICE), (-1, LinkKind.RENDEZVOUS)])
def test_a_link_that_can_hold_nothing_is_refused(capacity: int, kind: LinkKind) -> None:
    with pytest.raises(BadRequest, match="link-capacity"):
        Link("c", "A", "B", capacity, kind)


names = st.text(max_size=8)
occurrences = st.builds(
    TraceEvent,
    time=st.integers(0, 2**62),
    kind=st.sampled_from(get_args(Kind)),
    component=names,
    transition=names,
    channel=names,
    message=st.integers(-1, 10**6),
    text=names,
    payload=st.none() | st.integers(),
)
traces = st.builds(
    Trace,
    clock=st.sampled_from(["simulated", "wall"]),
    events=st.lists(occurrences, max_size=12).map(lambda found: tuple(sorted(found, key=lambda e: e.time))),
    host=names,
    case=names,
    noise=st.none() | st.builds(Noise, st.lists(st.integers(0, 10**9), min_size=1).map(tuple), st.text()),
)


@given(trace=traces)
@settings(max_examples=60, deadline=None)
def test_a_trace_reads_back_as_it_was_written_without_payloads(
    trace: Trace, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("trace") / "t.jsonl"
    write_trace(path, trace)
    again = read_trace(path)
    assert again == trace
    assert all(event.payload is None for event in again.events)


HEAD = '{"parcours": "trace/2", "clock": "wall", "host": "", "case": "", "noise": null}'
EXAMPLE = Trace("wall", tuple(TraceEvent(10 * k, "take", "A", f"p{k}") for k in range(4)), "here", "case-1")


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_a_trace_cut_anywhere_is_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("trace") / "t.jsonl"
    write_trace(path, EXAMPLE)
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(BadResults, match=r"\[trace-(cut-short|line)\]"):
        read_trace(path)


@pytest.mark.parametrize(
    ("line", "text", "slug"),
    [
        (0, '{"parcours": "trace/9"}', "trace-version"),
        (0, "[1, 2]", "trace-version"),
        (0, HEAD.replace("wall", "sundial"), "trace-line"),
        (0, HEAD.replace("null", "[1]"), "trace-line"),
        (2, '[10, "leap", "", "", "", -1, ""]', "trace-line"),
        (2, '[10, "take"]', "trace-line"),
        (2, "[" * 100_000, "trace-line"),
        (3, '[1, "take", "A", "p", "", -1, ""]', "trace-backwards"),
        (5, '{"events": 3}', "trace-cut-short"),
    ],
)
def test_a_trace_that_was_changed_is_refused_by_line(tmp_path: Path, line: int, text: str, slug: str) -> None:
    path = tmp_path / "t.jsonl"
    write_trace(path, EXAMPLE)
    lines = path.read_text().split("\n")
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(BadResults, match=rf"\[{slug}\]"):
        read_trace(path)


def test_a_trace_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadResults, match="trace-unreadable"):
        read_trace(tmp_path / "none.jsonl")


def test_a_beginning_without_its_end_gives_no_duration() -> None:
    taken = ((0, "p1"), (1, "p2"), (2, "p2"), (3, "p1"))
    trace = Trace("wall", tuple(TraceEvent(t, "take", "A", p) for t, p in taken))
    assert durations(trace, "p1", "p2") == (1,)
    assert durations(trace, "p1", "p1") == (3,)
