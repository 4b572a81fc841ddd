"""Draws contenders on the same cases: who arrives when, and who beats whom."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from parcours.report.drawing import (
    INK,
    SERIES,
    TONES,
    bad_data,
    canvas,
    label_ink,
    percent,
    require_data,
    set_rows,
    svg_of,
)
from parcours.report.pieces import Figure, Floats

_LINES = ("-", "--", ":", "-.")


def arrivals(title: str, series: Mapping[str, ArrayLike], axis: str, note: str = "") -> Figure:
    """Return the share of all cases that have a value at most as large as any given one, a step line a series.

    A case without a value never counts, so a line ends at the share of cases that have one: who arrives seldom cannot
    look fast.

    Args:
        series: name -> one value per case in the unit of `axis`, NaN where it has none, shape (n_cases,).
        axis: what the values are, with unit.

    Raises:
        BadRequest: there is no series.
    """
    require_data(title, list(series), series)
    words = []
    with canvas(2.9) as (figure, (panel,)):
        for k, (name, values) in enumerate(series.items()):
            cases = np.asarray(values, dtype=np.float64).ravel()
            known = np.sort(cases[np.isfinite(cases)])
            share = np.arange(len(known) + 1) / max(len(cases), 1)
            panel.step(
                np.concatenate([known[:1], known]), share[: max(len(known) + 1, 1)] if known.size else [],
                where="post", color=SERIES[k % len(SERIES)], linewidth=1.8,
                linestyle=_LINES[k // len(SERIES) % len(_LINES)], label=f"{name} ({known.size} of {len(cases)})",
            )  # fmt: skip
            middle = f", median of these {np.median(known):.3g}" if known.size else ""
            words.append(f"{name}: {known.size} of {len(cases)} cases{middle}")
        panel.set_ylim(0.0, 1.02)
        panel.margins(x=0.01)
        panel.yaxis.set_major_formatter(percent)
        panel.set_xlabel(axis)
        figure.legend(loc="outside upper left", ncols=3)
        svg = svg_of(figure)
    return Figure(title, svg, f"{axis}. " + "; ".join(words), note)


def dominance(title: str, names: Sequence[str], beats: ArrayLike, note: str = "") -> Figure:
    """Return a square of tiles: in how many of the cases the one of the row does better than the one of the column.

    Args:
        names: of the contenders.
        beats: shares in [0, 1], shape (n, n); the diagonal is not shown.

    Raises:
        BadRequest: there are no names, or the shares are not one a pair, or not in [0, 1].
    """
    shares: Floats = np.asarray(beats, dtype=np.float64)
    require_data(title, names, {"shares": shares})
    n = len(names)
    if shares.shape != (n, n) or not ((shares >= 0.0) & (shares <= 1.0)).all():
        raise bad_data(title, f"one share in [0, 1] a pair is needed, shape {(n, n)}, but shape {shares.shape} given")
    words = []
    largest = max(float((shares - np.diag(np.diag(shares))).max(initial=0.0)), 1e-9)
    with canvas(0.9 + 0.4 * n) as (figure, (panel,)):
        for row in range(n):
            for column in range(n):
                if row == column:
                    continue
                share = float(shares[row, column])
                colour = _tint(share / largest)
                panel.barh(row, 0.94, height=0.88, left=column - 0.47, color=colour, linewidth=0)
                panel.text(column, row, f"{share:.1%}", ha="center", va="center", color=label_ink(colour), fontsize=8.5)
                words.append(f"{names[row]} over {names[column]} {share:.1%}")
        panel.set_xticks(range(n), [_short(name) for name in names], color=INK)
        set_rows(panel, names)
        panel.xaxis.tick_top()
        panel.set_xlim(-0.5, n - 0.5)
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)
        svg = svg_of(figure)
    return Figure(title, svg, "; ".join(words) or "one contender only", note)


def _tint(share: float) -> str:
    """Return the colour of a share of the largest: from nearly white to the tone of what is welcome."""
    low = (0xE6, 0xF0, 0xF7)
    high = tuple(int(TONES["good"][k : k + 2], 16) for k in (1, 3, 5))
    part = 0.0 if math.isnan(share) else min(max(share, 0.0), 1.0)
    return "#" + "".join(f"{round(a + part * (b - a)):02x}" for a, b in zip(low, high, strict=True))


def _short(name: str) -> str:
    """Return a name that fits above a tile."""
    return name if len(name) <= 16 else "…" + name[-15:]
