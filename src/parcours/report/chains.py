"""Draws the reaction times along chains of channels as waterfalls, and lists the share of each component."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from parcours.report.drawing import INK, MUTED, SERIES, bad_data, canvas, set_rows, svg_of
from parcours.report.pieces import Column, Figure, Floats, Table
from parcours.verdict.timing import NEVER, Chain, quantile_interval

_KINDS = ((0.5, "typical (p50)", SERIES[3], -0.18), (0.99, "rare (p99)", SERIES[0], 0.18))
"""Which reactions are drawn: their share in all, what they are called, their colour, and where in a row."""


def waterfall(title: str, chain: Chain, limits: Sequence[int] = ()) -> Figure:
    """Return one row a step, each bar beginning where the one before has ended, and a row for the whole.

    Two reactions that occurred are drawn, so that their shares add up: the one of median length, and that at p99.

    Args:
        title: what is shown.
        chain: with at least one reaction.
        limits: on the whole [ns].

    Raises:
        BadRequest: there is no reaction.
    """
    if not chain.rows:
        raise bad_data(title, f"it must have at least one reaction, but {chain.name} has none")
    drawn = [(name, reaction_at(chain, share) * 1e-6, colour, place) for share, name, colour, place in _KINDS]
    names = [*chain.steps, "whole"]
    words = [
        f"{name} {row.sum():.3g} ms: " + ", ".join(f"{s} {t:.3g} ms" for s, t in zip(chain.steps, row, strict=True))
        for name, row, _, _ in drawn
    ]
    with canvas(0.9 + 0.42 * len(names)) as (figure, (panel,)):
        for name, row, colour, place in drawn:
            ends = np.cumsum(row)
            heights = np.arange(len(names)) + place
            begins = np.append(ends - row, 0.0)
            panel.barh(heights, [*row, ends[-1]], 0.32, begins, color=colour, label=name)
            for k, end in enumerate(ends[:-1]):
                panel.vlines(end, heights[k], heights[k + 1], color=colour, linewidth=0.8)
            for k, (begin, time) in enumerate(zip(begins, [*row, ends[-1]], strict=True)):
                panel.annotate(f"{time:.3g}", (begin + time, heights[k]), xytext=(4, 0), va="center",
                               textcoords="offset points", color=INK, fontsize=8.5)  # fmt: skip
        for limit in limits:
            panel.axvline(limit * 1e-6, color=MUTED, linewidth=1.0, linestyle="--")
        set_rows(panel, names)
        panel.grid(visible=False, axis="y")
        panel.margins(x=0.08)
        panel.set_xlim(left=0.0)
        panel.set_xlabel(f"time since the message was received [ms, {chain.clock} clock]")
        figure.legend(loc="outside upper left", ncols=2)
        svg = svg_of(figure)
    said = f"; limit {', '.join(f'{limit * 1e-6:g} ms' for limit in limits)}" if limits else ""
    return Figure(title, svg, f"{chain.name}: {'. '.join(words)}{said}")


def reaction_at(chain: Chain, quantile: float) -> Floats:
    """Return the shares of the reaction whose length is a quantile of all [ns]; of equal ones the first."""
    order = np.argsort(chain.totals, kind="stable")
    rank = int(np.ceil(quantile * len(order) - 1e-9))
    return np.array(chain.rows[order[max(rank, 1) - 1]], float)


def chain_table(title: str, chain: Chain) -> Table:
    """Return one row a step and one for the whole: quantiles, the interval of p99, and the share in all time.

    A bound of p99 that too few repeats give is not known; repeats that depend on each other count as fewer.
    """
    columns = (Column("step"), *(Column(name, ".3f", unit="ms") for name in ("p50", "p99")),
               *(Column(name, ".3f", unit="ms", group="p99, each with 95 %") for name in ("at least", "at most")),
               Column("counted as", ",d"), Column("share", ".1%"))  # fmt: skip
    times = np.array(chain.rows, np.int64)
    whole = int(times.sum())
    rows = []
    for name, taken in [*zip(chain.steps, times.T, strict=True), ("whole", times.sum(axis=1))]:
        p50, p99 = np.quantile(taken, (0.5, 0.99), method="inverted_cdf")
        low, high, spell = quantile_interval(taken)
        rows.append((name, p50 * 1e-6, p99 * 1e-6, low * 1e-6 if low else None, None if high == NEVER else high * 1e-6,
                     max(1, int(len(taken) / spell)), taken.sum() / whole if whole else None))  # fmt: skip
    return Table(title, columns, tuple(rows))
