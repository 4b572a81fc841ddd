"""Conditions under which a walk stops, such as `edge>=100% or steps>=1e6 or 30 s`.

    condition = both { "or" both }
    both      = one { "and" one }
    one       = "(" condition ")" | CRITERION ">=" NUMBER "%" | "steps" ">=" NUMBER | "restarts" ">=" NUMBER
              | NUMBER UNIT | "reached" "(" STATE ")" | "taken" "(" TRANSITION ")" | "never"

Criteria are written as in `parcours.paths.criteria.grammar`; units are ms, s, min and h. A state is its name, also
with its machine or component before it (`Planner.idle`). What is not a plain word stands in quotes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from parcours.paths.walking.tokens import TokenReader, quoted

MAX_DEPTH = 50
"""Deepest nesting of parentheses."""

UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
"""Units of time [s]."""


@dataclass(frozen=True, slots=True)
class Covered:
    """At least this share [%] of the requirements of a criterion is met."""

    criterion: str
    percent: float

    def __str__(self) -> str:
        return f"{quoted(self.criterion)}>={_shown(self.percent)}%"


@dataclass(frozen=True, slots=True)
class Reached:
    """The walk stood in this state since the condition is asked."""

    state: str

    def __str__(self) -> str:
        return f"reached({quoted(self.state)})"


@dataclass(frozen=True, slots=True)
class Passed:
    """The walk took this transition since the condition is asked."""

    transition: str

    def __str__(self) -> str:
        return f"taken({quoted(self.transition)})"


@dataclass(frozen=True, slots=True)
class Counted:
    """That many moves were made (steps), or fresh starts (restarts)."""

    what: str
    least: float

    def __str__(self) -> str:
        return f"{self.what}>={_shown(self.least)}"


@dataclass(frozen=True, slots=True)
class Elapsed:
    """This much time has passed [s]."""

    seconds: float

    def __str__(self) -> str:
        return f"{_shown(self.seconds)} s"


@dataclass(frozen=True, slots=True)
class Never:
    """No end; the host that drives the walk ends it."""

    def __str__(self) -> str:
        return "never"


@dataclass(frozen=True, slots=True)
class Every:
    """All of the parts hold."""

    parts: tuple[Condition, ...]

    def __str__(self) -> str:
        return " and ".join(f"({part})" if isinstance(part, Some) else str(part) for part in self.parts)


@dataclass(frozen=True, slots=True)
class Some:
    """One of the parts holds."""

    parts: tuple[Condition, ...]

    def __str__(self) -> str:
        return " or ".join(map(str, self.parts))


Condition = Covered | Reached | Passed | Counted | Elapsed | Never | Every | Some


def is_bounded(condition: Condition) -> bool:
    """Return whether the condition comes to hold on every walk, whatever the model.

    >>> is_bounded(parse_condition("edge>=100% or 30 s")), is_bounded(parse_condition("edge>=100% and 30 s"))
    (True, False)
    """
    match condition:
        case Counted(what, _):
            return what == "steps"
        case Elapsed():
            return True
        case Some(parts):
            return any(map(is_bounded, parts))
        case Every(parts):
            return all(map(is_bounded, parts))
        case _:
            return False


def leaves(condition: Condition) -> tuple[Condition, ...]:
    """Return the conditions that are joined, in order."""
    if isinstance(condition, Every | Some):
        return tuple(leaf for part in condition.parts for leaf in leaves(part))
    return (condition,)


def parse_condition(text: str) -> Condition:
    """Return the condition that a text says.

    Args:
        text: in the language above; its own words in any case.

    Raises:
        BadRequest: the text is not in that language, too long, or nested too deep.

    >>> parse_condition("edge>=100% or 30 s")
    Some(parts=(Covered(criterion='edge', percent=100.0), Elapsed(seconds=30.0)))
    >>> str(parse_condition("(node >= 80% AND steps>=1e3) || reached(Planner.idle)"))
    'node>=80% and steps>=1000 or reached(Planner.idle)'
    """
    reader = TokenReader(text, "stop condition", "edge>=100% or steps>=1e6 or 30 s")
    condition = joined(reader, _leaf)
    if reader.here:
        reader.fail("'and', 'or' or the end must follow a condition")
    return condition


def joined(reader: TokenReader, leaf: Callable[[TokenReader], Condition], depth: int = 0) -> Condition:
    """Return what 'or', 'and' and parentheses make of the conditions that `leaf` reads."""
    parts = [_both(reader, leaf, depth)]
    while reader.take("or", "||"):
        parts.append(_both(reader, leaf, depth))
    return parts[0] if len(parts) == 1 else Some(tuple(parts))


def _both(reader: TokenReader, leaf: Callable[[TokenReader], Condition], depth: int) -> Condition:
    parts = [_one(reader, leaf, depth)]
    while reader.take("and", "&&"):
        parts.append(_one(reader, leaf, depth))
    return parts[0] if len(parts) == 1 else Every(tuple(parts))


def _one(reader: TokenReader, leaf: Callable[[TokenReader], Condition], depth: int) -> Condition:
    if not reader.take("("):
        return leaf(reader)
    if depth >= MAX_DEPTH:
        reader.fail(f"parentheses must be nested at most {MAX_DEPTH} deep")
    inner = joined(reader, leaf, depth + 1)
    reader.need(")", "what a '(' opens")
    return inner


def _leaf(reader: TokenReader) -> Condition:
    token = reader.here
    if token is not None and token.kind == "number":
        return Elapsed(_time(reader))
    word = reader.kind("word", "quoted")
    match word.lower():
        case "":
            return reader.fail("a condition must stand here")
        case "never":
            return Never()
        case "reached":
            return Reached(reader.argument(word))
        case "taken":
            return Passed(reader.argument(word))
    reader.need(">=", f"'{word}'")
    amount = reader.number()
    if word.lower() in ("steps", "restarts"):
        return Counted(word.lower(), amount)
    reader.need("%", "the share of a criterion")
    return Covered(word, reader.percent(amount))


def _time(reader: TokenReader) -> float:
    amount = reader.number()
    unit = reader.take(*UNITS)
    if not unit:
        reader.fail(f"a time must have a unit, {', '.join(UNITS)}")
    return amount * UNITS[unit]


def _shown(number: float) -> str:
    short = f"{number:g}"
    return short if float(short) == number else repr(number)
