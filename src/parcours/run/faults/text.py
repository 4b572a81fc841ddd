"""Reads a plan of faults from lines that people write; the inverse is `str` of a plan.

seed: 7
best_trajectory: drop 30 % from 2 s to 5 s
obstacles: delay 200 ms
Planner: freeze at 3 s for 1 s
"""

from __future__ import annotations

import re
from decimal import Decimal
from pathlib import Path
from typing import Any

from parcours.errors import BadRequest, one_of
from parcours.run.faults import plan
from parcours.run.faults.corruption import HOWS
from parcours.run.faults.plan import NANOSECONDS, ChannelFault, ComponentFault, Fault, FaultPlan

# Bounds for files from outside: every two faults of a plan are compared, and a file is read as a whole.
_MOST = 1000
_LARGEST = 1_000_000

# No pattern has two repetitions side by side that match the same: a hostile line takes linear time.
_NUMBER = r"(\d{1,15}(?:\.\d{1,12})?)"
_TIME = re.compile(_NUMBER + r"\s*(s|ms|us|ns)")
_CLAUSES = (
    ("window", re.compile(r"(from|at|to|until|for|by)\s+" + _TIME.pattern)),
    ("messages", re.compile(r"messages?\s+(\d{1,15})(?:\s+to\s+(\d{1,15}))?")),
    ("share", re.compile(_NUMBER + r"\s*%")),
    ("factor", re.compile(_NUMBER + r"\s*x")),
    ("amount", _TIME),
    ("how", re.compile("(" + "|".join(HOWS) + ")")),
)
_SAME = {"until": "to", "at": "from", "by": "amount"}
_KINDS: dict[str, Any] = {kind.replace("_", " "): kind for kind in (*plan.CHANNEL_KINDS, *plan.COMPONENT_KINDS)}
_SHAPES = (
    "a fault reads NAME: KIND, then how much and when, as in 'obstacles: drop 30 % from 2 s to 5 s', "
    "'obstacles: delay 200 ms', 'Planner: freeze at 3 s for 1 s', 'Planner: slow down 5 x from 2 s'"
)


def parse_fault(line: str, where: str = "fault") -> Fault:
    """Return what one line says; `where` is what messages call it.

    After the name, a colon and a kind come in any order: a share of messages (`30 %`), a time (`200 ms`), a factor
    (`5 x`), a way of corruption, `from`, `to`, `at` or `for` a time, `messages 3 to 7`.

    Raises:
        BadRequest: the line is not a fault, or one that makes no sense.

    >>> parse_fault("Planner: slow down 5 x from 2 s")
    ComponentFault(component='Planner', kind='slow_down', at_ns=2000000000, for_ns=None, factor=5.0)
    """
    name, colon, rest = line.strip().partition(":")
    words = rest.strip()
    kind = next((k for text, k in _KINDS.items() if re.match(re.escape(text) + r"([\s,]|$)", words)), None)
    if not colon or kind is None:
        first = " ".join(words.split()[:1])
        hint = one_of(first, list(_KINDS)) if colon and first else _SHAPES
        raise _unreadable(where, f"must be a fault, but is {line[:80]!r}", hint)
    found: dict[str, re.Match[str]] = {}
    rest = words[len(kind) :].strip(" ,")
    while rest:
        matches = ((clause, pattern.match(rest)) for clause, pattern in _CLAUSES)
        whole = ((clause, one) for clause, one in matches if one and re.match(r"[\s,]|$", rest[one.end() :]))
        clause, match = next(whole, ("", None))
        if match is None:
            raise _unreadable(where, f"cannot read {rest[:40]!r} in {line[:80]!r}")
        key = _SAME.get(match[1], match[1]) if clause == "window" else clause
        if key in found:
            raise _unreadable(where, f"{key!r} appears twice in {line[:80]!r}", "write it once")
        found[key] = match
        rest = rest[match.end() :].strip(" ,")
    return _fault(name.strip(), kind, found, line, where)


