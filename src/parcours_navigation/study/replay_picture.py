"""Draws a replay for the page of a report: a still picture for paper, which a script turns into a player.

╭───────────────╮
│  ○ ○ ○     ◎  │   ◎ goal    ● robot every second, with its heading; coloured while halted
│      ●●       │   ○ obstacles at the same seconds, later ones darker
│  ●●●          │
╰───────────────╯
"""

from __future__ import annotations

import math
from functools import cache, partial
from importlib import resources

import numpy as np
from markupsafe import escape

from parcours.report.pieces import Animation, Floats
from parcours_navigation.ground.ground import lay_ground
from parcours_navigation.sensing.scan import scan
from parcours_navigation.study.exporting import write_gif, write_mcap
from parcours_navigation.study.replay import Replay, embedded

PIXELS = 420
"""Length of the longer side of the picture [px]."""

SAME_PLACE = 0.02
"""A body that moved less than this between two moments is drawn once [m]."""

_INK = {
    "paper": "var(--panel, #ffffff)",
    "rule": "var(--rule, #cdd4de)",
    "muted": "var(--muted, #5b6675)",
    "robot": "var(--c1, #0072b2)",
    "halted": "var(--c0, #d55e00)",
    "obstacle": "var(--ink, #1c2430)",
    "goal": "var(--c3, #00805c)",
    "seen": "var(--c5, #b08900)",
}


def animation(replay: Replay) -> Animation:
    """Return the replay as a piece of a report's page."""
    exports = {".gif": partial(write_gif, replay), ".mcap": partial(write_mcap, replay)}
    data = embedded(replay)
    return Animation(replay.title, replay.subtitle, still(replay), data, _script(), replay.note, exports=exports)


@cache
def _script() -> str:
    return resources.files("parcours_navigation.study").joinpath("replay.js").read_text(encoding="utf-8")


def margin(replay: Replay) -> float:
    """Return how much is shown around the arena [m]: enough for what stands on its edge."""
    return 1.2 * max(replay.robot_radius, replay.goal_tolerance, *replay.obstacle_radii, 0.0)


def moments(replay: Replay, every: float = 1.0) -> list[int]:
    """Return the sample nearest to each full `every` [s] from the start, and the last; at most 60 before it."""
    start, end = float(replay.times[0]), float(replay.times[-1])
    every = max(every, math.ceil((end - start) / 60.0))
    wanted = np.arange(start, end, every)
    nearest = np.abs(replay.times[None, :] - wanted[:, None]).argmin(axis=1)
    return sorted({*(int(i) for i in nearest), len(replay.times) - 1})


def still(replay: Replay) -> str:
    """Return an <svg> element that shows the robot's way and where everybody was every second."""
    width, height = replay.arena
    rim = margin(replay)
    scale = PIXELS / (max(width, height) + 2 * rim)
    size = ((width + 2 * rim) * scale, (height + 2 * rim) * scale)
    parts = [_arena(replay), *_standing(replay), *_seen(replay)]
    at = moments(replay)
    for k, radius in enumerate(replay.obstacle_radii):
        x, y = replay.obstacle_x[:, k], replay.obstacle_y[:, k]
        parts.append(_line(x, y, _INK["obstacle"], 0.25))
        for first, last in stays(x, y, at):
            fade = 0.1 + 0.5 * (at.index(last) + 1) / len(at)
            parts.append(_disc(x[first], y[first], radius, _INK["obstacle"], fade, 0.16 * fade))
    parts.append(_line(replay.x, replay.y, _INK["robot"], 0.9))
    for first, last in stays(replay.x, replay.y, at):
        ink = _INK["halted"] if replay.halted[first : last + 1].any() else _INK["robot"]
        x0, y0, heading = float(replay.x[last]), float(replay.y[last]), float(replay.heading[last])
        parts.append(_disc(x0, y0, replay.robot_radius, ink, 0.7, 0.12))
        tip = (x0 + replay.robot_radius * math.cos(heading), y0 + replay.robot_radius * math.sin(heading))
        parts.append(_line(np.array([x0, tip[0]]), np.array([y0, tip[1]]), ink, 0.8))
    body = "".join(parts)
    # y grows upwards in the arena and downwards on the screen
    frame = f"translate({rim * scale:.1f} {size[1] - rim * scale:.1f}) scale({scale:.3f} {-scale:.3f})"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.0f}" height="{size[1]:.0f}" '
        f'viewBox="0 0 {size[0]:.1f} {size[1]:.1f}" role="img"><title>{escape(described(replay))}</title>'
        f'<g fill="none" stroke-linecap="round" stroke-linejoin="round" transform="{frame}">{body}</g>'
        f"{_labels(replay, at, scale, rim, size[1])}</svg>"
    )


def stays(x: Floats, y: Floats, at: list[int]) -> list[tuple[int, int]]:
    """Return where a body is at some samples, increasing: the first and the last of each run of them in one place.

    >>> stays(np.array([0.0, 0.5, 0.5, 0.505, 1.0]), np.zeros(5), [0, 1, 2, 3, 4])
    [(0, 0), (1, 3), (4, 4)]
    """
    found = [(at[0], at[0])]
    for i in at[1:]:
        first = found[-1][0]
        if math.hypot(x[i] - x[first], y[i] - y[first]) < SAME_PLACE:
            found[-1] = (first, i)
        else:
            found.append((i, i))
    return found


