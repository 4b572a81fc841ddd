"""What became of requirements in campaigns, counted and drawn: how often violated, by how much at worst, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Cell, Column, Table
from parcours.verdict.statistics import wilson
from parcours_navigation.requirements.judging import holds, robustness
from parcours_navigation.requirements.requirement import Requirements


@dataclass(frozen=True, slots=True)
class Violations:
    """One requirement, or one pass rule, over the cases of a campaign that were judged."""

    name: str  # of a requirement; `fail` for a pass rule
    text: str
    n: int  # cases in which it was judged
    violated: int  # of these, cases that it fails
    unit: str = "1"  # of robustness
    worst: float | None = None  # least robustness; None without any case, and of a pass rule
    case: int | None = None  # number of the worst case, or of the first that a pass rule fails
    median: float | None = None  # robustness

    def document(self) -> dict[str, object]:
        """Return it as JSON values; an infinite robustness is None."""
        plain = asdict(self)
        for name in ("worst", "median"):
            if plain[name] is not None and not np.isfinite(plain[name]):
                plain[name] = None
        rate = wilson(self.violated, self.n) if self.n else None
        return plain | {"interval": [rate.low, rate.high] if rate else None}


def violations_of(facts: NDArray[np.void], requirements: Requirements) -> tuple[Violations, ...]:
    """Return what became of each requirement and pass rule; not of cases in error."""
    found = []
    values, numbers = robustness(facts, requirements), facts["number"]
    for k, one in enumerate(requirements.formulas):
        judged = ~np.isnan(values[:, k])
        known, violated = values[judged, k], int((values[judged, k] < 0.0).sum())
        if not len(known):
            found.append(Violations(one.name, one.text, 0, 0, one.unit))
            continue
        worst = int(np.argmin(known))
        middle = float(np.sort(known)[(len(known) - 1) // 2])
        found.append(
            Violations(
                one.name, one.text, len(known), violated, one.unit, float(known[worst]), int(numbers[judged][worst]),
                middle,
            )
        )  # fmt: skip
    for rule in requirements.rules:
        judged = facts["error"] == 0
        yes = holds(rule.formula, facts) & judged
        first = int(numbers[yes][0]) if yes.any() else None
        found.append(Violations("fail", rule.text, int(judged.sum()), int(yes.sum()), case=first))
    return tuple(found)


def requirement_table(campaigns: Mapping[str, Sequence[Violations]]) -> Table | None:
    """Return one row a requirement and campaign; None if nothing is required."""
    rows: list[tuple[Cell, ...]] = []
    for name, every in campaigns.items():
        for one in every:
            rate = wilson(one.violated, one.n) if one.n else None
            share = f"{rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}]" if rate else None
            rows.append((name, one.name, one.text, one.n, share, _amount(one.worst, one.unit), one.case,
                         _amount(one.median, one.unit)))  # fmt: skip
    if not rows:
        return None
    heads = ("campaign", "requirement", "formula", "cases", "violated", "worst", "worst case", "median")
    note = (
        "Cases that violate a requirement, or meet a pass rule, with Wilson 95 % intervals; the least robustness and "
        "its case (of a pass rule the first); the median. Cases that the planner's own error ended are left out."
    )
    return Table("Requirements", tuple(map(Column, heads)), tuple(rows), note)


def _amount(value: float | None, unit: str) -> str | None:
    if value is None:
        return None
    return f"{value:.4g}" if unit == "1" or not np.isfinite(value) else f"{value:.4g} {unit}"
