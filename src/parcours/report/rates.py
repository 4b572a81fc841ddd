"""Counts and rates -> charts: rates with intervals, shares of a whole, coverage of items.

Fig. 5b of Abdelgawad et al. is `shares`, drawn so that several series compare. Each chart says its numbers in
words too (`alt`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from parcours.report.drawing import (
    INK,
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
    svg_of,
)
from parcours.report.pieces import Figure, Floats, Tone

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Interval(Protocol):
    """A share in [0, 1] with its interval; verdict.statistics.Rate is one."""

    @property
    def share(self) -> float:
        """The observed rate; NaN when unknown."""

    @property
    def low(self) -> float:
        """Lower end of the interval."""

    @property
    def high(self) -> float:
        """Upper end of the interval."""


def intervals(
    title: str, groups: Sequence[str], series: Mapping[str, Sequence[Interval | None]], axis: str, note: str = ""
) -> Figure:
    """Return rates as dots with bars for their intervals, one row a group, one colour and marker a series.

    Args:
        title: what the chart shows.
        groups: names of the rows, top to bottom.
        series: name -> one rate a group; None where there is none.
        axis: what the rates count.
        note: small print below it.

    Raises:
        BadRequest: there is no group or no series, or a series has not one rate a group.
    """
    require_data(title, groups, series)
    require_same_length(title, groups, series)
    spread = 0.62 / max(len(series) - 1, 1) if len(series) > 1 else 0.0
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
        panel.set_yticks(range(len(groups)), groups)
        panel.set_ylim(len(groups) - 0.5, -0.5)
        panel.set_xlim(left=0.0)
        panel.grid(visible=False, axis="y")
        panel.xaxis.set_major_formatter(percent)
        panel.set_xlabel(axis)
        figure.legend(loc="outside upper left", ncols=len(series), handletextpad=0.3, columnspacing=1.6)
        svg = svg_of(figure)
    told = (
        f"{group}: " + ", ".join(_told(name, rates[row]) for name, rates in series.items())
        for row, group in enumerate(groups)
    )
    return Figure(title, svg, f"{axis}. " + "; ".join(told), note)


def shares(
    title: str, slices: Sequence[str], series: Mapping[str, Sequence[float]], tones: Sequence[Tone], note: str = ""
) -> Figure:
    """Return how each series divides into slices, as stacked bars of 100 % each (Fig. 5b, made comparable).

    Args:
        title: what the chart shows.
        slices: names, left to right.
        series: name -> counts or shares, one a slice; each is divided by its sum.
        tones: how welcome each slice is.
        note: small print below it.

    Raises:
        BadRequest: there is nothing to show, lengths disagree, or a count is negative or not finite.
    """
    require_data(title, slices, series)
    require_same_length(title, slices, {**series, "tones": tones})
    parts = {name: _normalised(title, name, counts) for name, counts in series.items()}
    with canvas(0.75 + 0.42 * len(series)) as (figure, (panel,)):
        for k, name in enumerate(slices):
            colour = TONES[tones[k]]
            left = np.array([part[:k].sum() for part in parts.values()])
            width = np.array([part[k] for part in parts.values()])
            panel.barh(
                range(len(parts)), width, left=left, height=0.68, color=colour, label=name,
                edgecolor=PAPER, linewidth=1.0,
            )  # fmt: skip
            for row in (int(i) for i in np.flatnonzero(width >= 0.035)):
                panel.text(
                    left[row] + width[row] / 2, row, f"{width[row]:.1%}", ha="center", va="center",
                    color=label_ink(colour), fontsize=8.5 if width[row] >= 0.06 else 7.0,
                )  # fmt: skip
        panel.set_yticks(range(len(parts)), list(parts))
        panel.set_ylim(len(parts) - 0.5, -0.5)
        panel.set_xlim(0.0, 1.0)
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)
        panel.set_xticks([])
        figure.legend(loc="outside upper left", ncols=min(len(slices), 4), handlelength=1.0, handleheight=1.0)
        svg = svg_of(figure)
    told = (
        f"{name}: " + ", ".join(f"{share:.1%} {what}" for share, what in zip(part, slices, strict=True))
        for name, part in parts.items()
    )
    return Figure(title, svg, "; ".join(told), note)


def coverage(title: str, groups: Mapping[str, Mapping[str, int]], note: str = "") -> Figure:
    """Return which items of each group were met, as a row of named tiles: filled where met, hollow where not.

    Args:
        title: what the chart shows.
        groups: name -> item -> how often it was met; more than 16 items in a group are drawn as one bar.
        note: small print below it.

    Raises:
        BadRequest: there is no group, a group has no item, or a count is negative.
    """
    require_data(title, list(groups), groups)
    told = []
    with canvas(0.3 + 0.36 * len(groups)) as (figure, (panel,)):
        for row, (name, items) in enumerate(groups.items()):
            if not items or min(items.values()) < 0:
                raise bad_data(title, f"group {name!r} must have items and no negative counts")
            met = sum(count > 0 for count in items.values())
            missing = [item for item, count in items.items() if not count]
            told.append(f"{name}: {met} of {len(items)} met" + (f", not {', '.join(missing)}" if missing else ""))
            if len(items) <= MAX_TILES:
                _tiles(panel, row, items)
            else:
                width = MAX_TILES - 0.08
                panel.barh(row, width, height=0.7, left=0.04, facecolor="none", edgecolor=SERIES[0], linewidth=1.0)
                panel.barh(row, width * met / len(items), height=0.7, left=0.04, color=TONES["good"])
            panel.text(
                -0.15,
                row,
                f"{met} of {len(items)}",
                ha="right",
                va="center",
                color=INK if met == len(items) else SERIES[0],
            )
        widest = max(min(len(items), MAX_TILES) for items in groups.values())
        panel.set_xlim(-1.5, max(widest, 9))
        panel.set_ylim(len(groups) - 0.5, -0.5)
        panel.set_yticks(range(len(groups)), list(groups))
        panel.set_xticks([])
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)
        svg = svg_of(figure)
    return Figure(title, svg, "; ".join(told), note)


MAX_TILES = 16
"""Most items of a group that are drawn one by one."""


def _tiles(panel: Axes, row: int, items: Mapping[str, int]) -> None:
    """Draw one tile an item; those not met are hollow."""
    for at, (item, count) in enumerate(items.items()):
        panel.barh(
            row, 0.92, height=0.7, left=at + 0.04, linewidth=1.0,
            facecolor=TONES["good"] if count else "none", edgecolor=TONES["good"] if count else SERIES[0],
        )  # fmt: skip
        panel.text(at + 0.5, row, item, ha="center", va="center", fontsize=7.5, color="#ffffff" if count else SERIES[0])


def _normalised(title: str, name: str, counts: Sequence[float]) -> Floats:
    """Return the counts divided by their sum; all zero if the sum is."""
    part = np.asarray(counts, dtype=np.float64)
    if not (np.isfinite(part).all() and (part >= 0.0).all()):
        raise bad_data(title, f"counts must be finite and not negative, but {name!r} has {list(counts)}")
    total = float(part.sum())
    return part / total if total else part


def _told(name: str, rate: Interval | None) -> str:
    if rate is None or math.isnan(rate.share):
        return f"{name} not known"
    return f"{name} {rate.share:.1%} ({rate.low:.1%} to {rate.high:.1%})"
