"""Writes a Google Test program: C++ tables of cases, events, messages and limits, and the files that build it.

What stands in the program is written as literals from checked values, so a hostile suite cannot put code into it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Literal

from parcours.abtc import Event
from parcours.errors import BadRequest
from parcours.suite.cases import Case

PROGRAM = "test_cases.cpp"  # The file with the tables and the tests
_PLAIN = frozenset(b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 _-+.,:;/{}[]()<>=*#@&!'\n")
_WIDTH = 100


@dataclass(frozen=True, slots=True)
class GtestChannel:
    """A channel of the model on ROS 1."""

    name: str
    sender: str
    receiver: str
    role: Literal["topic", "request", "response"]  # of a topic, or which half of a service
    topic: str  # its name, or that of the service
    type: str  # package/Type
    md5sum: str  # of the type; of a service, of both halves
    definition: str  # the .msg file's text; empty for a service
    other: str  # the other half of the service; empty for a topic
    fields: tuple[tuple[str, str], ...]  # (type, name) of the message's fields, in order


@dataclass(frozen=True, slots=True)
class GtestStimulus:
    """A message in its ROS 1 bytes that the tester generates for the event at `position`.

    It is received from the environment (supply), moves an idle component (given), or is taken up before (settle).
    """

    position: int
    use: Literal["supply", "given", "settle"]
    channel: str
    data: bytes


@dataclass(frozen=True, slots=True)
class GtestLimit:
    """The limit of a timing case, and the ranks by which its repeats and the noise beside them are judged."""

    bound: str  # in words
    limit: int  # [ns]
    percent: float  # share of all repeats that must stay within it [%]
    repeats: int
    warm_up: int
    ranks: tuple[int, int, int]  # of repeats: below, above, below if some misses are put down to noise; 0 for none
    noise_samples: int  # after each repeat
    noise_ranks: tuple[int, int]  # of noise: what a pass, what a failure must exceed
    trips: int  # round trips in a sample of noise


@dataclass(frozen=True, slots=True)
class GtestCase:
    """A case as a test: its serialised events, what moves and feeds them, and what is expected."""

    case: Case
    document: bytes  # the case as its nodes know it
    events: tuple[Event, ...]
    prompts: tuple[str, ...]  # of each event, what moves an idle component to it
    stimuli: tuple[GtestStimulus, ...]
    oracle: str  # the C++ function that knows the expected result
    limit: GtestLimit | None = None  # of a timing case beside the functional one; None if it has none


def literal(data: bytes | str) -> str:
    """Return a C++ string literal of these bytes, in one or several lines."""
    given = data.encode() if isinstance(data, str) else data
    text = "".join(chr(byte) if byte in _PLAIN and byte != 10 else f"\\{byte:03o}" for byte in given)
    pieces = re.findall(rf"(?:\\[0-7]{{3}}|[^\\]){{1,{_WIDTH}}}", text) or [""]
    return "\n    ".join(f'"{piece}"' for piece in pieces)


def identifier(case: Case) -> str:
    """Return the name of a case's test."""
    return "_".join(re.findall("[A-Za-z0-9]+", case.abstract)) + f"_row{case.row}"


def tables(cases: Sequence[GtestCase], channels: Sequence[GtestChannel], components: Sequence[str], title: str) -> str:
    """Return the program's text: tables of channels, events, messages and cases, then the tests.

    Raises BadRequest: there is no case, two tests would have one name, or a case names an unknown channel.
    """
    names = _names(cases)
    places = {channel.name: place for place, channel in enumerate(channels)}
    lines = [f"// {' '.join(re.findall('[A-Za-z0-9_.,:-]+', title))}", "// Written by parcours export gtest.", ""]
    lines += ['#include "parcours_gtest.hpp"', "", "using namespace parcours;", "", "namespace {", ""]
    lines += ["constexpr Channel CHANNELS[] = {", *(_channel(one, places) for one in channels), "};", ""]
    events: dict[str, str] = {}
    payloads: dict[bytes, str] = {}
    for one, name in zip(cases, names, strict=True):
        if one.case.abstract not in events:
            events[one.case.abstract] = f"EVENTS_{len(events)}"
            head = f"constexpr Event {events[one.case.abstract]}[] = {{  // {one.case.abstract}"
            lines += [head, *_events(one, places), "};", ""]
        for stimulus in one.stimuli:
            if stimulus.data not in payloads:
                payloads[stimulus.data] = f"M{len(payloads)}"
                lines.append(f"constexpr char {payloads[stimulus.data]}[] =\n    {literal(stimulus.data)};")
        lines += _case(one, name, events[one.case.abstract], payloads)
    lines += ["}  // namespace", ""]
    lines += [f"TEST(Functional, {name}) {{ run_functional(CASE_{name}); }}" for name in names]
    for one, name in zip(cases, names, strict=True):
        if one.limit is not None:
            lines.append(f"TEST(Timing, {name}) {{ run_timing(CASE_{name}, {_limit(one.limit)}); }}")
    nodes = ", ".join(map(literal, components))
    lines += ["", "int main(int argc, char** argv) {"]
    lines += [f"  return run_all(argc, argv, CHANNELS, {len(channels)}, {{{nodes}}});", "}", ""]
    return "\n".join(lines)


