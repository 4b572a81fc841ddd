"""A bound on durations in words, `p99 < 20 ms over 300 repeats`, becomes a checked value and back.

    bound      = statistic ("<" | "<=") number unit
                 ["over" count "repeats"] ["in spells of" count] ["with" number "%" "confidence"]
    statistic  = "every" | "p" number                    a hard bound, or one on a quantile
    unit       = "ns" | "us" | "ms" | "s"

There is no `mean`, which a few quick repeats buy back from every deadline missed, and which no interval without
assumptions on the tail bounds; and no `max`, whose value grows with the number of repeats: `every` says it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

from parcours.errors import BadRequest

CONFIDENCE = 95.0
"""Confidence where none is given [%]."""

LONGEST = 10**15
"""No limit is above this [ns]: some eleven days."""

_UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
_NUMBER = r"[0-9]{1,16}(?:\.[0-9]{1,12})?"
_BOUND = re.compile(
    rf"(?P<statistic>every|p(?P<percent>{_NUMBER}))\s*(?P<relation><=?)\s*(?P<limit>{_NUMBER})\s*(?P<unit>[nuµμm]?s)"
    rf"(?:\s+over\s+(?P<repeats>[0-9]{{1,9}})\s+repeats?)?"
    r"(?:\s+in\s+spells\s+of\s+(?P<spell>[0-9]{1,9}))?"
    rf"(?:\s+with\s+(?P<confidence>{_NUMBER})\s*%\s+confidence)?"
)


@dataclass(frozen=True, slots=True)
class Bound:
    """An upper bound on the durations of an interaction.

    Attributes:
        limit: [ns], above 0, at most `LONGEST`.
        percent: which quantile is bounded [%], between 0 and 100; None if every single duration is.
        strict: whether a duration equal to the limit misses it.
        repeats: the least number of repeats that a pass needs; 0 if none is set.
        confidence: that a pass, and that a fail, is right [%], between 50 and 100.
        spell: how many repeats in a row may be slow together, so that they count as one; at least 1.

    Raises:
        BadRequest: a number is out of its range.

    >>> print(Bound(20_000_000, 99.0, repeats=300))
    p99 < 20 ms over 300 repeats
    """

    limit: int
    percent: float | None = None
    strict: bool = True
    repeats: int = 0
    confidence: float = CONFIDENCE
    spell: int = 1

    def __post_init__(self) -> None:
        self._require(1 <= self.limit <= LONGEST, f"the limit is at least 1 ns and at most 1e15 ns, but {self.limit}")
        self._require(self.repeats >= 0, f"at least 0 repeats are asked for, but {self.repeats}")
        self._require(self.spell >= 1, f"a spell is at least 1 repeat, but {self.spell}")
        if self.percent is not None:
            rule = f"a quantile lies above 0 % and below 100 %, but {self.percent:.12g} %"
            self._require(0.0 < self.percent < 100.0, rule, "write `every` to bound all durations")
        rule = f"a confidence is at least 50 % and below 100 %, but {self.confidence:.12g} %"
        self._require(50.0 <= self.confidence < 100.0, rule)

    def _require(self, holds: bool, rule: str, remedy: str = "") -> None:
        if not holds:
            raise BadRequest("timing bound", f"{rule} given", remedy, slug="timing-bound-range")

    @property
    def hard(self) -> bool:
        """Whether every single duration is bounded."""
        return self.percent is None

    @property
    def quantile(self) -> float:
        """The share of durations that must stay within the limit; 1 for `every`."""
        return 1.0 if self.percent is None else _share(self.percent)

    @property
    def error(self) -> float:
        """The greatest probability of a wrong pass, and of a wrong fail: 1 - confidence."""
        return _share(100.0, self.confidence)

    @property
    def last(self) -> int:
        """The longest duration within the limit [ns]."""
        return self.limit - 1 if self.strict else self.limit

    def __str__(self) -> str:
        statistic = "every" if self.percent is None else f"p{_plain(self.percent)}"
        over = f" over {self.repeats} repeat{'s' if self.repeats > 1 else ''}" if self.repeats else ""
        sure = f" with {_plain(self.confidence)} % confidence" if self.confidence != CONFIDENCE else ""
        spells = f" in spells of {self.spell}" if self.spell > 1 else ""
        return f"{statistic} {'<' if self.strict else '<='} {amount(self.limit)}{over}{spells}{sure}"


def parse_bound(text: str) -> Bound:
    """Return the bound that a text says; `str` of it says the same again.

    Raises:
        BadRequest: the text is no bound, names another statistic, or a number out of its range.

    >>> parse_bound("p99.9<=1.5ms with 99 % confidence")
    Bound(limit=1500000, percent=99.9, strict=False, repeats=0, confidence=99.0, spell=1)
    >>> parse_bound("mean < 20 ms")
    Traceback (most recent call last):
    parcours.errors.BadRequest: timing bound 'mean < 20 ms': it bounds `every` duration or a quantile such as `p99`, \
