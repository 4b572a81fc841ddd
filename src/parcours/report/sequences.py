"""Draws who sent what to whom in which order as a sequence chart: one SVG of its own, the same bytes each time.

Cabin        Door
  │── close ──>│        a message; dashed if it was held back until its turn
  │          [d1]       what a component did
  │<── door ───│
 [!] expected c2        where it went wrong
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal, TypeAlias

from parcours.report.pieces import Figure

StepKind: TypeAlias = Literal["message", "deed", "lost", "wrong"]

MOST = 300
"""Steps that are drawn; of more, the last ones, where it went wrong."""

_WIDE, _HIGH, _HEAD, _LONG = 168, 26, 46, 44  # [px]; characters of a label
_INK = {"message": "var(--ink,#1c2430)", "deed": "var(--c1,#0072b2)", "lost": "var(--muted,#5b6675)",
        "wrong": "var(--c0,#d55e00)"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class ChartRow:
    """One row of a chart: a message from one lifeline to another, or what happens at one; held: until its turn came."""

    kind: StepKind
    at: str
    text: str
    to: str = ""
    held: bool = False


def sequence_chart(title: str, steps: Sequence[ChartRow], note: str = "") -> Figure:
    """Return the chart of some steps, in their order; lifelines stand in the order in which they are met."""
    shown = steps[-MOST:]
    lines = list(dict.fromkeys(name for step in shown for name in (step.at, step.to) if name))
    if len(shown) < len(steps):
        note = f"The last {len(shown)} of {len(steps):,d} steps. {note}".strip()
    alt = "; ".join(_said(step) for step in shown[-40:])
    return Figure(title, lambda: _svg(lines, shown), alt, note)


def _said(step: ChartRow) -> str:
    return f"{step.at} to {step.to}: {step.text}" if step.to else f"{step.at}: {step.text}"


def _svg(lines: Sequence[str], steps: Sequence[ChartRow]) -> str:
    across = {name: 70 + _WIDE * k for k, name in enumerate(lines)}
    wide, high = max(70 + _WIDE * len(lines), 420), _HEAD + _HIGH * (len(steps) + 1)
    parts = []
    for name, x in across.items():
        parts.append(_text(x, 20, name, "message", "600"))
        parts.append(f'<path d="M{x} 30V{high - 8}" style="stroke:var(--rule,#d9dee6)" stroke-width="1.4"/>')
    for k, step in enumerate(steps):
        y = _HEAD + _HIGH * k + 14
        parts.append(_message(step, across, y) if step.to and step.to != step.at else _deed(step, across, y, wide))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}" '
        f'font-family="system-ui, sans-serif" font-size="12">{"".join(parts)}</svg>'
    )


def _message(step: ChartRow, across: dict[str, int], y: int) -> str:
    start, end = across[step.at], across[step.to]
    side = 1 if end > start else -1
    dashes = ' stroke-dasharray="5 3"' if step.held else ""
    ink = f'style="stroke:{_INK[step.kind]};fill:{_INK[step.kind]}"'
    tip = f"M{end} {y}l{-8 * side} -4v8z"
    return (
        f'<path d="M{start} {y}H{end - 6 * side}" {ink} stroke-width="1.4"{dashes}/><path d="{tip}" {ink}/>'
        f"{_text((start + end) / 2, y - 5, step.text, step.kind)}"
    )


def _deed(step: ChartRow, across: dict[str, int], y: int, wide: int) -> str:
    x, ink = across[step.at], _INK[step.kind]
    if step.kind == "wrong":
        return (
            f'<rect x="2" y="{y - 13}" width="{wide - 4}" height="{_HIGH - 3}" rx="3" '
            f'style="fill:{ink};stroke:{ink}" fill-opacity="0.15"/>'
            f'<circle cx="{x}" cy="{y - 13}" r="5" style="fill:{ink}"/>'
            f"{_text(12, y + 4, step.text, 'message', '600', 'start', wide // 7)}"
        )
    half = 4 + 3.6 * min(len(step.text), _LONG)
    return (
        f'<rect x="{x - half:.1f}" y="{y - 10}" width="{2 * half:.1f}" height="19" rx="4" '
        f'style="fill:var(--panel,#fefefe);stroke:{ink}"/>{_text(x, y + 4, step.text, step.kind)}'
    )


def _text(
    x: float, y: float, text: str, kind: str, weight: str = "400", anchor: str = "middle", most: int = _LONG
) -> str:
    cut = text if len(text) <= most else f"{text[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
    full = f"<title>{escape(text)}</title>" if cut != text else ""
    return (
        f'<text x="{x:.1f}" y="{y}" text-anchor="{anchor}" font-weight="{weight}" style="fill:{_INK[kind]}">'
        f"{escape(cut)}{full}</text>"
    )
