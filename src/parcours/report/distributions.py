"""Samples -> charts of how they are distributed: histograms, cumulative shares, durations against limits.

Fig. 5a and 5c of Abdelgawad et al. are `durations` and `histogram`, drawn so that several series compare.
Each chart says its numbers in words too (`alt`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from parcours.report.drawing import INK, MUTED, PAPER, SERIES, TONES, bad_data, canvas, percent, require_data, svg_of
from parcours.report.pieces import Figure, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas


def histogram(
    title: str,
    series: Mapping[str, ArrayLike],
    edges: Sequence[float],
    axis: str,
    quantiles: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    note: str = "",
) -> Figure:
    """Return one histogram a series above a common axis, in shares of the series, with its median (Fig. 5c).

    Args:
        title: what the chart shows.
        series: name -> values in the unit of `axis`, any shape; NaN is left out.
        edges: ends of the bins, increasing, shape (n_bins + 1,); values beyond count in the outermost bins.
        axis: what the values are, with unit.
        quantiles: name -> (share, value) pairs of a series of which no more is known, drawn as marks.
        note: small print below it.

    Raises:
        BadRequest: there is no series, or the edges are too few or do not increase.
    """
    quantiles = quantiles or {}
    require_data(title, edges, {**series, **quantiles})
    bins = np.asarray(edges, dtype=np.float64)
    if len(bins) < 2 or not (np.diff(bins) > 0.0).all():
        raise bad_data(title, f"bin edges must increase, at least two, but are {list(edges)}")
    told = []
    rows = len(series) + len(quantiles)
    with canvas(0.5 + 1.05 * rows, rows, same_heights=True) as (figure, panels):
        for k, (name, values) in enumerate(series.items()):
            known = _known(values)
            counts = np.histogram(np.clip(known, bins[0], bins[-1]), bins)[0] / max(known.size, 1)
            colour = SERIES[k % len(SERIES)]
            panels[k].bar(bins[:-1], counts, np.diff(bins), align="edge", color=colour, edgecolor=PAPER, linewidth=0.8)
            panels[k].yaxis.set_major_formatter(percent)
            panels[k].grid(visible=False, axis="x")
            middle = f", median {np.median(known):.3g}" if known.size else ""
            panels[k].set_title(f"{name}: {known.size} values{middle}", loc="left", color=INK)
            if known.size:
                median = float(np.median(known))
                panels[k].axvline(median, color=INK, linewidth=1.2)
                told.append(f"{name}: {known.size} values, median {median:.3g}, largest {known.max():.3g}")
            else:
                told.append(f"{name}: no values")
        for panel, (name, marks) in zip(panels[len(series) :], quantiles.items(), strict=True):
            _ruler(panel, marks)
            panel.set_title(f"{name}: share of values at most as large", loc="left", color=INK)
            told.append(f"{name}: " + ", ".join(f"{share:.0%} at most {value:g}" for share, value in marks))
        panels[-1].set_xlim(bins[0], bins[-1])
        panels[-1].set_xlabel(axis)
        svg = svg_of(figure)
    return Figure(title, svg, f"{axis}. " + "; ".join(told), note)


def cumulative(
    title: str,
    series: Mapping[str, ArrayLike],
    axis: str,
    quantiles: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    note: str = "",
) -> Figure:
    """Return the share of values at most as large as any given one, a step line a series.

    Args:
        title: what the chart shows.
        series: name -> values in the unit of `axis`, any shape; NaN is left out.
        axis: what the values are, with unit.
        quantiles: name -> (share, value) pairs of a series of which no more is known, drawn as dots.
        note: small print below it.

    Raises:
        BadRequest: there is no series.
    """
    quantiles = quantiles or {}
    require_data(title, [*series, *quantiles], {**series, **quantiles})
    told = []
    with canvas(2.7) as (figure, (panel,)):
        for k, (name, values) in enumerate(series.items()):
            known = np.sort(_known(values))
            panel.step(
                np.concatenate([known[:1], known]), np.linspace(0.0, 1.0, len(known) + 1), where="post",
                color=SERIES[k % len(SERIES)], linewidth=1.8, label=f"{name} (n = {known.size})",
            )  # fmt: skip
            told.append(
                f"{name}: median {np.median(known):.3g} of {known.size}" if known.size else f"{name}: no values"
            )
        for name, marks in quantiles.items():
            at = [value for _, value in marks]
            panel.plot(at, [share for share, _ in marks], "D", color=SERIES[2], label=name, markeredgecolor=PAPER)
            told.append(f"{name}: " + ", ".join(f"{share:.0%} at most {value:g}" for share, value in marks))
        panel.set_ylim(0.0, 1.02)
        panel.margins(x=0.01)
        panel.yaxis.set_major_formatter(percent)
        panel.set_xlabel(axis)
        figure.legend(loc="outside upper left", ncols=3)
        svg = svg_of(figure)
    return Figure(title, svg, f"{axis}. " + "; ".join(told), note)


def _known(values: ArrayLike) -> Floats:
    """Return the values that are numbers, flat."""
    flat: Floats = np.asarray(values, dtype=np.float64).ravel()
    return flat[~np.isnan(flat)]


def _ruler(panel: Axes, marks: Sequence[tuple[float, float]]) -> None:
    """Draw (share, value) marks on a line, labels above and below by turns to keep near ones legible."""
    line = panel.get_xaxis_transform()
    values = [value for _, value in marks]
    panel.plot(values, [0.5] * len(marks), "-|", color=SERIES[2], markersize=13, mew=1.6, transform=line)
    for k, (share, value) in enumerate(marks):
        panel.annotate(
            percent(share), (value, 0.5), xycoords=line, textcoords="offset points",
            xytext=(0, -9 if k % 2 else 9), ha="center", va="top" if k % 2 else "bottom", fontsize=8.0, color=MUTED,
        )  # fmt: skip
    panel.tick_params(axis="y", labelleft=False)
    panel.grid(visible=False)
    panel.spines["left"].set_visible(False)


def _legend_of_durations(figure: Canvas, *, limited: bool) -> None:
    """Say what the marks of `durations` mean."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys = [
        Line2D([], [], color=SERIES[1], marker="o", linestyle="", label="median"),
        Patch(color=SERIES[1], alpha=0.45, label="middle 90 %"),
        Line2D([], [], color=SERIES[1], linewidth=1.2, label="range"),
    ]
    if limited:
        keys.append(Patch(facecolor=TONES["poor"], alpha=0.35, edgecolor=SERIES[0], label="limits, lower to upper"))
    figure.legend(handles=keys, loc="outside upper left", ncols=4)
