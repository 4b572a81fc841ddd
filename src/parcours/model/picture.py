"""Draws a machine, or components and their channels, as one self-contained SVG picture: the same bytes each time.

States or components stand on a circle, the first one left; arrows between the same two bow apart; loops point
outwards; what the arrows say goes to a legend below.

            ___p2__
      *-> (a)     (b) ~p4      angles grow clockwise, as y points down
            `-p3--'
"""

from __future__ import annotations

import html
import math
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from parcours.model.drawing import predicate
from parcours.model.structure import ENVIRONMENT, Cefsm, Machine

_CHARACTER = 7.2  # width of one letter at 13 px [px]
_INK, _ACCENT, _PAPER, _NODE = "#1b1f24", "#0b57a4", "#ffffff", "#eef4fb"
_LEGEND_WIDTH = 96  # [characters]
_SHOWN = 24  # longest label on an arrow or in a node [characters]
_TRIED = (0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74)

Point = tuple[float, float]
PaintState: TypeAlias = Literal["covered", "uncovered", "infeasible", "failing"]
_Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Paint:
    """How a transition is drawn: as what it came out, with words on it, and the anchor that a click leads to."""

    state: PaintState
    words: str = ""
    anchor: str = ""


@dataclass(frozen=True, slots=True)
class _Arrow:
    """A transition or a channel: from where to where, what stands on it, and what the legend says of it."""

    id: str
    source: str
    target: str
    label: str
    said: str


# Colours that differ in lightness, too, and lines that differ without any colour
_LINES: dict[str, tuple[str, str]] = {
    "covered": ("#00664a", 'stroke-width="2"'),
    "uncovered": ("#7a4a00", 'stroke-width="1.6" stroke-dasharray="7 4"'),
    "infeasible": ("#6b7280", 'stroke-width="1.4" stroke-dasharray="2 4"'),
    "failing": ("#b3261e", 'stroke-width="3.6"'),
}


def to_svg(machine: Machine, title: str = "", painted: Mapping[str, Paint] | None = None) -> str:
    """Return a picture of a machine with its transitions, under a title, by default the machine's name.

    Args:
        machine: what is drawn.
        title: above it.
        painted: how transitions are drawn, by their ids; a key of the colours is added. The others are black.
    """
    arrows = [_Arrow(one.id, one.source, one.target, one.id, predicate(one)) for one in machine.transitions]
    names = list(dict.fromkeys([machine.initial, *machine.states]))
    return _Picture(names, arrows, painted or {}, machine.initial).finished(title or machine.name)


def channels_to_svg(cefsm: Cefsm, title: str, rates: Mapping[str, float]) -> str:
    """Return a picture of the components of a model with the channels between them, and how much flows there a case.

    Args:
        cefsm: the model.
        title: above it.
        rates: messages a case by channel; a channel without any is dashed.
    """
    arrows = []
    for one in cefsm.channels:
        rate = f"{rates.get(one.name, 0.0):.3g}"
        said = f"{rate} a case; {one.message}" + (f" on {one.topic}" if one.topic else "")
        arrows.append(_Arrow(one.name, one.sender, one.receiver, f"{rate} {one.name}", said))
    ends = {end for arrow in arrows for end in (arrow.source, arrow.target)}
    names = [*([ENVIRONMENT] if ENVIRONMENT in ends else []), *(one.name for one in cefsm.components)]
    painted = {one.name: Paint("covered" if rates.get(one.name) else "uncovered") for one in cefsm.channels}
    return _Picture(names, arrows, painted).finished(title)


