"""Paired tests -> the table that says who beats whom, by how much, and how sure that is."""

from __future__ import annotations

import math

from parcours.report.pieces import Cell, Column, Marked, Table
from parcours_navigation.comparison.pairing import RateDifference
from parcours_navigation.comparison.results import PairTest, Results


def tests_table(results: Results, tests: tuple[PairTest, ...]) -> Table:
    """Return the tests of each planner against the first."""
    rows: list[tuple[Cell, ...]] = []
    for test in tests:
        row: tuple[Cell, ...] = (f"{test.second} against {test.first}", _WHAT[test.question], *_found(test))
        rows.append(
            (
                *row,
                p_text(test.p_value),
                Marked(p_text(test.p_holm), "neutral") if _clear(test) else p_text(test.p_holm),
            )
        )
    return Table(
        f"Tests on the same cases against {results.contenders[0].name}",
        (
            Column("pair"), Column("what", code=False), Column("cases"), Column("only it"), Column("only the first"),
            Column("difference"), Column("effect"), Column("p"), Column("p (Holm)"),
        ),
        tuple(rows),
        "Reached and contact: McNemar's exact test on the cases that only one of the two has; difference of the rates "
        "with Newcombe's 95 % interval; effect: odds ratio of those cases. Time: cases that both reach, Wilcoxon's "
        "signed-rank test (zeros by Pratt), median difference with its 95 % interval, effect: rank-biserial "
        f"correlation. Differences are the planner's minus the first's. Holm corrects for all {len(tests)} tests here; "
        "marked where below 0.05.",
    )  # fmt: skip


_WHAT = {"reached": "goal reached", "contact": "contact by the moving robot", "time": "time to goal"}


def _clear(test: PairTest) -> bool:
    return test.p_holm < 0.05


def _found(test: PairTest) -> tuple[Cell, ...]:
    """Return cases, discordant counts, difference and effect, seen from the second planner."""
    found = test.found
    if isinstance(found, RateDifference):
        pairs = found.pairs
        if math.isnan(found.difference):
            return pairs.n, None, None, None, None
        words = f"{_signed(-found.difference, '.1%')} [{_signed(-found.high, '.1%')}, {_signed(-found.low, '.1%')}]"
        return pairs.n, pairs.second_only, pairs.first_only, words, _ratio(pairs.second_only, pairs.first_only)
    if not found.n:
        return 0, None, None, None, None
    words = f"{_signed(-found.median, '.2f')} s [{_signed(-found.high, '.2f')}, {_signed(-found.low, '.2f')}]"
    return found.n, None, None, words, _signed(-found.rank_biserial, ".2f")


def _ratio(more: int, fewer: int) -> str | None:
    """Return the odds ratio of two discordant counts.

    >>> _ratio(3, 6), _ratio(3, 0), _ratio(0, 0)
    ('0.50', '∞', None)
    """
    if not fewer:
        return "∞" if more else None
    return f"{more / fewer:.2f}"


def _signed(value: float, form: str) -> str:
    """Return a number with its sign; nothing that rounds to zero is called negative.

    >>> _signed(-0.0001, ".2f"), _signed(-0.25, ".1%")
    ('+0.00', '−25.0%')
    """
    text = format(value, f"+{form}")
    if not any(digit in text for digit in "123456789") and math.isfinite(value):
        text = text.replace("-", "+")
    return text.replace("-", "\N{MINUS SIGN}")


def p_text(p_value: float) -> str:
    """Return a p-value as readers expect it.

    >>> p_text(0.0123), p_text(1e-9), p_text(1.0)
    ('0.0123', '<0.0001', '1.0000')
    """
    return "<0.0001" if p_value < 0.0001 else f"{p_value:.4f}"
