"""Questions to the ground: what they cost, how that grows with walls, and a million random pairs against shapely.

python bench/bench_ground.py                   a million pairs of each kind: some minutes, most of them shapely's
python bench/bench_ground.py --pairs 20000     fewer

Times are processor time. The scan has 360 beams; its ground is of 100 segments and 20 discs that move. Growth keeps the
density: ten times the walls lie on ten times the area, so a robot has the same surroundings; `crowded` keeps the area.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.ground.clearance import at_least, clearance, first_touch, least_on_way, sees
from parcours_navigation.ground.footprint import TOLERANCE, footprint_disc_least, footprint_least, footprint_to_disc
from parcours_navigation.ground.generators.fields import barn, cylinders, warehouse
from parcours_navigation.ground.generators.indoor import corridor, doorway, office
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.outlines import Floats, convex
from parcours_navigation.ground.shapes import segment_to_segment
from parcours_navigation.sensing.scan import scan

WALLS = (10, 30, 100, 300, 1000)
CAR = convex([[-0.4, -0.25], [0.9, -0.25], [0.9, 0.25], [-0.4, 0.25]])
POSES = 50
"""Poses of a way that shapely is asked about."""


def strewn(n: int, size: float, seed: int = 0) -> Ground:
    """Return n segments, of which a third are edges of boxes, in a square with bounds."""
    rng = np.random.default_rng(seed)
    n_boxes = n // 12
    walls = n - 4 * n_boxes - 4
    start = rng.uniform(0.0, size, (walls, 2))
    angle = rng.uniform(-math.pi, math.pi, walls)
    long = rng.uniform(0.3, 2.0, walls)
    ends = start + long[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    corners = rng.uniform(0.0, size - 1.0, (n_boxes, 2))
    sides = rng.uniform(0.2, 1.0, (n_boxes, 2))
    boxes = [
        place + side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) for place, side in zip(corners, sides, strict=True)
    ]
    return lay_ground(np.clip(np.hstack([start, ends]), 0.0, size), solids=boxes, bounds=[0.0, 0.0, size, size])


@kernel
def ask(what: int, packed: Record, corners: Record, discs: Record, places: Record, ranges: Record) -> float:
    """Ask one question at each place, x, y, heading, shape (n, 3); return something of the answers."""
    total = 0.0
    for i in range(len(places)):
        x, y, heading = places[i, 0], places[i, 1], places[i, 2]
        dx, dy = 0.01 * np.cos(heading), 0.01 * np.sin(heading)
        if what == 0:
            total += at_least(packed, x, y)
        elif what == 1:
            total += clearance(packed, x, y)
        elif what == 2:
            total += least_on_way(packed, x, y, x + dx, y + dy, 0.2, 0.1)
        elif what == 3:
            total += least_on_way(packed, x, y, x + dx, y + dy, 0.2, np.inf)
        elif what == 4:
            total += first_touch(packed, x, y, x + 100.0 * dx, y + 100.0 * dy, 0.2)
        elif what == 5:
            total += 1.0 if sees(packed, x, y, x + 300.0 * dx, y + 300.0 * dy) else 0.0
        elif what == 6:
            total += footprint_least(packed, corners, x, y, heading, x + dx, y + dy, heading + 0.01, 0.1)
        elif what == 7:
            total += footprint_disc_least(
                corners, x, y, heading, x + dx, y + dy, heading + 0.01, x + 1.0, y, x + 0.99, y, 0.3, 0.5
            )
        else:
            scan(packed, discs, x, y, heading, -3.141592653589793, 0.017453292519943295, 10.0, ranges)
            total += ranges[0] if ranges[0] < 10.0 else 0.0
    return total


QUESTIONS = (
    "bound of clearance", "clearance", "tick, enough 0.1 m", "tick, exact", "first touch, 1 m", "sight, 3 m",
    "footprint, tick", "footprint to disc", "scan, 360 beams",
)  # fmt: skip


def cost(what: int, ground: Ground, size: float, n: int = 2000, tries: int = 5) -> float:
    """Return the processor time of one question [us], best of several runs."""
    rng = np.random.default_rng(7)
    packed, discs, ranges = (
        ground.pack(),
        np.column_stack([rng.uniform(0, size, (20, 2)), np.full(20, 0.25)]),
        np.empty(360),
    )
    places = np.column_stack([rng.uniform(0.0, size, (n, 2)), rng.uniform(-math.pi, math.pi, n)])
    best = math.inf
    for _ in range(tries):
        begun = time.process_time()
        ask(what, packed, CAR, discs, places, ranges)
        best = min(best, time.process_time() - begun)
    return 1e6 * best / n


def growth() -> None:
    """Print what each question costs on grounds of 10 to 1000 walls."""
    ask(0, lay_ground().pack(), CAR, np.empty((0, 3)), np.empty((0, 3)), np.empty(360))
    for name, area in (("same density", lambda n: 1.0 * n), ("crowded", lambda n: 100.0)):
        print(f"\nmicroseconds a question, {name}; walls:" + "".join(f"{n:>9}" for n in WALLS) + "   1000 / 10")
        grounds = [(strewn(n, math.sqrt(area(n)) + 2.0), math.sqrt(area(n)) + 2.0) for n in WALLS]
        for what, question in enumerate(QUESTIONS):
            costs = [cost(what, ground, size) for ground, size in grounds]
            print(
                f"{question:>38}" + "".join(f"{each:>9.3f}" for each in costs) + f"{costs[-1] / costs[0]:>9.1f} x",
                flush=True,
            )
        packing = []
        for ground, _ in grounds:
            begun = time.process_time()
            for _ in range(3):
                ground.pack()
            packing.append(1e6 * (time.process_time() - begun) / 3)
        print(f"{'packing':>38}" + "".join(f"{each:>9.0f}" for each in packing) + f"{packing[-1] / packing[0]:>9.1f} x")
        print(f"{'numbers packed':>38}" + "".join(f"{len(ground.pack()):>9}" for ground, _ in grounds))


def generators() -> None:
    """Print what the generators cost."""
    print("\nmilliseconds a site, 20 seeds")
    for generate in (corridor, doorway, office, cylinders, barn, warehouse):
        generate(0)
        begun = time.process_time()
        for seed in range(20):
            generate(seed)
        print(f"{generate.__name__:>38}{1e3 * (time.process_time() - begun) / 20:>9.2f}", flush=True)


@kernel
def _segments(pairs: Record, found: Record) -> None:
    for i in range(len(pairs)):
        p = pairs[i]
        found[i] = np.sqrt(segment_to_segment(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]))


@kernel
def _points(packed: Record, places: Record, found: Record) -> None:
    for i in range(len(places)):
        found[i] = clearance(packed, places[i, 0], places[i, 1])


@kernel
def _ways(packed: Record, places: Record, found: Record) -> None:
    for i in range(len(places)):
        p = places[i]
        found[i] = least_on_way(packed, p[0], p[1], p[2], p[3], 0.2, np.inf)


@kernel
def _touches(packed: Record, places: Record, found: Record) -> None:
    for i in range(len(places)):
        p = places[i]
        found[i] = first_touch(packed, p[0], p[1], p[2], p[3], 0.2)


@kernel
def _footprints(packed: Record, corners: Record, places: Record, found: Record) -> None:
    for i in range(len(places)):
        x, y, heading = places[i, 0], places[i, 1], places[i, 2]
        found[i] = footprint_least(packed, corners, x, y, heading, x, y, heading, np.inf)


@kernel
def _discs(corners: Record, places: Record, found: Record) -> None:
    for i in range(len(places)):
        found[i] = footprint_to_disc(corners, 0.0, 0.0, places[i, 2], places[i, 0], places[i, 1], 0.3)


def compare(
    name: str, n: int, ours: Callable[[Floats], None], theirs: Callable[[], Floats], allowed: float = 1e-9
) -> None:
    """Print processor time of both, and how often and how far they disagree."""
    found = np.empty(n)
    ours(np.empty(1))
    begun = time.process_time()
    ours(found)
    our_time = time.process_time() - begun
    begun = time.process_time()
    wanted = theirs()
    their_time = time.process_time() - begun
    off = np.abs(found - wanted)
    print(
        f"{name:>38} {1e6 * our_time / n:>8.3f} us {1e6 * their_time / n:>8.3f} us {their_time / our_time:>7.1f} x"
        f" {int((off > allowed).sum()):>8} of {n}, at most {off.max():.1e} m",
        flush=True,
    )


@kernel
def _swept(packed: Record, corners: Record, before: Record, after: Record, found: Record) -> None:
    for i in range(len(before)):
        p, q = before[i], after[i]
        found[i] = footprint_least(packed, corners, p[0], p[1], p[2], q[0], q[1], q[2], np.inf)


def turned(places: Floats) -> NDArray[np.object_]:
    """Return the car's footprint at each place."""
    c, s = np.cos(places[:, 2])[:, None], np.sin(places[:, 2])[:, None]
    x = places[:, :1] + c * CAR[:, 0] - s * CAR[:, 1]
    y = places[:, 1:2] + s * CAR[:, 0] + c * CAR[:, 1]
    return np.asarray(shapely.polygons(np.stack([x, y], axis=-1)))