but 'mean' was given; a mean hides missed deadlines: write `p50 < ...` for the typical, `p99 < ...` for the rare one \
[timing-bound-statistic]
    """
    shown = text if len(text) <= 80 else text[:77] + "..."
    match = _BOUND.fullmatch(text.strip())
    if match is None:
        raise _misread(shown)
    unit = "us" if match["unit"] in ("µs", "μs") else match["unit"]
    limit = Decimal(match["limit"]) * _UNITS[unit]
    if limit != int(limit):
        rule = f"a limit is a whole number of nanoseconds, but {match['limit']} {unit} was given"
        raise BadRequest(f"timing bound {shown!r}", rule, slug="timing-bound-range")
    repeats = match["repeats"]
    if repeats is not None and int(repeats) == 0:
        rule = "it is over at least 1 repeat, but 0 given"
        raise BadRequest(f"timing bound {shown!r}", rule, "leave `over` out if any number will do",
                         slug="timing-bound-range")  # fmt: skip
    return Bound(
        int(limit),
        float(match["percent"]) if match["percent"] is not None else None,
        match["relation"] == "<",
        int(repeats or 0),
        float(match["confidence"] or CONFIDENCE),
        int(match["spell"] if match["spell"] is not None else 1),
    )


def _misread(text: str) -> BadRequest:
    word = re.match(r"\s*([^\W\d_]+)", text)
    remedies = {
        "mean": "a mean hides missed deadlines: write `p50 < ...` for the typical, `p99 < ...` for the rare one",
        "average": "an average hides missed deadlines: write `p50 < ...` for the typical, `p99 < ...` for the rare one",
        "max": "the greatest of n durations grows with n: write `every < ...`",
        "median": "write `p50 < ...`",
        "min": "a least duration is no deadline: leave it out",
    }
    if word is not None and word[1] in remedies:
        rule = f"it bounds `every` duration or a quantile such as `p99`, but {word[1]!r} was given"
        return BadRequest(f"timing bound {text!r}", rule, remedies[word[1]], slug="timing-bound-statistic")
    return BadRequest(
        f"timing bound {text!r}",
        "it reads STATISTIC < LIMIT UNIT [over N repeats] [in spells of K] [with C % confidence], but this does not",
        "write for example `every < 20 ms` or `p99 <= 5 ms over 300 repeats`; units are ns, us, ms, s",
        slug="timing-bound",
    )


def amount(time: int) -> str:
    """Return a time in the largest unit that leaves its number at 1 or more, with all its digits.

    Args:
        time: [ns].

    >>> amount(20_000_000), amount(1_500), amount(999)
    ('20 ms', '1.5 us', '999 ns')
    """
    unit, factor = next(((u, f) for u, f in reversed(_UNITS.items()) if time >= f), ("ns", 1))
    return f"{_decimal(Decimal(time) / factor)} {unit}"


def _plain(number: float) -> str:
    return _decimal(Decimal(repr(number)))


def _decimal(number: Decimal) -> str:
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _share(percent: float, less: float = 0.0) -> float:
    """(percent - less) / 100, rounded once: 100 - 95 % is 0.05 and 99.9 % is 0.999."""
    return float((Fraction(repr(percent)) - Fraction(repr(less))) / 100)
