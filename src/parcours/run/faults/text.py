"""Reads a plan of faults from lines that people write; the inverse is `str` of a plan.

seed: 7
best_trajectory: drop 30 % from 2 s to 5 s
obstacles: delay 200 ms
Planner: freeze at 3 s for 1 s
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

from parcours.errors import BadRequest, one_of
from parcours.run.faults.corruption import HOWS, How
from parcours.run.faults.plan import (
    CHANNEL_KINDS,
    COMPONENT_KINDS,
    WORK,
    ChannelFault,
    ChannelKind,
    ComponentFault,
    ComponentKind,
    Fault,
    FaultPlan,
    share_of,
    time_of,
)

MOST = 1000
"""The greatest number of faults of a plan."""

LARGEST = 1_000_000
"""The greatest length of a file of faults [bytes]."""

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
_KINDS = {kind.replace("_", " "): kind for kind in (*CHANNEL_KINDS, *COMPONENT_KINDS)}
_SHAPES = (
    "a fault reads NAME: KIND, then how much and when, as in 'obstacles: drop 30 % from 2 s to 5 s', "
    "'obstacles: delay 200 ms', 'Planner: freeze at 3 s for 1 s', 'Planner: slow down 5 x from 2 s'"
)


def parse_fault(line: str, where: str = "fault") -> Fault:
    """Return what one line says.

    Args:
        line: a name, a colon, a kind, and in any order: a share of messages (`30 %`), a time (`200 ms`), a factor
            (`5 x`), a way of corruption, `from`, `to`, `at` or `for` a time, `messages 3 to 7`.
        where: what to call the line in a message.

    Raises:
        BadRequest: the line is no fault, or one that makes no sense.

    >>> parse_fault("Planner: slow down 5 x from 2 s")
    ComponentFault(component='Planner', kind='slow_down', at_ns=2000000000, for_ns=None, factor=5.0)
    >>> str(parse_fault("obstacles: delay  0.2 s until 5 s"))
    'obstacles: delay 200 ms to 5 s'
    """
    name, colon, rest = line.strip().partition(":")
    words = rest.strip()
    kind = next((k for text, k in _KINDS.items() if re.match(re.escape(text) + r"([\s,]|$)", words)), None)
    if not colon or kind is None:
        first = " ".join(words.split()[:1])
        hint = one_of(first, list(_KINDS)) if colon and first else _SHAPES
        raise BadRequest(where, f"must be a fault, but is {line[:80]!r}", hint, slug="fault-line")
    found: dict[str, re.Match[str]] = {}
    rest = words[len(kind) :].strip(" ,")
    while rest:
        clause, match = _clause(rest)
        if match is None:
            raise BadRequest(where, f"cannot read {rest[:40]!r} in {line[:80]!r}", _SHAPES, slug="fault-line")
        key = {"until": "to", "at": "from", "by": "amount"}.get(match[1], match[1]) if clause == "window" else clause
        if key in found:
            raise BadRequest(where, f"{key!r} is said twice in {line[:80]!r}", "say it once", slug="fault-line")
        found[key] = match
        rest = rest[match.end() :].strip(" ,")
    return _fault(name.strip(), kind, found, line, where)


def _clause(text: str) -> tuple[str, re.Match[str] | None]:
    """Return which clause the text begins with, and where it says so."""
    for clause, pattern in _CLAUSES:
        match = pattern.match(text)
        if match and re.match(r"[\s,]|$", text[match.end() :]):
            return clause, match
    return "", None


def _fault(name: str, kind: str, found: dict[str, re.Match[str]], line: str, where: str) -> Fault:
    def time(key: str) -> int | None:
        match = found.get(key)
        if match is None:
            return None
        value = time_of(match[match.re.groups - 1], match[match.re.groups])
        if value is None:
            rule = f"times are whole nanoseconds, but {match[0]!r} is none in {line[:80]!r}"
            raise BadRequest(where, rule, slug="fault-line")
        return value

    of_channel = kind in CHANNEL_KINDS
    allowed = {"from", "to", "for"} | ({"amount", "share", "how", "messages"} if of_channel else {"factor"})
    wrong = sorted(set(found) - allowed) or (["for"] if {"to", "for"} <= set(found) else [])
    if wrong:
        rule = f"{found[wrong[0]][0]!r} says nothing of a {kind.replace('_', ' ')} in {line[:80]!r}"
        raise BadRequest(where, rule, _SHAPES, slug="fault-line")
    begin, end, length = time("from") or 0, time("to"), time("for")
    try:
        if not of_channel:
            lasts = length if end is None else end - begin
            factor = float(found["factor"][1]) if "factor" in found else 1.0
            return ComponentFault(name, cast(ComponentKind, kind), begin, lasts, factor)
        messages = found.get("messages")
        return ChannelFault(
            name,
            cast(ChannelKind, kind),
            share_of(found["share"][1]) if "share" in found else 1.0,
            time("amount") or 0,
            cast(How, found["how"][1]) if "how" in found else "any",
            begin,
            end if length is None else begin + length,
            None if messages is None else (int(messages[1]), int(messages[2] or messages[1])),
        )
    except BadRequest as error:
        raise BadRequest(f"{where}, {error.where}", error.rule, error.remedy, slug=error.slug) from error


def parse_plan(text: str, where: str = "faults") -> FaultPlan:
    """Return the plan that the lines give; empty ones and what follows a # do not count, nor does a ; end less.

    Args:
        text: one fault a line or between semicolons; `seed: 7` and `work: 2 ms` may stand among them.
        where: what to call the text in a message.

    Raises:
        BadRequest: a line is none of these.

    >>> parse_plan("a: drop 30 %; Planner: crash at 5 s").faults[1].at_ns
    5000000000
    """
    seed, work = 0, WORK
    faults: list[Fault] = []
    for number, line in enumerate(text.splitlines(), 1):
        for part in line.partition("#")[0].split(";"):
            here = f"{where}, line {number}"
            if not part.strip():
                continue
            if match := re.fullmatch(r"\s*seed:\s*(\d{1,19})\s*", part):
                seed = int(match[1])
            elif match := re.fullmatch(r"\s*work:\s*" + _TIME.pattern + r"\s*", part):
                work = time_of(match[1], match[2]) or 0
            else:
                faults.append(parse_fault(part, here))
            if len(faults) > MOST:
                raise BadRequest(here, f"a plan may have {MOST} faults, but there are more", slug="fault-many")
    return FaultPlan(seed, tuple(faults), work)


def plan_from_json(value: object, where: str = "faults") -> FaultPlan:
    """Return the plan that `FaultPlan.to_json` gave.

    Args:
        value: an object with `seed`, `work_ns` and `faults`, a list of lines; each may be left out.
        where: what to call it in a message.

    Raises:
        BadRequest: it has other members, or one is of another type.

    >>> plan_from_json({"faults": ["a: drop 30 %"]}).faults[0].probability
    0.3
    """
    given = value if isinstance(value, dict) else {}
    seed, work, lines = given.get("seed", 0), given.get("work_ns", WORK), given.get("faults", [])
    sound = isinstance(value, dict) and set(given) <= {"seed", "work_ns", "faults"}
    sound = sound and type(seed) is int and type(work) is int and isinstance(lines, list) and len(lines) <= MOST
    if not sound or not all(isinstance(line, str) for line in lines):
        rule = "faults are an object of seed, work_ns (whole numbers) and faults (a list of lines), but these are not"
        raise BadRequest(where, rule, _SHAPES, slug="fault-json")
    faults = tuple(parse_fault(line, f"{where}, fault {number}") for number, line in enumerate(lines, 1))
    return FaultPlan(seed, faults, work)


def read_plan(given: str) -> FaultPlan:
    """Return the plan that a command line gives: a file of lines, a file of JSON, or the lines themselves.

    Args:
        given: whatever has a colon and is no file is taken for lines.

    Raises:
        BadRequest: there is no such file, or what it holds is no plan.

    >>> len(read_plan("obstacles: delay 200 ms; Control: crash at 5 s").faults)
    2
    """
    import json

    path = Path(given)
    try:
        is_file = len(given) < 4096 and path.is_file()
        data = path.read_bytes()[: LARGEST + 1] if is_file else given.encode()
        text = data.decode("utf-8")
    except (OSError, ValueError) as error:
        raise BadRequest(f"faults {given[:80]!r}", f"cannot be read: {error}", slug="fault-file") from error
    where = str(path) if is_file else "faults"
    if len(data) > LARGEST:
        raise BadRequest(where, f"a file of faults has at most {LARGEST} bytes, but has more", slug="fault-many")
    if not is_file and ":" not in given:
        raise BadRequest("faults", f"no file is called {given[:80]!r}", _SHAPES, slug="fault-file")
    if not text.lstrip().startswith("{"):
        return parse_plan(text, where)
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadRequest(where, f"must be JSON, but is not: {error}", _SHAPES, slug="fault-json") from error
    return plan_from_json(value, where)