def _names(cases: Sequence[GtestCase]) -> list[str]:
    if not cases:
        raise BadRequest("export", "a program needs at least one case, but the suite has none", slug="export-cases")
    names: dict[str, str] = {}
    for one in cases:
        name = identifier(one.case)
        if name in names:
            rule = f"each case must have a name of its own, but {one.case.id} and {names[name]} are both {name}"
            raise BadRequest("export", rule, "leave one of them out", slug="export-cases")
        names[name] = one.case.id
    return list(names)


def _channel(one: GtestChannel, places: dict[str, int]) -> str:
    words = (one.name, one.sender, one.receiver)
    fields = " ".join(f"{kind} {name}" for kind, name in one.fields)
    described = ", ".join(map(literal, (one.topic, one.type, one.md5sum, one.definition)))
    other = places[one.other] if one.other else "NONE"
    return f"    {{{', '.join(map(literal, words))}, Role::{one.role}, {described}, {other}, {literal(fields)}}},"


def _events(one: GtestCase, places: dict[str, int]) -> Iterator[str]:
    for event, prompt in zip(one.events, one.prompts, strict=True):
        received = event.receives
        if len(event.sends) > 1 or len(event.after) > 2:
            rule = "an event sends at most one message and waits for at most two others"
            raise BadRequest(f"event {event.position} of {one.case.abstract}", rule, slug="export-event")
        sent = event.sends[0] if event.sends else None
        after = [*map(str, event.after), "NONE", "NONE"][:2]
        yield "    {" + ", ".join([
            str(event.position), str(event.reference), literal(event.component), literal(event.transition),
            _place(received.channel if received else None, places),
            "NONE" if received is None or received.event is None else str(received.event),
            _place(sent.channel if sent else None, places),
            "true" if sent is not None and sent.to == "reference" else "false",
            "{" + ", ".join(after) + "}", "NONE" if event.before is None else str(event.before), literal(prompt),
        ]) + "},"  # fmt: skip


def _place(channel: str | None, places: dict[str, int]) -> str:
    if channel is None:
        return "NONE"
    if channel not in places:
        rule = f"must be one of the model's, but {channel!r} is not one"
        raise BadRequest("channel of an event", rule, slug="export-event")
    return str(places[channel])


def _case(one: GtestCase, name: str, events: str, payloads: dict[bytes, str]) -> Iterator[str]:
    if one.stimuli:
        yield f"constexpr Stimulus STIMULI_{name}[] = {{"
        for each in one.stimuli:
            data = f"{{{payloads[each.data]}, {len(each.data)}}}"
            yield f"    {{{each.position}, Use::{each.use}, {literal(each.channel)}, {data}}},"
        yield "};"
    stimuli = f"STIMULI_{name}" if one.stimuli else "nullptr"
    document = f"{{\n    {literal(one.document)}, {len(one.document)}}}"
    counted = f"{events}, {len(one.events)}, {stimuli}, {len(one.stimuli)}"
    yield f"constexpr Case CASE_{name} = {{{literal(one.case.id)}, {document},\n    {counted}, &{one.oracle}}};"
    yield ""


def _limit(one: GtestLimit) -> str:
    numbers = [one.limit, one.percent, one.repeats, one.warm_up, *one.ranks, one.noise_samples, *one.noise_ranks]
    return "{" + ", ".join([literal(one.bound), *map(repr, numbers), str(one.trips)]) + "}"


def folder_texts(program: str, words: dict[str, str]) -> dict[str, str]:
    """Return the program, the headers it includes, and how it is built: name of the file -> its text.

    Args:
        words: what stands for @NAME@ in the README; letters, digits and _ . , - are left of it.
    """
    texts = {PROGRAM: program}
    for source in (files(__package__) / "cpp").iterdir():
        text = source.read_text(encoding="utf-8")
        if source.name == "README.md":
            text = re.sub("@([A-Z0-9]+)@", lambda match: _plain(words[match[1]]), text)
        texts[source.name] = text
    return texts


def _plain(word: str) -> str:
    return re.sub(r"[^\w.,-]", "_", word)
