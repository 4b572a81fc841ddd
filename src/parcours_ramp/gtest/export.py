"""Exports a suite of component cases as a Google Test program that runs them against live ROS 1 nodes.

The tester's messages are made here and stand in the program in their ROS 1 bytes; the ranks that judge durations are
computed here, too. So the program needs roscpp and Google Test, and nothing else.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from parcours.abtc import serialise
from parcours.errors import BadRequest
from parcours.report.writing import write_text
from parcours.run.hosts.interfaces import Interface, interfaces
from parcours.run.hosts.ros1.interfaces import TYPES, ros_name, write_package
from parcours.suite import Case, read_suite
from parcours.suite.exporting import checksum
from parcours.verdict.timing import Bound
from parcours.verdict.timing.judging import ALLOWANCE
from parcours.verdict.timing.ranks import quantile_ranks, repeats_needed
from parcours_ramp.components.model import component_inputs, component_model
from parcours_ramp.components.oracles import ORACLES
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.components.study import CASES_OF_PAPER, interaction_cases, limits
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.gtest.tables import GtestCase, GtestChannel, GtestLimit, GtestStimulus, folder_texts, tables
from parcours_ramp.planner.wire import FORMS

PACKAGE = "parcours_ramp"  # What the messages' ROS package is called

STUDY = "ramp_components"
MOST_CASES = 2_000  # Most cases of a program: each has some 2 kB of messages


@dataclass(frozen=True, slots=True)
class Repeats:
    """How often a timing case is executed, and how many of all repeats must stay within its limit."""

    repeats: int = 60  # those that count, at least 1
    warm_up: int = 3  # those before, which are discarded
    percent: float = 95.0  # of all repeats [%], above 0 and below 100


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written: into which folder, and how many tests of each kind."""

    folder: Path
    n_functional: int
    n_timing: int


def export_gtest(suite: Path, folder: Path, repeats: Repeats | None = None) -> Exported:
    """Write the program for a suite file.

    Of the paper's 60 timing cases those are written that the suite holds; three rows of data hold all.

    Args:
        folder: made if need be; files of the same names are replaced.
        repeats: of the timing cases; 60, of which 95 % must stay within the limit, if not given.

    Raises:
        BadSuite: the file cannot be read, or is no suite.
        BadRequest: a case is of another study, or none of this one; there are none, or too many; the folder cannot be
            written to; a number of `repeats` is out of its range.
    """
    cases = list(read_suite(suite))
    for case in cases:
        _check(case)
    if len(cases) > MOST_CASES:
        rule = f"a program holds at most {MOST_CASES} cases, but the suite has {len(cases)}"
        raise BadRequest("export", rule, "write a smaller suite: parcours suite --cases", slug="export-size")
    seal, timed = checksum(suite), timing_limits(cases, repeats or Repeats())
    tests = [_test(case, timed.get(case.id)) for case in cases]
    model = component_model()
    channels = interfaces(model)
    title = f"{len(tests)} cases of {STUDY}, {len(timed)} of them timed."
    program = tables(tests, gtest_channels(channels), [one.name for one in model.components], title)
    words = {"FUNCTIONAL": str(len(tests)), "TIMING": str(len(timed)), "SUITE": suite.name, "SHA256": seal}
    for name, text in folder_texts(program, words).items():
        write_text(folder / name, text)
    write_package(folder, PACKAGE, channels, FORMS)
    (folder / "launch_nodes.sh").chmod(0o755)
    return Exported(folder, len(tests), len(timed))


def _check(case: Case) -> None:
    """Refuse what is no case of this study: what its components are given must lie in the inputs' domains."""
    where = f"case {case.id}"
    if case.study != STUDY:
        raise BadRequest(where, f"only cases of {STUDY} become Google Test, but this is one of {case.study}",
                         f"parcours suite {STUDY} --out suite.jsonl", slug="export-study")  # fmt: skip
    remedy = f"write the suite again: parcours suite {STUDY}"
    if case.abstract not in interaction_cases():
        rule = f"must fill an abstract case of {STUDY}, but {case.abstract} is not one"
        raise BadRequest(where, rule, remedy, slug="export-case")
    model = component_inputs()
    if case.names != model.names:
        rule = f"must have the inputs {', '.join(model.names)}, but has {', '.join(case.names) or 'none'}"
        raise BadRequest(where, rule, remedy, slug="export-case")
    for domain, value in zip(model.domains, case.values, strict=True):
        known = any(value in block for block in domain.blocks)
        if not known or (domain.kind == "integer" and value != int(value)):
            rule = f"{domain.name} must lie in its domain, but is {value:g} {domain.unit}"
            raise BadRequest(where, rule, remedy, slug="export-case")


