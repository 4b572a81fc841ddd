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
from typing import Literal

from parcours.paths.walking.tokens import TokenReader, quoted

MAX_DEPTH = 50
"""Deepest nesting of parentheses."""

UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
"""Units of time [s]."""


@dataclass(frozen=True, slots=True)
class StopCondition:
    """One condition, or several joined.

    Attributes:
        kind: what is asked. Coverage, steps and restarts count from the start of the walk or of its phase; `never`
            leaves the end to the host that drives the walk.
        name: of the criterion, of the state reached or of the transition taken.
        amount: the least share of the criterion [%], number of moves or fresh starts, or time that passed [s].
        parts: what `and` and `or` join.
    """

    kind: Literal["covered", "reached", "taken", "steps", "restarts", "elapsed", "never", "and", "or"]
    name: str = ""
    amount: float = 0.0
    parts: tuple[StopCondition, ...] = ()

    def __str__(self) -> str:
        short = f"{self.amount:g}"
        amount = short if float(short) == self.amount else repr(self.amount)
        match self.kind:
            case "covered":
                return f"{quoted(self.name)}>={amount}%"
            case "reached" | "taken":
                return f"{self.kind}({quoted(self.name)})"
            case "steps" | "restarts":
                return f"{self.kind}>={amount}"
            case "elapsed":
                return f"{amount} s"
            case "and":
                return " and ".join(f"({part})" if part.kind == "or" else str(part) for part in self.parts)
            case "or":
                return " or ".join(map(str, self.parts))
        return self.kind


def is_bounded(condition: StopCondition) -> bool:
    """Return whether the condition comes to hold on every walk, whatever the model.

    >>> is_bounded(parse_condition("edge>=100% or 30 s")), is_bounded(parse_condition("edge>=100% and 30 s"))
    (True, False)
    """
    match condition.kind:
        case "or":
            return any(map(is_bounded, condition.parts))
        case "and":
            return all(map(is_bounded, condition.parts))
    return condition.kind in ("steps", "elapsed")


def leaves(condition: StopCondition) -> tuple[StopCondition, ...]:
    """Return the conditions that are joined, in order."""
    return tuple(leaf for part in condition.parts for leaf in leaves(part)) if condition.parts else (condition,)


def parse_condition(text: str) -> StopCondition:
    """Return the condition that a text says.

    Args:
        text: in the language above; its own words in any case.

    Raises BadRequest: the text is not in that language, too long, or nested too deep.

    >>> str(parse_condition("(node >= 80% AND steps>=1e3) || reached(Planner.idle)"))
    'node>=80% and steps>=1000 or reached(Planner.idle)'
    """
    reader = TokenReader(text, "stop condition", "edge>=100% or steps>=1e6 or 30 s")
    condition = joined(reader, _leaf)
    if reader.here:
        reader.fail("'and', 'or' or the end must follow a condition")
    return condition


def joined(reader: TokenReader, leaf: Callable[[TokenReader], StopCondition], depth: int = 0) -> StopCondition:
    """Return what 'or', 'and' and parentheses make of the conditions that `leaf` reads."""

    def one() -> StopCondition:
        if not reader.take("("):
            return leaf(reader)
        if depth >= MAX_DEPTH:
            reader.fail(f"parentheses must be nested at most {MAX_DEPTH} deep")
        inner = joined(reader, leaf, depth + 1)
        reader.need(")", "what a '(' opens")
        return inner

    def chain(kind: Literal["and", "or"], sign: str, part: Callable[[], StopCondition]) -> StopCondition:
        parts = [part()]
        while reader.take(kind, sign):
            parts.append(part())
        return parts[0] if len(parts) == 1 else StopCondition(kind, parts=tuple(parts))

    return chain("or", "||", lambda: chain("and", "&&", one))


def _leaf(reader: TokenReader) -> StopCondition:
    token = reader.here
    if token is not None and token.kind == "number":
        amount, unit = reader.number(), reader.take(*UNITS)
        if not unit:
            reader.fail(f"a time must have a unit, {', '.join(UNITS)}")
        return StopCondition("elapsed", amount=amount * UNITS[unit])
    word = reader.kind("word", "quoted")
    match word.lower():
        case "":
            return reader.fail("a condition must stand here")
        case "never":
            return StopCondition("never")
        case "reached" | "taken" as kind:
            return StopCondition(kind, reader.argument(word))
        case "steps" | "restarts" as kind:
            reader.need(">=", f"'{word}'")
            return StopCondition(kind, amount=reader.number())
    reader.need(">=", f"'{word}'")
    share = reader.number()
    reader.need("%", "the share of a criterion")
    return StopCondition("covered", word, reader.percent(share))
