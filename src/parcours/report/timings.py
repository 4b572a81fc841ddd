"""Draws durations of interactions beside their limits and verdicts (Fig. 5a of Abdelgawad et al.), and lists them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from parcours.report.drawing import INK, MUTED, PAPER, SERIES, TONES, bad_data, canvas, require_data, svg_of
from parcours.report.pieces import Cell, Column, Figure, Floats, Marked, Table, Tone
from parcours.run.noise import Noise
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.statistics import wilson
from parcours.verdict.timing import NEVER, Bound, Timing, summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_TONE: dict[Verdict, Tone] = {
    Verdict.PASS: "good", Verdict.FAIL: "bad", Verdict.INCONCLUSIVE: "poor", Verdict.ERROR: "worst",
}  # fmt: skip
_MARK = {Verdict.PASS: "o", Verdict.FAIL: "X", Verdict.INCONCLUSIVE: "D", Verdict.ERROR: "s"}
_QUANTILES = ("p50", "p95", "p99", "max")
_LOW, _HIGH = 0.16, 0.7
"""A row's density rises from its baseline to _HIGH of the row's height; limits stand _LOW below it."""


@dataclass(frozen=True, slots=True)
class TimingCase:
    """One timing case: durations of an interaction in the order measured, the bound, and what was judged.

    Attributes:
        name: of the interaction, e.g. ITP1; cases of one name make one row.
        durations: [ns], shape (n_repeats,), warm-up left out.
    """

    name: str
    durations: tuple[int, ...]
    bound: Bound
    judgement: Judgement


def timing_figure(title: str, cases: Sequence[TimingCase], noise: Noise | None = None, note: str = "") -> Figure:
    """Return how the durations of each interaction are distributed, on a logarithmic axis, beside their limits.

    A row shows the density of an interaction's durations with p50, p95, p99 and the greatest, and below it a mark
    for the limit of every case, whose shape and colour are the verdict. Noise has a row of its own.

    Args:
        cases: at least one; a duration above 0 ns.
        noise: of the same run.

    Raises:
        BadRequest: there is no case, or a duration is not above 0 ns.
    """
    groups = _by_name(cases)
    require_data(title, cases, groups)
    words = []
    rows = len(groups) + (noise is not None)
    with canvas(1.0 + 0.62 * rows) as (figure, (panel,)):
        for row, (name, members) in enumerate(groups.items()):
            timing = summary(_joined(members))
            ended = np.array([d for case in members for d in case.durations if d != NEVER])
            if (ended <= 0.0).any():
                raise bad_data(title, f"durations must be above 0 ns on a logarithmic axis, but {name} has one of 0")
            _distribution(panel, row, ended * 1e-6, SERIES[3])
            _limits(panel, row, members)
            _say_p99(panel, row, timing.p99, INK)
            words.append(f"{name}: {_words(timing)}; limits {_range(members)}, {_counts(members)}")
        if noise is not None:
            row = len(groups)
            _distribution(panel, row, np.asarray([t for t in noise.times if t > 0]) * 1e-6, SERIES[2])
            _say_p99(panel, row, noise.p99, MUTED)
            words.append(f"noise: {noise.samples} samples, p50 {_ms(noise.p50)}, p99 {_ms(noise.p99)}, "
                        f"max {_ms(noise.max)}")  # fmt: skip
        panel.set_xscale("log")
        panel.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        panel.set_yticks([row - 0.12 for row in range(rows)], [*groups, *(["noise"] if noise is not None else [])])
        panel.set_ylim(rows - 1 + 0.38, -0.82)
        panel.grid(visible=False, axis="y")
        panel.spines["left"].set_visible(False)
        panel.set_xlabel("duration [ms], logarithmic")
        _legend(figure, {case.judgement.verdict for case in cases})
        svg = svg_of(figure)
    return Figure(title, svg, ". ".join(words), note)


def timing_table(title: str, cases: Sequence[TimingCase], note: str = "") -> Table:
    """Return one row an interaction: repeats, quantiles, jitter, misses of each case's own limit, and verdicts."""
    rows: list[tuple[Cell, ...]] = []
    for name, members in _by_name(cases).items():
        timing = summary(_joined(members))
        missed = [(sum(d > case.bound.last for d in case.durations), len(case.durations)) for case in members]
        rate = wilson(sum(count for count, _ in missed), timing.n)
        times = (timing.p50, timing.p95, timing.p99, timing.max, timing.jitter)
        rows.append((
            name, len(members), _range(members), timing.n, *(_cell(time) for time in times),
            rate.count, f"{rate.low:.2%} .. {rate.high:.2%}", _verdicts(members),
        ))  # fmt: skip
    columns = (
        Column("interaction", code=True),
        Column("cases"),
        Column("limits"),
        Column("n", ",d"),
        *(Column(name, ".3f", unit="ms", group="duration") for name in (*_QUANTILES, "jitter")),
        Column("count", ",d", group="misses"),
        Column("rate", group="misses"),
        Column("verdict"),
    )
    return Table(title, columns, tuple(rows), note)


def _by_name(cases: Sequence[TimingCase]) -> dict[str, list[TimingCase]]:
    groups: dict[str, list[TimingCase]] = {}
    for case in cases:
        groups.setdefault(case.name, []).append(case)
    return groups


def _joined(members: Sequence[TimingCase]) -> tuple[int, ...]:
    return tuple(duration for case in members for duration in case.durations)


