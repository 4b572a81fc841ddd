"""Naive twins of the kernels of the ground: plain Python over all shapes, no grid, no buckets."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from parcours_navigation.ground.ground import Ground, lay_ground

Point = tuple[float, float]


def to_segment(p: Point, a: Point, b: Point) -> float:
    """Return the distance from a point to a segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    share = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy) if dx * dx + dy * dy > 1e-280 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(p[0] - a[0] - share * dx, p[1] - a[1] - share * dy)


def turned(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    return turned(a, b, c) * turned(a, b, d) < 0 and turned(c, d, a) * turned(c, d, b) < 0


def between_segments(a: Point, b: Point, c: Point, d: Point) -> float:
    """Return the distance between two segments."""
    if meet(a, b, c, d):
        return 0.0
    return min(to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b))


def inside(p: Point, corners: np.ndarray) -> bool:
    """Return whether a point is in a polygon, by the ray to the right."""
    found = False
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if (ay <= p[1]) != (by <= p[1]) and ax + (p[1] - ay) / (by - ay) * (bx - ax) > p[0]:
            found = not found
    return found


def is_solid(ground: Ground, p: Point) -> bool:
    """Return whether a point lies in a solid body or out of bounds."""
    out = ground.bounds is not None and not bool(
        ground.bounds[0] <= p[0] < ground.bounds[2] and ground.bounds[1] <= p[1] < ground.bounds[3]
    )
    return out or any(inside(p, corners) for corners in ground.solids)


def pairs(edges: np.ndarray) -> list[tuple[Point, Point]]:
    return [((e[0], e[1]), (e[2], e[3])) for e in edges.tolist()]


def clearance(ground: Ground, p: Point) -> float:
    """Return the distance to what is nearest, as `ground.clearance` has it."""
    discs = [math.hypot(p[0] - x, p[1] - y) - r for x, y, r in ground.discs.tolist()]
    solid = [to_segment(p, a, b) for a, b in pairs(ground.solid_edges())]
    if is_solid(ground, p):
        return float(min([-min(solid), *discs]))
    return min([*solid, *(to_segment(p, a, b) for a, b in pairs(ground.segments)), *discs], default=math.inf)


def least_on_way(ground: Ground, p: Point, q: Point, radius: float) -> float:
    """Return the least clearance of a disc on a chord."""
    edges = pairs(ground.solid_edges()) + pairs(ground.segments)
    found = [between_segments(p, q, a, b) for a, b in edges]
    found += [to_segment((x, y), p, q) - r for x, y, r in ground.discs.tolist()]
    found += [clearance(ground, end) for end in (p, q) if is_solid(ground, end)]
    return min(found, default=math.inf) - radius


def ray(x: float, y: float, angle: float, edges: list[tuple[Point, Point]], discs: list[list[float]]) -> float:
    """Return how far a beam goes."""
    c, s = math.cos(angle), math.sin(angle)
    found = [math.inf]
    for (ax, ay), (bx, by) in edges:
        ex, ey = bx - ax, by - ay
        across = c * ey - s * ex
        if across == 0.0:
            continue
        t = ((ax - x) * ey - (ay - y) * ex) / across
        u = ((ax - x) * s - (ay - y) * c) / across
        if t >= 0.0 and 0.0 <= u <= 1.0:
            found.append(t)
    for dx, dy, r in discs:
        along, off = c * (dx - x) + s * (dy - y), c * (dy - y) - s * (dx - x)
        if math.hypot(dx - x, dy - y) <= r:
            found.append(0.0)
        elif along > 0.0 and abs(off) <= r:
            found.append(along - math.sqrt(r * r - off * off))
    return min(found)


@st.composite
def grounds(draw: st.DrawFn) -> Ground:
    """Return grounds of a few walls, bodies and discs, on round and on odd numbers, with and without bounds."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n_walls, n_discs, n_solids = draw(st.integers(0, 12)), draw(st.integers(0, 6)), draw(st.integers(0, 4))
    is_round = draw(st.booleans())

    def places(*shape: int) -> np.ndarray:
        found: np.ndarray = rng.uniform(0.0, 8.0, shape)
        return np.round(found * 2.0) / 2.0 if is_round else found

    walls = places(n_walls, 4)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    discs = np.column_stack([places(n_discs, 2), rng.uniform(0.1, 0.8, n_discs)])
    return lay_ground(
        walls, discs, [star(rng, places(2), is_round) for _ in range(n_solids)],
        bounds=[0.0, 0.0, 8.0, 8.0] if draw(st.booleans()) else None,
    )  # fmt: skip


def star(rng: np.random.Generator, middle: np.ndarray, is_box: bool) -> np.ndarray:
    """Return corners of a polygon round a place that need not be convex, or of a box."""
    if is_box:
        wide, high = rng.integers(1, 4, 2) * 0.5
        corners: np.ndarray = middle + np.array([[0.0, 0.0], [wide, 0.0], [wide, high], [0.0, high]])
        return corners
    n = int(rng.integers(3, 9))
    angles = (np.arange(n) + rng.uniform(0.0, 0.9, n)) * (2.0 * math.pi / n)
    around: np.ndarray = middle + rng.uniform(0.3, 1.5, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return around