class _Picture:
    """Collects shapes, and the corners of what is drawn, from which the size of the picture follows."""

    def __init__(
        self, names: list[str], arrows: Sequence[_Arrow], painted: Mapping[str, Paint], initial: str = ""
    ) -> None:
        self.painted = painted
        longest = max((len(_cut(each.label)) for each in arrows), default=0)
        self.radius_x = {name: max(34.0, _CHARACTER * len(_cut(name)) / 2 + 14) for name in names}
        self.radius_y = 21.0
        self.place = self._circle(names, _CHARACTER * longest)
        self.under: list[str] = []
        self.over: list[str] = []
        self.taken: list[_Box] = []
        self.corners: list[Point] = [(0.0, 0.0)]
        self.draw(arrows, initial)
        self.write_legend([(each.id, each.said) for each in arrows])
        self.write_key()

    def _circle(self, names: list[str], label: float) -> dict[str, Point]:
        count, widest = len(names), max(self.radius_x.values())
        if count == 1:
            return {names[0]: (0.0, 0.0)}
        if count == 2:
            reach = widest + 60 + label / 2
            return {names[0]: (-reach, 0.0), names[1]: (reach, 0.0)}
        high = max(115.0, count * 26.0, label)
        wide = max(widest + 85 + label, count * (widest + 24) / math.pi)
        turn = 2 * math.pi / count
        return {name: (-wide * math.cos(turn * at), -high * math.sin(turn * at)) for at, name in enumerate(names)}

    def draw(self, arrows: Sequence[_Arrow], initial: str) -> None:
        for name, (x, y) in self.place.items():
            rx, ry = self.radius_x[name], self.radius_y
            self.over.append(
                f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{rx:.1f}" ry="{ry:.1f}" fill="{_NODE}" '
                f'stroke="{_ACCENT}" stroke-width="1.5"/>'
            )
            self.text(name, (x, y), weight="600")
            self.take((x - rx, y - ry, x + rx, y + ry))
        between: Counter[tuple[str, str]] = Counter()
        both_ways = {(each.source, each.target) for each in arrows}
        outward: dict[str, list[_Arrow | None]] = {name: [] for name in self.place}
        if initial:
            outward[initial].append(None)  # the arrow from nowhere
        for arrow in arrows:
            if arrow.source == arrow.target:
                outward[arrow.source].append(arrow)
                continue
            pair = (arrow.source, arrow.target)
            opposed = (arrow.target, arrow.source) in both_ways
            self.curve(arrow, 20.0 + 34.0 * between[pair] if opposed or between[pair] else 12.0)
            between[pair] += 1
        for name, stubs in outward.items():
            for at, stub in enumerate(stubs):
                x, y = self.place[name]
                angle = math.atan2(y, x) if (x, y) != (0.0, 0.0) else -math.pi / 2
                angle += (at - (len(stubs) - 1) / 2) * math.radians(52)
                if stub is None:
                    self.start(name, angle)
                else:
                    self.loop(stub, angle)

    def curve(self, arrow: _Arrow, bend: float) -> None:
        start, end = self.place[arrow.source], self.place[arrow.target]
        dx, dy = end[0] - start[0], end[1] - start[1]
        length = math.hypot(dx, dy)
        # The control point lies left of the way, seen along it, so that the way back bows to the other side.
        control = ((start[0] + end[0]) / 2 + dy / length * 2 * bend, (start[1] + end[1]) / 2 - dx / length * 2 * bend)
        first, last = self.rim(arrow.source, control), self.rim(arrow.target, control, gap=2.0)
        self.line(f"M{_at(first)} Q{_at(control)} {_at(last)}", control, last, self.painted.get(arrow.id))
        self.label(arrow, [_quadratic(first, control, last, part) for part in _TRIED])

    def start(self, name: str, angle: float) -> None:
        far = self.ray(name, angle, 30.0)
        tip = self.rim(name, far, gap=2.0)
        self.under.append(f'<circle cx="{far[0]:.1f}" cy="{far[1]:.1f}" r="4" fill="{_INK}"/>')
        self.corners += [(far[0] - 5, far[1] - 5), (far[0] + 5, far[1] + 5)]
        self.line(f"M{_at(far)} L{_at(tip)}", far, tip)

    def loop(self, arrow: _Arrow, angle: float) -> None:
        name = arrow.source
        out, back = (self.ray(name, angle + side * math.radians(17), 1.5) for side in (-1, 1))
        reach = self.ray(name, angle, 48.0)
        across = (-math.sin(angle), math.cos(angle))
        pulls = [(reach[0] + side * 24 * across[0], reach[1] + side * 24 * across[1]) for side in (-1, 1)]
        way = f"M{_at(out)} C{_at(pulls[0])} {_at(pulls[1])} {_at(back)}"
        self.line(way, pulls[1], back, self.painted.get(arrow.id))
        half = _CHARACTER * len(_cut(arrow.label)) / 2
        self.label(arrow, [self.ray(name, angle, gap + half * abs(math.cos(angle))) for gap in (44.0, 58.0, 72.0)])

    def ray(self, name: str, angle: float, gap: float) -> Point:
        x, y = self.place[name]
        return self.rim(name, (x + math.cos(angle), y + math.sin(angle)), gap)

    def rim(self, name: str, toward: Point, gap: float = 0.0) -> Point:
        # The point of a node's rim on the ray to another point, a gap further out.
        x, y = self.place[name]
        dx, dy = toward[0] - x, toward[1] - y
        scale = 1.0 / math.hypot(dx / self.radius_x[name], dy / self.radius_y)
        length = math.hypot(dx, dy)
        return x + dx * scale + dx / length * gap, y + dy * scale + dy / length * gap

    def line(self, path: str, before: Point, tip: Point, paint: Paint | None = None) -> None:
        # An arrow along a path whose end comes from the point before.
        ink, style = _LINES[paint.state] if paint else (_INK, 'stroke-width="1.4"')
        self.under.append(f'<path d="{path}" fill="none" stroke="{ink}" {style}/>')
        angle = math.atan2(tip[1] - before[1], tip[0] - before[0])
        wings = [(tip[0] - 9 * math.cos(angle + side), tip[1] - 9 * math.sin(angle + side)) for side in (-0.4, 0.4)]
        self.under.append(f'<polygon points="{" ".join(map(_at, [tip, *wings]))}" fill="{ink}"/>')

    def label(self, arrow: _Arrow, spots: list[Point]) -> None:
        half = _CHARACTER * len(_cut(arrow.label)) / 2 + 2
        boxes = [(x - half, y - 9, x + half, y + 9) for x, y in spots]
        free = (at for at, box in enumerate(boxes) if not any(_overlap(box, other) for other in self.taken))
        at = next(free, 0)
        left, top, right, bottom = boxes[at]
        self.take(boxes[at])
        self.over.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}" '
            f'fill="{_PAPER}" fill-opacity="0.85"/>'
        )
        paint = self.painted.get(arrow.id)
        if paint is None:
            self.text(arrow.label, spots[at])
            return
        begin = len(self.over)
        self.text(arrow.label, spots[at], "600", _LINES[paint.state][0], paint.words)
        if paint.anchor:
            self.over[begin:] = [f'<a href="#{_safe(paint.anchor)}">{"".join(self.over[begin:])}</a>']

    def take(self, box: _Box) -> None:
        self.taken.append(box)
        self.corners += [box[:2], box[2:]]

    def text(self, text: str, place: Point, weight: str = "400", ink: str = _INK, words: str = "") -> None:
        said = f"{text}: {words}" if words else text
        full = f"<title>{_safe(said)}</title>" if _cut(text) != said else ""
        self.over.append(
            f'<text x="{place[0]:.1f}" y="{place[1] + 4.5:.1f}" text-anchor="middle" fill="{ink}" '
            f'font-weight="{weight}">{_safe(_cut(text))}{full}</text>'
        )

    def write_legend(self, legend: list[tuple[str, str]]) -> None:
        left, _, _, bottom = self.bounds()
        column = max((len(_cut(name)) for name, _ in legend), default=0) * _CHARACTER + 18
        y = bottom + 34
        for name, said in legend:
            for at, part in enumerate(textwrap.wrap(said, _LEGEND_WIDTH) or [""]):
                if at == 0:
                    self.line_of_legend(_cut(name), left, y, "600")
                self.line_of_legend(part, left + column, y, "400")
                y += 18

    def write_key(self) -> None:
        left, _, _, bottom = self.bounds()
        y = bottom + 24
        for state in (one for one in _LINES if any(paint.state == one for paint in self.painted.values())):
            ink, style = _LINES[state]
            self.under.append(f'<path d="M{left:.1f} {y:.1f}h34" stroke="{ink}" {style}/>')
            self.line_of_legend(state, left + 44, y + 4, "400")
            left += 44 + 9 * len(state) + 24

    def line_of_legend(self, text: str, x: float, y: float, weight: str) -> None:
        self.over.append(
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{_INK}" font-weight="{weight}" '
            f'font-family="ui-monospace, Menlo, Consolas, monospace" font-size="12">{_safe(text)}</text>'
        )
        self.corners.append((x + len(text) * 7.3, y + 4))

    def bounds(self) -> _Box:
        xs, ys = zip(*self.corners, strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    def finished(self, title: str) -> str:
        left, top, right, bottom = self.bounds()
        left, top = left - 20, top - 52
        wide, high = max(right + 20 - left, _CHARACTER * len(title) + 60), bottom + 16 - top
        heading = (
            f'<text x="{left + 20:.1f}" y="{top + 26:.1f}" font-size="15" font-weight="600" '
            f'fill="{_INK}">{_safe(title)}</text>'
        )
        shapes = "\n".join([heading, *self.under, *self.over])
        role = "group" if any(paint.anchor for paint in self.painted.values()) else "img"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" role="{role}" aria-label="{_safe(title)}" '
            f'viewBox="{left:.1f} {top:.1f} {wide:.1f} {high:.1f}" width="{wide:.0f}" height="{high:.0f}" '
            f'font-family="system-ui, -apple-system, Segoe UI, sans-serif" font-size="13">\n'
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{wide:.1f}" height="{high:.1f}" rx="8" '
            f'fill="{_PAPER}"/>\n'
            f"{shapes}\n</svg>\n"
        )


def _quadratic(start: Point, control: Point, end: Point, part: float) -> Point:
    rest = 1 - part
    x, y = (
        rest * rest * a + 2 * rest * part * b + part * part * c for a, b, c in zip(start, control, end, strict=True)
    )
    return x, y


def _overlap(one: _Box, two: _Box) -> bool:
    return one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3]


def _cut(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "\u2026"


def _at(point: Point) -> str:
    return f"{point[0]:.1f},{point[1]:.1f}"


def _safe(text: str) -> str:
    return html.escape("".join(letter if letter.isprintable() else "\ufffd" for letter in text))