def _distribution(panel: Axes, row: int, times: Floats, colour: str) -> None:
    """Draw the density of durations [ms] above the row's baseline, and their quantiles on it."""
    if not times.size:
        return
    p50, p95, p99 = (float(q) for q in np.quantile(times, (0.5, 0.95, 0.99), method="inverted_cdf"))
    place, density = _density(np.log10(times))
    seen = density > 0.004
    panel.fill_between(10.0**place, row, row - _HIGH * density, where=seen, color=colour, alpha=0.3, linewidth=0)
    panel.plot(10.0**place, np.where(seen, row - _HIGH * density, np.nan), color=colour, linewidth=1.0)
    panel.hlines(row, times.min(), times.max(), color=colour, linewidth=1.2)
    panel.plot([p50], [row], "o", color=colour, markersize=6.5, markeredgecolor=PAPER, zorder=4)
    panel.vlines(p95, row - 0.13, row, color=colour, linewidth=1.6)
    panel.vlines(p99, row - 0.26, row, color=colour, linewidth=2.6)
    panel.plot([times.max()], [row], ">", color=colour, markersize=4.5, zorder=4)


def _say_p99(panel: Axes, row: int, time: int, colour: str) -> None:
    panel.annotate(
        f"p99 {_ms(time)}", (1.0, row - 0.12), xycoords=("axes fraction", "data"),
        xytext=(6, 0), textcoords="offset points", va="center", color=colour, annotation_clip=False,
    )  # fmt: skip


def _density(values: Floats) -> tuple[Floats, Floats]:
    """Return places and how dense values are there, 1 where they are densest (a Gaussian sum, Silverman's width)."""
    # Counts on a fine grid, then one convolution: a kernel for each of a million repeats would take minutes.
    spread = float(np.std(values))
    quartiles = np.quantile(values, (0.25, 0.75))
    robust = min(spread, float(quartiles[1] - quartiles[0]) / 1.34) or spread
    width = max(0.9 * robust * len(values) ** -0.2, 0.008)
    place = np.linspace(values.min() - 3.0 * width, values.max() + 3.0 * width, 512)
    counts = np.histogram(values, np.append(place, place[-1] + (place[1] - place[0])))[0].astype(float)
    reach = np.arange(-len(place) + 1, len(place)) * (place[1] - place[0])
    density = np.convolve(counts, np.exp(-0.5 * (reach / width) ** 2), mode="valid")
    return place, density / density.max()


def _limits(panel: Axes, row: int, members: Sequence[TimingCase]) -> None:
    """Mark the limit of each case below the row's baseline by its verdict."""
    limits = [case.bound.limit * 1e-6 for case in members]
    panel.hlines(row + _LOW, min(limits), max(limits), color=MUTED, linewidth=0.8)
    for verdict, tone in _TONE.items():
        found = [limit for limit, case in zip(limits, members, strict=True) if case.judgement.verdict is verdict]
        panel.plot(
            found, [row + _LOW] * len(found), _MARK[verdict], color=TONES[tone], markersize=6,
            markeredgecolor=PAPER, markeredgewidth=0.6, linestyle="none", zorder=3,
        )  # fmt: skip


def _legend(figure: Canvas, verdicts: set[Verdict]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour = SERIES[3]
    handles: list[tuple[Patch | Line2D, str]] = [
        (Patch(color=colour, alpha=0.3, linewidth=0), "density"),
        (Line2D([], [], color=colour, marker="o", linestyle="none", markeredgecolor=PAPER), "p50"),
        (Line2D([], [], color=colour, marker="|", linestyle="none", markersize=7, markeredgewidth=1.6), "p95"),
        (Line2D([], [], color=colour, marker="|", linestyle="none", markersize=11, markeredgewidth=2.6), "p99"),
        (Line2D([], [], color=colour, marker=">", linestyle="none", markersize=5), "greatest"),
    ]
    for verdict, tone in _TONE.items():
        if verdict in verdicts:
            mark = Line2D([], [], color=TONES[tone], marker=_MARK[verdict], linestyle="none", markeredgecolor=PAPER)
            handles.append((mark, f"limit: {verdict}"))
    figure.legend(
        [handle for handle, _ in handles], [label for _, label in handles], loc="outside upper left",
        ncols=len(handles), handletextpad=0.4, columnspacing=1.3,
    )  # fmt: skip


def _words(timing: Timing) -> str:
    quantiles = ", ".join(f"{name} {_ms(getattr(timing, name))}" for name in _QUANTILES)
    unended = f", {timing.unended} never ended" if timing.unended else ""
    return f"n {timing.n}, {quantiles}{unended}"


def _counts(members: Sequence[TimingCase]) -> str:
    found = Counter(case.judgement.verdict for case in members)
    return ", ".join(f"{found[verdict]} {verdict}" for verdict in Verdict if found[verdict])


def _verdicts(members: Sequence[TimingCase]) -> Marked:
    """All one verdict: its name; else how many of each; toned as the worst of them."""
    found = {case.judgement.verdict for case in members}
    worst = next(v for v in (Verdict.ERROR, Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.PASS) if v in found)
    why = next(case.judgement.why for case in members if case.judgement.verdict is worst)
    return Marked(_counts(members), _TONE[worst], why)


def _range(members: Sequence[TimingCase]) -> str:
    limits = sorted(case.bound.limit for case in members)
    least, greatest = f"{limits[0] * 1e-6:g}", f"{limits[-1] * 1e-6:g}"
    return f"{least} ms" if least == greatest else f"{least} .. {greatest} ms"


def _cell(time: int) -> Cell:
    return Marked("never", "bad", "a repeat did not end") if time == NEVER else time * 1e-6


def _ms(time: int) -> str:
    return "never" if time == NEVER else f"{time * 1e-6:.3g} ms"