def described(replay: Replay) -> str:
    """Return the picture in words, for those who do not see it."""
    held = int(np.count_nonzero(replay.halted))
    halt = f", held for imminent collision in {held / len(replay.times):.0%} of the samples" if held else ""
    least = replay.clearance().min()
    gap = f"; least clearance {least:.3f} m" if math.isfinite(least) else ""
    return (
        f"{replay.title}: the robot goes from ({replay.x[0]:.2f}, {replay.y[0]:.2f}) m to "
        f"({replay.x[-1]:.2f}, {replay.y[-1]:.2f}) m in {replay.times[-1] - replay.times[0]:.1f} s{halt}{gap}"
    )


def _arena(replay: Replay) -> str:
    """Return the arena with a grid line every half metre (at most 40 a side), and the goal's ring."""
    width, height = replay.arena
    step = 0.5 * max(1, math.ceil(max(width, height) / 20.0))
    lines = [f"M{x:g} 0V{height:g}" for x in np.arange(step, width - 1e-9, step)]
    lines += [f"M0 {y:g}H{width:g}" for y in np.arange(step, height - 1e-9, step)]
    goal_x, goal_y = replay.goal
    return (
        f'<rect width="{width:g}" height="{height:g}" style="fill:{_INK["paper"]};stroke:{_INK["muted"]}" '
        f'stroke-width="1.2" {_HAIR}/>'
        f'<path d="{"".join(lines)}" style="stroke:{_INK["rule"]}" {_HAIR}/>'
        f'<circle cx="{goal_x:.3f}" cy="{goal_y:.3f}" r="{replay.goal_tolerance:g}" '
        f'style="fill:{_INK["goal"]};stroke:{_INK["goal"]}" fill-opacity="0.12" stroke-width="1.6" {_HAIR}/>'
    )


def _standing(replay: Replay) -> list[str]:
    """Return the walls and discs of the ground."""
    if replay.ground is None:
        return []
    path = "".join(f"M{a:.3f} {b:.3f}L{c:.3f} {d:.3f}" for a, b, c, d in replay.ground.walls)
    lines = f'<path d="{path}" style="stroke:{_INK["obstacle"]}" stroke-width="2" {_HAIR}/>'
    goals = [_disc(x, y, replay.goal_tolerance, _INK["goal"], 0.9, 0.06) for x, y in replay.ground.goals]
    way = (
        [_line(replay.ground.path[:, 0], replay.ground.path[:, 1], _INK["goal"], 0.6)]
        if len(replay.ground.path)
        else []
    )
    discs = [_disc(x, y, radius, _INK["obstacle"], 0.9, 0.5) for x, y, radius in replay.ground.discs]
    return [lines, *discs, *goals, *way]


def _seen(replay: Replay) -> list[str]:
    """Return where the beams of the last scan end, without noise: dots on what they meet."""
    if replay.ground is None or not replay.ground.scan[0]:
        return []
    n, first, step, reach = replay.ground.scan
    ranges, packed = np.empty(n), lay_ground(replay.ground.walls, replay.ground.discs).pack()
    bodies = np.column_stack([replay.obstacle_x[-1], replay.obstacle_y[-1], np.array(replay.obstacle_radii)])
    x, y, heading = float(replay.x[-1]), float(replay.y[-1]), float(replay.heading[-1])
    scan(packed, np.ascontiguousarray(bodies), x, y, heading, first, step, reach, ranges)
    angles = heading + first + step * np.arange(n)
    met = ranges < reach
    ends = zip((x + ranges * np.cos(angles))[met], (y + ranges * np.sin(angles))[met], strict=True)
    dots = "".join(f"M{a:.3f} {b:.3f}h0" for a, b in ends)
    return [f'<path d="{dots}" style="stroke:{_INK["seen"]}" stroke-width="3.5" {_HAIR}/>']


_HAIR = 'vector-effect="non-scaling-stroke"'


def _line(x: Floats, y: Floats, ink: str, opacity: float) -> str:
    points = " ".join(f"{a:.3f},{b:.3f}" for a, b in zip(x, y, strict=True))
    style = f'style="stroke:{ink}" stroke-opacity="{opacity}" stroke-width="1.4"'
    return f'<polyline points="{points}" {style} {_HAIR}/>'


def _disc(x: float, y: float, radius: float, ink: str, edge: float, fill: float) -> str:
    return (
        f'<circle cx="{x:.3f}" cy="{y:.3f}" r="{radius:g}" style="fill:{ink};stroke:{ink}" '
        f'fill-opacity="{fill:g}" stroke-opacity="{edge:.2f}" {_HAIR}/>'
    )


def _labels(replay: Replay, at: list[int], scale: float, rim: float, height: float) -> str:
    """Return when the robot was where: at every fifth place and where it stayed, as far as there is room."""
    texts: list[str] = []
    taken: list[tuple[float, float]] = []
    places = stays(replay.x, replay.y, at)
    wanted = [place for k, place in enumerate(places) if k % 5 == 0 or place[1] != place[0] or k == len(places) - 1]
    # the end and the long stays first: they tell most
    for first, last in sorted(wanted, key=lambda place: (place[1] != at[-1], place[0] - place[1])):
        x = (replay.x[last] + rim) * scale
        y = height - (replay.y[last] + replay.robot_radius + rim) * scale - 4.0
        if all(abs(x - a) > 48.0 or abs(y - b) > 12.0 for a, b in taken):
            start, end = (f"{replay.times[i]:.0f}" for i in (first, last))
            texts.append(f'<text x="{x:.1f}" y="{y:.1f}">{start if start == end else f"{start}–{end}"} s</text>')
            taken.append((x, y))
    style = f"fill:{_INK['muted']};font:11px system-ui,sans-serif;text-anchor:middle"
    return f'<g style="{style}">{"".join(texts)}</g>'
