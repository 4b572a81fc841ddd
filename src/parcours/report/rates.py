"""Draws rates with their intervals, and shares of a whole: Fig. 5b of Abdelgawad et al. for several series."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from parcours.report.drawing import (
    MARKERS,
    PAPER,
    RULE,
    SERIES,
    TONES,
    bad_data,
    canvas,
    label_ink,
    percent,
    require_data,
    require_same_length,
    set_rows,
    svg_of,
)
from parcours.report.pieces import Figure, Floats, Tone
from parcours.verdict.statistics import Rate


def intervals(
    title: str, groups: Sequence[str], series: Mapping[str, Sequence[Rate | None]], axis: str, note: str = ""
) -> Figure:
    """Return rates as dots with bars for their intervals, one row a group, one colour and marker a series.

    Args:
        groups: names of the rows, top to bottom.
        series: name -> one rate a group; None where there is none.
        axis: what the rates count.

    Raises:
        BadRequest: there is no group or no series, or a series has not one rate a group.
    """
    require_data(title, groups, series)
    require_same_length(title, groups, series)
    spread = 0.62 / max(len(series) - 1, 1) if len(series) > 1 else 0.0

    def draw() -> str:
        with canvas(0.75 + 0.145 * len(groups) * (len(series) + 1)) as (figure, (panel,)):
            for k, (name, rates) in enumerate(series.items()):
                offset = spread * (k - (len(series) - 1) / 2)
                known = [(row + offset, rate) for row, rate in enumerate(rates) if rate and not math.isnan(rate.share)]
                y = [place for place, _ in known]
                colour = SERIES[k % len(SERIES)]
                panel.hlines(y, [r.low for _, r in known], [r.high for _, r in known], color=colour, linewidth=1.6)
                panel.plot(
                    [r.share for _, r in known], y, MARKERS[k % len(MARKERS)], color=colour, markersize=5.5,
                    markeredgecolor=PAPER, markeredgewidth=0.7, label=name, clip_on=False, zorder=3,
                )  # fmt: skip
            for row in range(1, len(groups)):
                panel.axhline(row - 0.5, color=RULE, linewidth=0.7)
            set_rows(panel, groups)
            panel.set_xlim(left=0.0)
            panel.grid(visible=False, axis="y")
            panel.xaxis.set_major_formatter(percent)
            panel.set_xlabel(axis)
            figure.legend(loc="outside upper left", ncols=len(series), handletextpad=0.3, columnspacing=1.6)
            return svg_of(figure)

    words = (
        f"{group}: " + ", ".join(_in_words(name, rates[row]) for name, rates in series.items())
        for row, group in enumerate(groups)
    )
    return Figure(title, draw, f"{axis}. " + "; ".join(words), note)


def shares(
    title: str, slices: Sequence[str], series: Mapping[str, Sequence[float]], tones: Sequence[Tone], note: str = ""
) -> Figure:
    """Return how each series divides into slices, as stacked bars of 100 % each (Fig. 5b, made comparable).

    Args:
        slices: names, left to right.
        series: name -> counts or shares, one a slice; each is divided by its sum.
        tones: how welcome each slice is.

    Raises:
        BadRequest: there is nothing to show, lengths disagree, or a count is negative or not finite.
    """
    require_data(title, slices, series)
    require_same_length(title, slices, {**series, "tones": tones})
    parts = {name: _normalised(title, name, counts) for name, counts in series.items()}

    def draw() -> str:
        with canvas(0.75 + 0.42 * len(series)) as (figure, (panel,)):
            for k, name in enumerate(slices):
                colour = TONES[tones[k]]
                left = np.array([part[:k].sum() for part in parts.values()])
                width = np.array([part[k] for part in parts.values()])
                panel.barh(
                    range(len(parts)), width, left=left, height=0.68, color=colour, label=name,
                    edgecolor=PAPER, linewidth=1.0,
                )  # fmt: skip
                for row in (int(i) for i in np.flatnonzero(width >= 0.045)):
                    panel.text(
                        left[row] + width[row] / 2, row, f"{width[row]:.1%}", ha="center", va="center",
                        color=label_ink(colour), fontsize=8.5,
                    )  # fmt: skip
            set_rows(panel, list(parts))
            panel.set_xlim(0.0, 1.0)
            panel.grid(visible=False)
            panel.spines[:].set_visible(False)
            panel.set_xticks([])
            figure.legend(loc="outside upper left", ncols=min(len(slices), 4), handlelength=1.0, handleheight=1.0)
            return svg_of(figure)

    words = (
        f"{name}: " + ", ".join(f"{share:.1%} {what}" for share, what in zip(part, slices, strict=True))
        for name, part in parts.items()
    )
    return Figure(title, draw, "; ".join(words), note)


def _normalised(title: str, name: str, counts: Sequence[float]) -> Floats:
    """Return the counts divided by their sum; all zero if the sum is."""
    part = np.asarray(counts, dtype=np.float64)
    if not (np.isfinite(part).all() and (part >= 0.0).all()):
        raise bad_data(title, f"counts must be finite and not negative, but {name!r} has {list(counts)}")
    total = float(part.sum())
    return part / total if total else part


def _in_words(name: str, rate: Rate | None) -> str:
    if rate is None or math.isnan(rate.share):
        return f"{name} not known"
    return f"{name} {rate.share:.1%} ({rate.low:.1%} to {rate.high:.1%})"
