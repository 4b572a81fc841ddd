"""Draws how samples are distributed: Fig. 5c of Abdelgawad et al. for several series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from parcours.report.drawing import INK, MUTED, PAPER, SERIES, bad_data, canvas, percent, require_data, svg_of
from parcours.report.pieces import Figure, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
        series: name -> values in the unit of `axis`, any shape; NaN is left out.
        edges: ends of the bins, increasing, shape (n_bins + 1,); values beyond count in the outermost bins.
        axis: what the values are, with unit.
        quantiles: name -> (share, value) pairs of a series of which no more is known, drawn as marks.

    Raises:
        BadRequest: there is no series, or the edges are too few or do not increase.
    """
    quantiles = quantiles or {}
    require_data(title, edges, {**series, **quantiles})
    bins = np.asarray(edges, dtype=np.float64)
    if len(bins) < 2 or not (np.diff(bins) > 0.0).all():
        raise bad_data(title, f"bin edges must increase, at least two, but are {list(edges)}")
    words = []
    rows = len(series) + len(quantiles)
    with canvas(0.5 + 1.05 * rows, rows, same_heights=True) as (figure, panels):
        for k, (name, values) in enumerate(series.items()):
            known = _known(values)
            # Values beyond the edges count in the outermost bins, so that the shares of a series add up to 1.
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
                words.append(f"{name}: {known.size} values, median {median:.3g}, largest {known.max():.3g}")
            else:
                words.append(f"{name}: no values")
        for panel, (name, marks) in zip(panels[len(series) :], quantiles.items(), strict=True):
            _ruler(panel, marks)
            panel.set_title(f"{name}: share of values at most as large", loc="left", color=INK)
            words.append(f"{name}: " + ", ".join(f"{share:.0%} at most {value:g}" for share, value in marks))
        panels[-1].set_xlim(bins[0], bins[-1])
        panels[-1].set_xlabel(axis)
        svg = svg_of(figure)
    return Figure(title, svg, f"{axis}. " + "; ".join(words), note)


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
            xytext=(0, -9 if k % 2 else 9), ha="center", va="top" if k % 2 else "bottom", fontsize=8.5, color=MUTED,
        )  # fmt: skip
    panel.tick_params(axis="y", labelleft=False)
    panel.grid(visible=False)
    panel.spines["left"].set_visible(False)
