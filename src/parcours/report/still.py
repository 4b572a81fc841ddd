"""A replay -> one still picture of it, for paper and for readers without scripts.

╭───────────────╮
│  ○ ○ ○     ◎  │   ◎ goal    ● robot every second, with its heading; coloured while halted
│      ●●       │   ○ obstacles at the same seconds, later ones darker
│  ●●●          │
╰───────────────╯
"""

from __future__ import annotations

import math

import numpy as np
from markupsafe import escape

from parcours.report.pieces import Floats, Replay

PIXELS = 420
"""Length of the longer side of the picture [px]."""

_INK = {
    "paper": "var(--panel, #ffffff)",
    "rule": "var(--rule, #cdd4de)",
    "muted": "var(--muted, #5b6675)",
    "robot": "var(--c1, #0072b2)",
    "halted": "var(--c0, #d55e00)",
    "obstacle": "var(--ink, #1c2430)",
    "goal": "var(--c3, #00805c)",
}


def margin(replay: Replay) -> float:
    """Return how much is shown around the arena [m]: enough for what stands on its edge."""
    return 1.2 * max(replay.robot_radius, replay.goal_tolerance, *replay.obstacle_radii, 0.0)


def moments(replay: Replay, every: float = 1.0) -> list[int]:
    """Return the sample nearest to each full `every` [s] from the start, and the last sample.

    Args:
        replay: a recorded run.
        every: time between moments [s], above 0; made longer where it would give more than 60.
    """
    start, end = float(replay.times[0]), float(replay.times[-1])
    every = max(every, math.ceil((end - start) / 60.0))
    wanted = np.arange(start, end, every)
    nearest = np.abs(replay.times[None, :] - wanted[:, None]).argmin(axis=1)
    return sorted({*(int(i) for i in nearest), len(replay.times) - 1})


def still(replay: Replay) -> str:
    """Return an <svg> element that shows the robot's way and where everybody was every second.

    Args:
        replay: a recorded run.
    """
    width, height = replay.arena
    rim = margin(replay)
    scale = PIXELS / (max(width, height) + 2 * rim)
    size = ((width + 2 * rim) * scale, (height + 2 * rim) * scale)
    parts = [_arena(replay)]
    at = moments(replay)
    for k, radius in enumerate(replay.obstacle_radii):
        parts.append(_line(replay.obstacle_x[:, k], replay.obstacle_y[:, k], _INK["obstacle"], 0.25))
        for rank, i in enumerate(at):
            fade = 0.08 + 0.42 * ((rank + 1) / len(at)) ** 2
            parts.append(
                _disc(replay.obstacle_x[i, k], replay.obstacle_y[i, k], radius, _INK["obstacle"], fade, 0.02)
            )
    parts.append(_line(replay.x, replay.y, _INK["robot"], 0.9))
    for i in at:
        ink = _INK["halted"] if replay.halted[i] else _INK["robot"]
        parts.append(_disc(replay.x[i], replay.y[i], replay.robot_radius, ink, 0.55, 0.06))
        tip = replay.robot_radius
        reach = [replay.x[i], replay.x[i] + tip * math.cos(replay.heading[i])]
        rise = [replay.y[i], replay.y[i] + tip * math.sin(replay.heading[i])]
        parts.append(_line(np.array(reach), np.array(rise), ink, 0.8))
    body = "".join(parts)
    # y grows upwards in the arena and downwards on the screen
    frame = f"translate({rim * scale:.1f} {size[1] - rim * scale:.1f}) scale({scale:.3f} {-scale:.3f})"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.0f}" height="{size[1]:.0f}" '
        f'viewBox="0 0 {size[0]:.1f} {size[1]:.1f}" role="img"><title>{escape(described(replay))}</title>'
        f'<g fill="none" stroke-linecap="round" stroke-linejoin="round" transform="{frame}">{body}</g>'
        f"{_labels(replay, at, scale, rim, size[1])}</svg>"
    )


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
    """Return the robot's times every five moments and at the end, but where they would overprint the last."""
    texts: list[str] = []
    last: tuple[float, float] | None = None
    for i in sorted({*at[::5], at[-1]}):
        x = (replay.x[i] + rim) * scale
        y = height - (replay.y[i] + rim) * scale
        if last is None or math.hypot(x - last[0], y - last[1]) > 18.0:
            texts.append(f'<text x="{x:.1f}" y="{y - 5:.1f}">{replay.times[i]:.0f} s</text>')
            last = (x, y)
    style = f"fill:{_INK['muted']};font:11px system-ui,sans-serif;text-anchor:middle"
    return f'<g style="{style}">{"".join(texts)}</g>'