def _test(case: Case, limit: GtestLimit | None) -> GtestCase:
    tester, events = ComponentTester(case), serialise(interaction_cases()[case.abstract])
    stimuli = []
    for event in events:
        received = event.receives
        if received is not None and received.event is None:
            data = CODEC.encode(received.channel, tester.supply(event))
            stimuli.append(GtestStimulus(event.position, "supply", received.channel, data))
        given = tester.given(event) if received is None else None
        if given is not None:
            stimuli.append(GtestStimulus(event.position, "given", given[0], CODEC.encode(*given)))
        for channel, payload in tester.settling(event):
            stimuli.append(GtestStimulus(event.position, "settle", channel, CODEC.encode(channel, payload)))
    oracle = ORACLES[interaction_cases()[case.abstract].interaction.name].__name__
    return GtestCase(case, tester.case(), events, tuple(map(tester.prompt, events)), tuple(stimuli), oracle, limit)


def timing_limits(cases: Sequence[Case], repeats: Repeats) -> dict[str, GtestLimit]:
    """Return the limits of the paper's timing cases among these, by the cases' ids (Table VIII)."""
    by_place = {(case.abstract, case.row): case for case in cases}
    found: dict[str, GtestLimit] = {}
    for itp, wanted in CASES_OF_PAPER.items():
        ids = [id for id, case in interaction_cases().items() if case.interaction.name == itp]
        for k, limit in enumerate(limits(itp)):  # the same choice as `paper_sample`
            which = k % len(ids) if wanted >= len(ids) else k * len(ids) // wanted
            case = by_place.get((ids[which], k // len(ids)))
            if case is not None:
                trips = len(serialise(interaction_cases()[case.abstract])) // 2
                found[case.id] = _limit(Bound(round(limit * 1e9), repeats.percent, strict=False), repeats, trips)
    return found


def _limit(bound: Bound, repeats: Repeats, trips: int) -> GtestLimit:
    """Return the limit with the ranks that `verdict.timing.judge` would use for that number of repeats."""
    n, error = repeats.repeats, bound.error
    if n < 1 or repeats.warm_up < 0:
        rule = f"at least 1 repeat and 0 to warm up are needed, but {n} and {repeats.warm_up} were given"
        raise BadRequest("timing cases", rule, slug="count-range")
    low, high = quantile_ranks(n, bound.quantile, error)
    share = ALLOWANCE * (1.0 - bound.quantile)
    charged, _ = quantile_ranks(n, bound.quantile - share, error / 2)
    each = math.ceil(repeats_needed(1.0 - share, error / 2) / n)
    passes, fails = (quantile_ranks(n * each, one, error / 2)[1] for one in (bound.quantile, 1.0 - share))
    assert bound.percent is not None
    return GtestLimit(str(bound), bound.limit, bound.percent, n, repeats.warm_up, (low, high, charged), each,
                      (passes, fails), trips)  # fmt: skip


def gtest_channels(channels: Sequence[Interface]) -> tuple[GtestChannel, ...]:
    """Return the channels with the checksums by which ROS 1 knows their types."""
    found = []
    for one in channels:
        fields = _fields(one.channel)
        other = next((o for o in channels if o.topic == one.topic and o.channel != one.channel), None)
        halves = [_described(one.channel)]
        if one.role != "topic" and other is not None:
            request, response = (one, other) if one.role == "request" else (other, one)
            halves = [_described(request.channel), _described(response.channel)]
        found.append(
            GtestChannel(
                one.channel, one.sender, one.receiver, one.role, one.topic, f"{PACKAGE}/{one.type}",
                hashlib.md5("".join(halves).encode(), usedforsecurity=False).hexdigest(),
                halves[0] + "\n" if one.role == "topic" else "", other.channel if other else "", fields,
            )
        )  # fmt: skip
    return tuple(found)


def _fields(channel: str) -> tuple[tuple[str, str], ...]:
    return tuple((TYPES[field.kind], ros_name(field.name)) for field in FORMS[channel])


def _described(channel: str) -> str:
    """Return a message's fields as ROS 1 hashes them."""
    return "\n".join(f"{kind} {name}" for kind, name in _fields(channel))
