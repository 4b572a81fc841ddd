"""Draws rates over the settings of a dial: curves with bands for their intervals, in a grid of small panels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from textwrap import fill

from parcours.report.drawing import INK, MARKERS, PAPER, SERIES, bad_data, canvas, percent, require_data, svg_of
from parcours.report.pieces import Figure
from parcours.verdict.statistics import Rate

Curves = Mapping[str, Sequence[Rate]]
"""Name of a series -> one rate a setting."""

_LABEL = 20
"""Characters that fit beside a panel in one line."""


def curves(
    title: str, at: Sequence[float], panels: Mapping[str, Mapping[str, Curves]], axis: str, note: str = ""
) -> Figure:
    """Return rates over a dial: a row of panels for each thing counted, a column for each dial, a curve a series.

    Args:
        at: settings of the dial, increasing, shape (n_settings,).
        panels: what is counted -> dial -> series -> one rate a setting; each row has the same dials and series.
        axis: what the dial says, with unit.

    Raises:
        BadRequest: there is nothing to draw, the settings do not increase, or rows, columns and series do not agree.
    """
    require_data(title, at, panels)
    if any(b <= a for a, b in itertools.pairwise(at)):
        raise bad_data(title, f"settings must increase, but are {list(at)}")
    dials, series = _common(title, len(at), panels)
    with canvas(0.7 + 1.55 * len(panels), len(panels), columns=len(dials)) as (figure, axes):
        for k, (counted, row) in enumerate(panels.items()):
            for j, (dial, group) in enumerate(row.items()):
                panel = axes[k * len(dials) + j]
                for i, (name, rates) in enumerate(group.items()):
                    colour, style = SERIES[i % len(SERIES)], MARKERS[i % len(MARKERS)]
                    low, high = [r.low for r in rates], [r.high for r in rates]
                    panel.fill_between(at, low, high, color=colour, alpha=0.18, linewidth=0)
                    panel.plot(
                        at, [r.share for r in rates], f"-{style}", color=colour, linewidth=1.6, markersize=4.5,
                        markeredgecolor=PAPER, markeredgewidth=0.6, label=name, clip_on=False, zorder=3,
                    )  # fmt: skip
                panel.yaxis.set_major_formatter(percent)
                panel.set_xlim(at[0], at[-1])
                if k == 0:
                    panel.set_title(dial, color=INK)
                if j == 0:
                    panel.set_ylabel(fill(counted, _LABEL), color=INK)
                if k == len(panels) - 1:
                    panel.set_xlabel(axis)
            # once the whole row is drawn: its panels share this scale, and it would stay as it is now
            axes[k * len(dials)].set_ylim(bottom=0.0)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=len(series))
        svg = svg_of(figure)
    words = (
        f"{counted}, {dial}, {name}: "
        + ", ".join(f"{rate.share:.1%} at {x:g}" for x, rate in zip(at, rates, strict=True))
        for counted, row in panels.items()
        for dial, group in row.items()
        for name, rates in group.items()
    )
    return Figure(title, svg, f"{axis}. " + "; ".join(words), note)


def _common(title: str, n: int, panels: Mapping[str, Mapping[str, Curves]]) -> tuple[list[str], list[str]]:
    """Return the dials and series that all panels have, or raise BadRequest if they differ or have not n rates."""
    first = next(iter(panels.values()))
    dials = list(first)
    series = list(next(iter(first.values()))) if dials else []
    for counted, row in panels.items():
        if list(row) != dials or not series or any(list(group) != series for group in row.values()):
            raise bad_data(title, f"each row must have the dials and series of the first, but {counted!r} has others")
        for group in row.values():
            for name, rates in group.items():
                if len(rates) != n:
                    raise bad_data(title, f"{name!r} must have one rate a setting, {n}, but has {len(rates)}")
    return dials, series
