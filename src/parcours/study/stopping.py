"""Rules that end a campaign once it knows enough: `--until "stuck ± 0.5%"`, `--until "contacts < 1e-4"`.

    rule     = rate ("±" | "+-") number ["%"] [confidence]    the rate is known to so much on either side
             | rate ("<" | "<=" | ">" | ">=") number ["%"] [confidence]    whether that holds is known
             | "pairwise" "=" number "%"                             this share of the pairs of blocks was met; alone
    confidence = "with" number "% confidence"

They are asked at the borders of shards, in the order of shards, of intervals that hold at all times at once
(`parcours.verdict.sequential`): looking often costs no validity, and the case at which a campaign ends depends on the
campaign and the rules, never on the number of workers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, one_of
from parcours.run.store import Rows
from parcours.verdict.sequential import bounds_at_any_time, rate_at_any_time
from parcours.verdict.statistics import Rate


@dataclass(frozen=True, slots=True)
class Rates:
    """What cases count for the rates that rules may ask for."""

    # facts of cases -> what each of them counts for every rate, by name: 0 or 1, NaN where it is not known
    of: Callable[[Rows], Mapping[str, NDArray[np.float64]]]
    reads: Collection[str]  # the fields of the facts that it looks at


MOST_CASES = 1_000_000
"""Most cases of a campaign that ends by a rule, by default."""

_RULE = re.compile(
    r"\s*(?P<measure>[A-Za-z_]\w*(?:\s*\(\s*[A-Za-z_][\w.-]*\s*\))?)\s*(?P<relation>±|\+-|\+/-|<=|>=|<|>)"
    r"\s*(?P<limit>[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?)\s*(?P<percent>%)?"
    r"(?:\s+with\s+(?P<confidence>[0-9]+(?:\.[0-9]+)?)\s*%\s+confidence)?\s*"
)

_PAIRS = re.compile(r"\s*pairwise\s*(?:=|>=)\s*(?P<share>[0-9]+(?:\.[0-9]*)?)\s*%\s*")


def pairs_wanted(rules: Sequence[str]) -> float | None:
    """Return the share of pairs of blocks after which a campaign ends; None if its rules ask for none.

    Raises BadRequest: it stands beside other rules, or is not above 0 and at most 100 %.

    >>> pairs_wanted(["pairwise = 100%"]), pairs_wanted(["stuck ± 1%"])
    (1.0, None)
    """
    found = [match for match in map(_PAIRS.fullmatch, rules) if match is not None]
    if not found:
        return None
    share = float(found[0]["share"]) / 100.0
    if len(rules) > 1 or not 0.0 < share <= 1.0:
        rule = f"pairs of blocks are asked for alone, up to 100 %, but the rules are {', '.join(rules)}"
        raise BadRequest("--until", rule, 'write --until "pairwise = 100%"', slug="until-form")
    return share


@dataclass(frozen=True, slots=True)
class StoppingRule:
    """When enough is known of a rate.

    >>> rule = parse_rule("stuck +- 2%")
    >>> rule.is_met(rule.rate(70, 905)), rule.is_met(rule.rate(155, 2000))
    (False, True)
    >>> few = parse_rule("contacts < 1%")
    >>> few.is_met(few.rate(0, 905)), few.is_met(few.rate(3, 905)), few.is_met(few.rate(60, 905))
    (True, False, True)
    """

    text: str
    measure: str
    relation: str  # ±, <, <=, > or >=
    limit: float
    confidence: float = 0.95

    @property
    def concentration(self) -> float:
        """Of the mixture behind the intervals, which are tightest after some eight times as many cases.

        It follows from the rule alone, as nothing that was seen may decide it.
        """
        return max(1.0, 0.05 / self.limit**2 if self.relation == "±" else 0.5 / min(self.limit, 1.0 - self.limit))

    def rate(self, count: int, n: int) -> Rate:
        """Return what is known after `n` cases."""
        return rate_at_any_time(count, n, self.confidence, self.concentration)

    def is_met(self, rate: Rate) -> bool:
        """Return whether enough is known: of a comparison whether it holds, or that it does not."""
        if self.relation == "±":
            return 0.5 * (rate.high - rate.low) <= self.limit
        return rate.high < self.limit or rate.low > self.limit


def parse_rule(text: str) -> StoppingRule:
    """Return the rule of a text. Raises BadRequest if it is not one."""
    match = _RULE.fullmatch(text)
    if match is None:
        rule = f"must be a rate and how well it is to be known, but is {text!r}"
        raise BadRequest("--until", rule, 'write "stuck ± 0.5%" or "contacts < 1e-4"', slug="until-form")
    limit = float(match["limit"]) / (100.0 if match["percent"] else 1.0)
    confidence = float(match["confidence"]) / 100.0 if match["confidence"] else 0.95
    if not (0.0 < limit < 1.0 and 0.5 <= confidence < 1.0):
        rule = (
            "a rate is a share between 0 and 1, and a confidence from 50 % to below 100 %, "
            f"but {limit:g} and {100 * confidence:g} % are given"
        )
        raise BadRequest("--until", rule, 'write "stuck ± 0.5%" or "contacts < 1e-4"', slug="until-form")
    relation = match["relation"] if match["relation"][0] in "<>" else "±"
    return StoppingRule(text.strip(), "".join(match["measure"].split()), relation, limit, confidence)


class Watch:
    """Counts the rates of a campaign, shard by shard in their order, and says when its rules are met."""

    def __init__(self, rules: Sequence[StoppingRule], rates: Rates, no_rows: Rows, fields: Sequence[str] = ()) -> None:
        """Count nothing yet.

        Args:
            rules: that end the campaign; without any, all rates are counted.
            rates: what cases count.
            no_rows: facts of no case.
            fields: those of facts that it must be given; all if empty.

        Raises BadRequest: a rule asks for a rate that the cases do not have.
        """
        known = rates.of(no_rows)
        for rule in rules:
            if rule.measure not in known:
                wrong = f"it asks for {rule.measure!r}, which is no rate of these cases"
                raise BadRequest("--until", wrong, one_of(rule.measure, list(known)), slug="until-rate")
        self._rules, self._rates, self.fields = rules, rates, fields
        self._counts = dict.fromkeys([rule.measure for rule in rules] or ["failed", *known], (0, 0))

    def __call__(self, rows: Rows) -> str:
        """Count the cases of the next shard; return why that is enough, empty if it is not."""
        rates = self._rates.of(rows)
        for name, (count, n) in self._counts.items():
            values = rates[name][~np.isnan(rates[name])]
            self._counts[name] = count + int(values.sum()), n + len(values)
        found = [(rule, rule.rate(*self._counts[rule.measure])) for rule in self._rules]
        if not found or not all(rule.is_met(rate) for rule, rate in found):
            return ""
        return "; ".join(f"{rule.text}: {_said(rule.measure, rate)}" for rule, rate in found)

    @property
    def so_far(self) -> str:
        """What is known of the rates that rules ask for, or else of all above 0, in words; empty before any case."""
        if self._rules:
            found = ((rule.measure, self._counts[rule.measure], rule) for rule in self._rules)
            return ", ".join(_said(name, rule.rate(count, n)) for name, (count, n), rule in found if n)
        seen = {name: one for name, one in self._counts.items() if one[1] and (one[0] or name == "failed")}
        counts, sizes = np.array(list(seen.values()), float).reshape(-1, 2).T
        ends = zip(*bounds_at_any_time(counts, sizes), strict=True)
        rates = (
            Rate(*one, float(low), float(high), 0.95) for one, (low, high) in zip(seen.values(), ends, strict=True)
        )
        return ", ".join(map(_said, seen, rates))


def _said(name: str, rate: Rate) -> str:
    """Return a rate in words.

    >>> _said("stuck", rate_at_any_time(70, 905)), _said("contacts", Rate(0, 50_000, 0.0, 8.5e-5, 0.99))
    ('stuck 7.73 % [5.29, 10.7]', 'contacts 0 % [0, 0.0085] at 99 %')
    """
    share, low, high = (f"{100.0 * value:.3g}" for value in (rate.share, rate.low, rate.high))
    return f"{name} {share} % [{low}, {high}]" + (f" at {100 * rate.confidence:g} %" if rate.confidence != 0.95 else "")