def against_shapely(n: int) -> None:
    """Print times and disagreements on n random pairs of each kind."""
    print(f"\n{'':>38} {'ours':>8}    {'shapely':>8}     ratio  disagreements beyond 1e-9 m")
    rng = np.random.default_rng(11)
    pairs = rng.uniform(-1.0, 1.0, (n, 8))
    pairs[::4] = np.round(pairs[::4] * 4.0) / 4.0  # parallel, touching and crossing exactly
    lines = shapely.linestrings(pairs.reshape(-1, 2, 2)).reshape(-1, 2)
    compare(
        "segment and segment",
        n,
        lambda f: _segments(pairs[: len(f)], f),
        lambda: shapely.distance(lines[:, 0], lines[:, 1]),
    )
    places = np.column_stack([rng.uniform(-3.0, 3.0, (n, 2)), rng.uniform(-math.pi, math.pi, n)])
    points = shapely.points(places[:, :2])
    zero = places * np.array([0.0, 0.0, 1.0])
    bodies, disc = turned(zero), 0.3

    def to_disc() -> Floats:
        edge = shapely.distance(shapely.boundary(bodies), points)
        return np.where(shapely.contains(bodies, points), -edge, edge) - disc

    compare("footprint and disc", n, lambda f: _discs(CAR, places[: len(f)], f), to_disc)
    size = 10.0
    ground = strewn(100, size)
    packed = ground.pack()
    places = np.column_stack([rng.uniform(-0.5, size + 0.5, (n, 2)), rng.uniform(-math.pi, math.pi, n)])
    edges = ground.solid_edges()
    solid = shapely.multilinestrings(list(shapely.linestrings(edges.reshape(-1, 2, 2))))
    walls = shapely.multilinestrings(list(shapely.linestrings(ground.segments.reshape(-1, 2, 2))))
    body = shapely.union_all([shapely.polygons(each) for each in ground.solids])
    assert ground.bounds is not None
    inside = shapely.difference(shapely.box(*ground.bounds), body)
    for part in (solid, walls, inside):
        shapely.prepare(part)
    points = shapely.points(places[:, :2])

    def to_ground() -> Floats:
        edge = shapely.distance(solid, points)
        return np.where(shapely.contains(inside, points), np.minimum(edge, shapely.distance(walls, points)), -edge)

    compare("point and ground of 100 walls", n, lambda f: _points(packed, places[: len(f)], f), to_ground)
    free = places[np.asarray(shapely.contains(inside, points))]
    ways = np.column_stack([free[:, :2], free[:, :2] + rng.uniform(-0.3, 0.3, (len(free), 2))])
    ways = ways[np.asarray(shapely.contains(inside, shapely.points(ways[:, 2:])))]
    chords = shapely.linestrings(ways.reshape(-1, 2, 2))
    everything = shapely.multilinestrings(
        list(shapely.linestrings(np.concatenate([edges, ground.segments]).reshape(-1, 2, 2)))
    )
    compare(
        "disc on a chord and ground", len(ways), lambda f: _ways(packed, ways[: len(f)], f),
        lambda: shapely.distance(everything, chords) - 0.2,
    )  # fmt: skip
    shares = np.empty(len(ways))
    _touches(packed, ways, shares)
    at = ways[:, :2] + np.minimum(shares, 1.0)[:, None] * (ways[:, 2:] - ways[:, :2])
    before = ways[:, :2] + np.maximum(np.minimum(shares, 1.0) - 1e-9, 0.0)[:, None] * (ways[:, 2:] - ways[:, :2])
    gap = shapely.distance(everything, shapely.points(at)) - 0.2
    free_until = shapely.distance(everything, shapely.linestrings(np.stack([ways[:, :2], before], axis=1))) - 0.2
    wrong = ((shares <= 1.0) & (gap > 1e-9)) | ((shares > 0.0) & (free_until < -1e-9))
    print(f"{'first touch of a disc':>38} wrong by shapely's distances: {int(wrong.sum())} of {len(ways)}")
    n = min(n, len(places))
    footprints = turned(places)

    def to_footprint() -> Floats:
        apart = np.minimum(shapely.distance(solid, footprints), shapely.distance(walls, footprints))
        return np.where(shapely.contains(inside, points), apart, 0.0)

    starts_in = ~np.asarray(
        shapely.contains(inside, shapely.points(shapely.get_coordinates(footprints).reshape(n, 5, 2)[:, 0]))
    )

    def ours(found: Floats) -> None:
        _footprints(packed, CAR, places[: len(found)], found)
        np.maximum(found, 0.0, out=found)

    compare("footprint and ground", n, ours, lambda: np.where(starts_in, 0.0, to_footprint()))
    on_the_way(packed, everything, max(n // POSES, 2))


def on_the_way(packed: Floats, everything: shapely.Geometry, n: int) -> None:
    """Print how n footprints that move and turn agree with shapely's distances at POSES poses of each way."""
    rng = np.random.default_rng(13)
    before = np.column_stack([rng.uniform(1.0, 9.0, (n, 2)), rng.uniform(-math.pi, math.pi, n)])
    move = np.column_stack([rng.uniform(-0.2, 0.2, (n, 2)), rng.uniform(-0.5, 0.5, n)])
    found = np.empty(n)
    _swept(packed, CAR, before[:1], before[:1] + move[:1], found[:1])
    begun = time.process_time()
    _swept(packed, CAR, before, before + move, found)
    taken = time.process_time() - begun
    least = np.full(n, math.inf)
    for k in range(POSES):
        footprints = turned(before + k / (POSES - 1) * move)
        least = np.minimum(least, shapely.distance(everything, footprints))
    # Between two poses no corner goes farther than this.
    gone = (np.hypot(move[:, 0], move[:, 1]) + np.abs(move[:, 2]) * 0.95) / (POSES - 1)
    known = least > 0.0  # where poses overlap a wall, or start in a body, both say 0
    above, below = (found - least)[known], (least - gone - found)[known]
    wrong = int((above > TOLERANCE).sum() + (below > TOLERANCE).sum() + (found[~known] > TOLERANCE).sum())
    high = max(above.max(), 0.0)
    print(
        f"{'footprint that moves and turns':>38} {1e6 * taken / n:>8.3f} us; beyond what {POSES} poses allow: {wrong}"
        f" of {n}; above the nearest pose by {high:.1e} m at most (allowed {TOLERANCE:.0e} m)"
    )


def main() -> None:
    """Print three tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1_000_000, help="random pairs of each kind")
    chosen = parser.parse_args()
    if chosen.pairs < 100:
        parser.error(f"--pairs must be at least 100, but is {chosen.pairs}")
    ground, size = strewn(100, 10.0), 10.0
    ask(8, ground.pack(), CAR, np.zeros((1, 3)), np.zeros((1, 3)), np.empty(360))
    print(
        f"scan of 360 beams, ground of 100 segments, 20 discs: {cost(8, ground, size, n=20_000):.2f} us, against 20 us"
    )
    growth()
    generators()
    against_shapely(chosen.pairs)


if __name__ == "__main__":
    main()