def _fault(name: str, kind: Any, found: dict[str, re.Match[str]], line: str, where: str) -> Fault:
    def time(key: str) -> int | None:
        return _nanoseconds(found[key], line, where) if key in found else None

    of_channel = kind in plan.CHANNEL_KINDS
    allowed = {"from", "to", "for"} | ({"amount", "share", "how", "messages"} if of_channel else {"factor"})
    wrong = sorted(set(found) - allowed) or (["for"] if {"to", "for"} <= set(found) else [])
    if wrong:
        rule = f"{found[wrong[0]][0]!r} says nothing of a {kind.replace('_', ' ')} in {line[:80]!r}"
        raise _unreadable(where, rule)
    start, end, length = time("from") or 0, time("to"), time("for")
    try:
        if not of_channel:
            factor = float(found["factor"][1]) if "factor" in found else 1.0
            return ComponentFault(name, kind, start, length if end is None else end - start, factor)
        share = float(Decimal(found["share"][1]) / 100) if "share" in found else 1.0
        how: Any = found["how"][1] if "how" in found else "any"
        until, messages = end if length is None else start + length, found.get("messages")
        numbers = None if messages is None else (int(messages[1]), int(messages[2] or messages[1]))
        return ChannelFault(name, kind, share, time("amount") or 0, how, start, until, numbers)
    except BadRequest as error:
        raise BadRequest(f"{where}, {error.where}", error.rule, error.remedy, slug=error.slug) from error


def _nanoseconds(match: re.Match[str], line: str, where: str) -> int:
    """Return the time [ns] whose number and unit are the last two groups of the match."""
    value = Decimal(match[match.re.groups - 1]) * NANOSECONDS[match[match.re.groups]]
    if value != int(value):  # to cut it silently would test another plan than the one that was written
        raise _unreadable(where, f"times are whole nanoseconds, but {match[0]!r} is not in {line[:80]!r}", "")
    return int(value)


def _unreadable(where: str, rule: str, remedy: str = _SHAPES) -> BadRequest:
    return BadRequest(where, rule, remedy, slug="fault-line")


def parse_plan(text: str, where: str = "faults") -> FaultPlan:
    """Return the plan of several lines: a fault each, `seed: 7` or `work: 2 ms`; # begins a remark, ; ends a line.

    Raises:
        BadRequest: a line is not one of these.

    >>> parse_plan("a: drop 30 %; Planner: crash at 5 s").faults[1].at_ns
    5000000000
    """
    seed, work = 0, plan.WORK
    faults: list[Fault] = []
    for number, line in enumerate(text.splitlines(), 1):
        for part in line.partition("#")[0].split(";"):
            here = f"{where}, line {number}"
            if not part.strip():
                continue
            if match := re.fullmatch(r"seed:\s*(\d{1,19})", part.strip()):
                seed = int(match[1])
            elif match := re.fullmatch(r"work:\s*" + _TIME.pattern, part.strip()):
                work = _nanoseconds(match, part, here)
            else:
                faults.append(parse_fault(part, here))
            if len(faults) > _MOST:
                raise BadRequest(here, f"a plan may have {_MOST} faults, but there are more", slug="fault-many")
    return FaultPlan(seed, tuple(faults), work)


def read_plan(given: str) -> FaultPlan:
    """Return the plan that a command line gives: a file of lines, or the lines themselves.

    Raises:
        BadRequest: there is no such file, or what it holds is not a plan.
    """
    path = Path(given)
    try:
        is_file = len(given) < 4096 and path.is_file()
        data = given.encode()
        if is_file:
            with path.open("rb") as file:
                data = file.read(_LARGEST + 1)
        text = data.decode("utf-8")
    except (OSError, ValueError) as error:
        raise BadRequest(f"faults {given[:80]!r}", f"cannot be read: {error}", slug="fault-file") from error
    where = str(path) if is_file else "faults"
    if len(data) > _LARGEST:
        raise BadRequest(where, f"a file of faults has at most {_LARGEST} bytes, but has more", slug="fault-many")
    if not is_file and ":" not in given:  # all lines have a colon
        raise BadRequest("faults", f"no file is called {given[:80]!r}", _SHAPES, slug="fault-file")
    return parse_plan(text, where)
