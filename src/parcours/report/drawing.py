"""What all charts share: their style, and how a matplotlib drawing becomes an <svg> element that a page can adopt.

Of every chart, `title` says what it shows and `note` is the small print below it; its `alt` tells the numbers in words.

The element carries no date, no random id and no address. Its colours are CSS variables with a fallback, so
that a chart follows the page into the dark and stands alone as well; its text stays text.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

from parcours.errors import BadRequest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

WIDTH = 8.8
"""Width of a chart [in]; at 72 points an inch and 4/3 px a point it fills a page's column."""

INK, MUTED, RULE, PAPER = "#1c2430", "#5b6675", "#d9dee6", "#fefefe"

SERIES = ("#d55e00", "#0072b2", "#79808c", "#00805c", "#a8548a", "#b08900")
"""Colours of series (after Okabe and Ito, Color Universal Design, 2008); each has a marker of its own too."""

MARKERS = ("o", "s", "D", "^", "v", "P")

TONES = {
    "good": "#0071b1", "fair": "#62b1e2", "neutral": "#b4bac4", "poor": "#e8b13a", "bad": "#d45d00", "worst": "#7a2259",
}  # fmt: skip
"""Colours of tones, from blue by way of yellow to purple: apart in hue and in lightness.

None is the colour of a series: those follow the page into the dark; these stay, since labels stand on them.
"""

_NAMES = {INK: "ink", MUTED: "muted", RULE: "rule", PAPER: "panel"} | {one: f"c{k}" for k, one in enumerate(SERIES)}

_STYLE: Any = {
    "svg.fonttype": "none", "svg.hashsalt": "parcours",  # text stays text, and ids are the same each time
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans"], "font.size": 9.0, "axes.titlesize": 9.0,
    "axes.labelsize": 9.0, "xtick.labelsize": 8.5, "ytick.labelsize": 9.0, "legend.fontsize": 9.0,
    "legend.frameon": False, "text.usetex": False, "text.parse_math": False, "axes.unicode_minus": True,
    "text.color": INK, "axes.labelcolor": MUTED, "xtick.color": MUTED, "ytick.color": MUTED, "ytick.labelcolor": INK,
    "axes.edgecolor": RULE, "axes.facecolor": "none", "figure.facecolor": "none", "axes.spines.top": False,
    "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True, "grid.color": RULE, "grid.linewidth": 0.7,
    "xtick.major.size": 0.0, "ytick.major.size": 0.0, "ytick.major.pad": 7.0,
}  # fmt: skip


@contextmanager
def canvas(
    height: float, rows: int = 1, *, columns: int = 1, same_heights: bool = False
) -> Iterator[tuple[Canvas, list[Axes]]]:
    """Yield an empty chart of panels, row by row, with a common horizontal axis, in our style.

    Args:
        height: of the whole [in].
        rows: panels above each other.
        columns: panels beside each other.
        same_heights: whether the panels have one vertical scale; with several columns, those of a row always have.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    with matplotlib.rc_context():
        # defaults first: a matplotlibrc of the user must not change our bytes
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Canvas(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasSVG(figure)
        shared: Literal["row"] | bool = same_heights if columns == 1 else "row"
        panels = figure.subplots(rows, columns, sharex=True, sharey=shared, squeeze=False)
        yield figure, list(panels.ravel())


def svg_of(figure: Canvas) -> str:
    """Return the chart as an <svg> element; the same bytes for the same chart."""
    from matplotlib.text import Text

    for label in figure.findobj(Text):
        label.set_text(short(label.get_text()))
    text = io.StringIO()
    with warnings.catch_warnings():
        # text stays text: what our font lacks, the reader's has
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(text, format="svg", transparent=True)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :].strip()
    # date, version and addresses
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    # inside a page a <style> element would reach the whole page
    svg = re.sub(r"<style[^>]*>.*?</style>\s*", "", svg, flags=re.DOTALL)
    svg = svg.replace("<svg ", '<svg stroke-linejoin="round" stroke-linecap="butt" ', 1)
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    svg = svg.replace("'DejaVu Sans'", "var(--sans, 'DejaVu Sans')")
    return re.sub(r"(?<=[:\s])#[0-9a-f]{6}\b", _variable, svg)


def _variable(match: re.Match[str]) -> str:
    name = _NAMES.get(match[0])
    return f"var(--{name}, {match[0]})" if name else match[0]


def label_ink(colour: str) -> str:
    """Return black or white, whichever reads better on a colour (relative luminance, WCAG 2.1)."""
    channels = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return "#000000" if (luminance + 0.05) / 0.05 > 1.05 / (luminance + 0.05) else "#ffffff"


def percent(value: float, _: float = 0.0) -> str:
    """Return a share as a tick label.

    >>> percent(0.25), percent(0.005)
    ('25 %', '0.5 %')
    """
    return f"{100.0 * value:g} %"


def short(label: str) -> str:
    """Return a label whose words are cut where they would leave a chart no room: what it says in words holds them.

    >>> short("a" * 40 + " is long")
    'aaaaaaaaaaaaaaaaaaaaaaaaaaaaa… is long'
    """
    return re.sub(r"(\S{29})\S{2,}", r"\1…", label)


def set_rows(panel: Axes, names: Sequence[str]) -> None:
    """Let a panel hold one row a name, from top to bottom."""
    panel.set_yticks(range(len(names)), [short(name) for name in names])
    panel.set_ylim(len(names) - 0.5, -0.5)


def require_data(title: str, groups: Sequence[object], series: Mapping[str, object]) -> None:
    """Raise BadRequest unless there is something to draw."""
    if not groups or not series:
        raise bad_data(title, "it must have at least one group and one series, but has none")


def require_same_length(title: str, groups: Sequence[object], series: Mapping[str, Sized]) -> None:
    """Raise BadRequest unless each series has one value a group."""
    for name, values in series.items():
        if len(values) != len(groups):
            raise bad_data(title, f"{name!r} must have one value a group, {len(groups)}, but has {len(values)}")


def bad_data(title: str, rule: str) -> BadRequest:
    """Return the complaint that a chart cannot be drawn."""
    return BadRequest(f"chart {title!r}", rule, "check the results it is drawn from", slug="chart-data")
