"""Draws a case at its beginning: ground, robot, others with the way they look, start, goals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import escape

from parcours.elementary import sin_cos
from parcours.errors import ParcoursError
from parcours.model.finding import Finding, finding_of
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, World, parse_world
from parcours_navigation.worlds.paper import paper_cases

PIXELS = 640
"""Length of the longer side [px]."""

_INK, _ROBOT, _GOAL, _OTHER = "#1c2430", "#0072b2", "#00805c", "#d55e00"


def looked_over(text: str, path: Path) -> tuple[Sequence[Finding], Sequence[tuple[str, str]]]:
    """Return what is wrong with the text of a world file as it is edited, or a picture of its first case."""
    try:
        world = parse_world(text, str(path), path.parent)
        is_drawn = paper_cases(world, 1, "navigation") is None
        return (), [(f"world {world.name}, case 0", drawing(world, 1, 0))] if is_drawn else ()
    except ParcoursError as error:
        return getattr(error, "findings", ()) or (finding_of(error, str(path)),), ()


def drawing(world: World, seed: int, number: int) -> str:
    """Return an <svg> of a case. Raises BadWorld if it cannot be made, or is the paper's."""
    if paper_cases(world, seed, "navigation") is not None:
        raise BadWorld(world.origin, "the paper's arena has no ground to draw", "replay one of its cases",
                       slug="world-range")  # fmt: skip
    cases = WorldCases(seed, world)
    [staged], land = cases.staged([number], 0.05), cases.land(number)
    scene, radius = staged.scene, staged.task.robot_radius
    x, y, heading = (float(scene.robot[name][0]) for name in ("x", "y", "heading"))
    walls = land.edges()
    discs = land.ground.discs
    xs = np.concatenate([walls[:, ::2].ravel(), discs[:, 0], scene.obstacles["x0"], scene.goals[:, 0], [x]])
    ys = np.concatenate([walls[:, 1::2].ravel(), discs[:, 1], scene.obstacles["y0"], scene.goals[:, 1], [y]])
    rim = max(2.0 * radius, 0.3)
    x0, y0, x1, y1 = xs.min() - rim, ys.min() - rim, xs.max() + rim, ys.max() + rim
    scale = PIXELS / max(x1 - x0, y1 - y0)
    path = "".join(f"M{a:.3f} {b:.3f}L{c:.3f} {d:.3f}" for a, b, c, d in walls)
    parts = [f'<path d="{path}" stroke="{_INK}" stroke-width="{2 / scale:.4f}"/>']
    parts += [_disc(a, b, r, _INK, 0.5) for a, b, r in discs]
    if staged.path is not None:
        points = " ".join(f"{a:.3f},{b:.3f}" for a, b in staged.path)
        parts.append(
            f'<polyline points="{points}" stroke="{_GOAL}" stroke-width="{1 / scale:.4f}" stroke-opacity="0.6"/>'
        )
    parts += [_disc(a, b, scene.tolerance, _GOAL, 0.15) for a, b, _ in scene.goals]
    n_closed = len(scene.obstacles) - len(scene.agents)
    for k, one in enumerate(scene.obstacles):
        looks = float(one["heading0"] if k < n_closed else scene.agents["heading"][k - n_closed])
        parts.append(_disc(one["x0"], one["y0"], one["radius"], _OTHER, 0.25))
        parts.append(_ray(one["x0"], one["y0"], looks, one["radius"], _OTHER, scale))
    if len(scene.corners):
        s, c = sin_cos(heading)
        outline = " ".join(f"{x + c * a - s * b:.3f},{y + s * a + c * b:.3f}" for a, b in scene.corners)
        parts.append(f'<polygon points="{outline}" fill="{_ROBOT}" fill-opacity="0.3" stroke="{_ROBOT}" '
                     f'stroke-width="{1.5 / scale:.4f}"/>')  # fmt: skip
    else:
        parts.append(_disc(x, y, radius, _ROBOT, 0.3))
    parts.append(_ray(x, y, heading, radius, _ROBOT, scale))
    size = ((x1 - x0) * scale, (y1 - y0) * scale)
    frame = f"translate({-x0 * scale:.1f} {y1 * scale:.1f}) scale({scale:.4f} {-scale:.4f})"
    title = f"{cases.id(number)}: {len(scene.obstacles)} others, {len(walls)} walls"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.0f}" height="{size[1]:.0f}" '
        f'viewBox="0 0 {size[0]:.1f} {size[1]:.1f}" role="img"><title>{escape(title)}</title>'
        f'<rect width="100%" height="100%" fill="#ffffff"/>'
        f'<g fill="none" transform="{frame}">{"".join(parts)}</g></svg>'
    )


def _disc(x: float, y: float, radius: float, ink: str, fill: float) -> str:
    return (
        f'<circle cx="{x:.3f}" cy="{y:.3f}" r="{radius:.3f}" fill="{ink}" fill-opacity="{fill:g}" stroke="{ink}" '
        f'stroke-width="{radius * 0.08:.4f}"/>'
    )


def _ray(x: float, y: float, heading: float, length: float, ink: str, scale: float) -> str:
    s, c = math.sin(heading), math.cos(heading)
    ray = f"M{x:.3f} {y:.3f}l{length * c:.3f} {length * s:.3f}"
    return f'<path d="{ray}" stroke="{ink}" stroke-width="{1.5 / scale:.4f}"/>'
