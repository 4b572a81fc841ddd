"""Contact and clearance against shapely and against closed forms: standing, on lines, on arcs, whole random runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_navigation.arena.contact import contact_share, least_distance
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin

Floats = NDArray[np.float64]

SECOND = 1_000_000_000
ROBOT, DISC = 0.125, 0.1
REACH = ROBOT + DISC
ROUNDING = 1e-12

CHORD = 2e-5
"""How far two chords of one tick stray from their arcs [m]: 0.75 m/s * pi/2 rad/s * (0.01 s)^2 / 8, rounded up."""

SETTING_OUT = 1.5e-3
"""How much the tick in which an obstacle sets out or stops blurs clearance [m]: 0.5 m/s * 0.01 s / 4, rounded up."""

# To a nanometre: shapely's distances to far shorter segments are infinite.
places = st.floats(-2.0, 2.0).map(lambda place: round(place, 9))


def world(v: float, heading: float = 0.0, w: float = 0.0) -> Record:
    """Return a world whose robot already drives at (v, w) from the origin."""
    one = np.zeros(1, WORLD).view(np.recarray)[0]
    robot = one.robot
    robot.heading, robot.radius = heading, ROBOT
    robot.v = robot.command_v = v
    robot.w = robot.command_w = w
    robot.v_max, robot.w_max, robot.a_max, robot.alpha_max = 0.25, math.pi / 2, 1.0, 2 * math.pi / 3
    one.goal_x = one.goal_y = 99.0
    return one


def discs(*rows: tuple[float, float, float, float, float]) -> Record:
    """Return discs that move all the time, by (x, y, heading, speed, yaw rate)."""
    made = np.zeros(len(rows), OBSTACLE)
    for row, (x, y, heading, speed, turn) in zip(made, rows, strict=True):
        row["x0"], row["y0"], row["heading0"], row["speed"], row["turn"] = x, y, heading, speed, turn
        row["radius"], row["stop"] = DISC, 1000 * SECOND
    return made.view(np.recarray)


def run(one: Record, others: Record, seconds: float) -> Record:
    begin(one, others)
    advance(one, others, round(seconds * SECOND))
    return one


@given(places, places, places, places)
def test_least_distance_is_shapely_s_distance_to_the_segment(x0: float, y0: float, x1: float, y1: float) -> None:
    segment = shapely.LineString([(x0, y0), (x1, y1)])
    assert least_distance(x0, y0, x1, y1) == pytest.approx(shapely.Point(0.0, 0.0).distance(segment), abs=ROUNDING)


@settings(max_examples=500)
@given(places, places, places, places, st.floats(0.05, 1.0))
def test_contact_begins_where_shapely_finds_the_segment_to_enter_the_disc(
    x0: float, y0: float, x1: float, y1: float, reach: float
) -> None:
    segment, origin = shapely.LineString([(x0, y0), (x1, y1)]), shapely.Point(0.0, 0.0)
    gap = segment.distance(origin) - reach
    share = contact_share(x0, y0, x1, y1, reach)
    if gap > 1e-9:
        assert share == 2.0
    elif gap < -1e-9:
        assert 0.0 <= share <= 1.0
        # shapely's disc is a polygon: too small by a 2e-8th, and by that over the sine of the angle along the segment
        inside = segment.intersection(origin.buffer(reach, quad_segs=2048))
        assume(not inside.is_empty and gap < -1e-3 * reach)
        first = min(segment.project(shapely.Point(*place)) for place in inside.coords)
        assert share * segment.length == pytest.approx(first, abs=1e-5)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-2.0, 2.0), st.integers(1, 200)), min_size=1, max_size=8),
    st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
)
def test_a_robot_touches_a_standing_disc_if_and_only_if_its_swept_area_does(
    commands: list[tuple[float, float, int]], disc: tuple[float, float]
) -> None:
    assume(math.hypot(*disc) > REACH + 0.01)
    one, others = world(0.0), discs((*disc, 0.0, 0.0, 0.0))
    begin(one, others)
    track = [(0.0, 0.0)]
    for command_v, command_w, ticks in commands:
        one.robot.command_v, one.robot.command_w = command_v, command_w
        for _ in range(ticks):
            advance(one, others, int(one.now) + TICK)
            track.append((float(one.robot.x), float(one.robot.y)))
    way, body = shapely.LineString(track), shapely.Point(*disc)
    gap = way.distance(body) - REACH
    assert one.min_clearance == pytest.approx(gap, abs=ROUNDING)
    if abs(gap) > 1e-5:  # as fine as the buffers' polygons are
        swept = way.buffer(ROBOT, quad_segs=128).intersects(body.buffer(DISC, quad_segs=128))
        assert (one.t_contact != NEVER) == swept


@pytest.mark.parametrize("aside", [0.0, 0.1, 0.2, REACH - 1e-3, REACH - 1e-6, REACH - 1e-9])
def test_head_on_at_three_quarters_of_a_metre_a_second_every_phase_of_the_tick_finds_the_contact(aside: float) -> None:
    for offset in np.linspace(0.0, 0.0075, 33):
        ahead = 1.0 + float(offset)
        one = run(world(0.25), discs((ahead, aside, math.pi, 0.5, 0.0)), 3.0)
        touches = (ahead - math.sqrt(REACH**2 - aside**2)) / 0.75
        assert one.t_contact == pytest.approx(touches * SECOND, abs=20)
        assert one.min_clearance == pytest.approx(aside - REACH, abs=ROUNDING * 100)
        assert one.n_shared_contacts == 1


def test_a_robot_that_backs_off_and_comes_again_touches_when_its_way_says_so() -> None:
    # Between two looks the world skips what cannot matter yet: from 1 cm off and back to a quarter of a metre.
    one, others = world(0.25), discs((REACH + 0.26, 0.0, 0.0, 0.0, 0.0))
    one.robot.a_max = 1e9
    begin(one, others)
    way = [0.0]
    for command_v, ticks in ((0.25, 100), (-0.25, 100), (0.25, 150)):
        one.robot.command_v = command_v
        for _ in range(ticks):
            advance(one, others, int(one.now) + TICK)
            way.append(float(one.robot.x))
    k = int(np.argmax(np.array(way) >= 0.26))
    assert k > 200
    touches = (k - 1 + (0.26 - way[k - 1]) / (way[k] - way[k - 1])) * TICK
    assert one.t_contact == pytest.approx(touches, abs=20)
    assert one.min_clearance == pytest.approx(0.26 - max(way), abs=ROUNDING)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.35, 0.5, 0.99])
def test_a_disc_that_stops_within_a_tick_stands_where_it_stopped(share: float) -> None:
    one, others = world(0.0), discs((1.0, 0.0, math.pi, 0.5, 0.0))
    others.stop = 1 * SECOND + round(share * TICK)
    run(one, others, 3.0)
    gap = 1.0 - 0.5 * (1.0 + share * TICK / SECOND) - REACH
    assert one.min_clearance == pytest.approx(gap, abs=ROUNDING)
    assert others[0].x - REACH == pytest.approx(gap, abs=ROUNDING)


@pytest.mark.parametrize("beside", [1e-9, 1e-6, 1e-3, 0.1])
def test_head_on_a_pass_at_more_than_reach_is_no_contact_at_any_phase_of_the_tick(beside: float) -> None:
    for offset in np.linspace(0.0, 0.0075, 33):
        one = run(world(0.25), discs((1.0 + float(offset), REACH + beside, math.pi, 0.5, 0.0)), 3.0)
        assert one.t_contact == NEVER
        assert one.min_clearance == pytest.approx(beside, abs=ROUNDING * 100)


@given(st.floats(-3.1, 3.1), st.floats(0.0, 0.5), st.floats(0.3, 0.8), st.floats(-0.5, 0.5))
def test_on_straight_lines_contact_is_found_if_and_only_if_the_lines_come_within_reach(
    heading: float, speed: float, x: float, y: float
) -> None:
    closing = np.array([speed * math.cos(heading) - 0.25, speed * math.sin(heading)])
    gap = np.array([x, y])
    assume(math.hypot(x, y) > REACH)
    at = min(max(-float(gap @ closing) / max(float(closing @ closing), 1e-12), 0.0), 3.0)
    least = float(np.hypot(*(gap + at * closing))) - REACH
    one = run(world(0.25), discs((x, y, heading, speed, 0.0)), 3.0)
    assert one.min_clearance == pytest.approx(least, abs=1e-10)
    assume(abs(least) > 1e-10)
    assert (one.t_contact != NEVER) == (least < 0.0)


def on_arc(x: float, y: float, heading: float, speed: float, turn: float, time: Floats) -> Floats:
    """Return places on an arc, shape (n, 2), by the chord of the arc made so far."""
    half = 0.5 * turn * time
    chord = speed * time * np.sinc(half / math.pi)
    return np.stack([x + chord * np.cos(heading + half), y + chord * np.sin(heading + half)], axis=1)


yaw = st.floats(-math.pi / 2, math.pi / 2)


@settings(max_examples=50)
@given(places, places, st.floats(-3.1, 3.1), st.floats(0.0, 0.5), yaw, st.floats(0.05, 0.25), yaw)
def test_on_arcs_contact_is_found_if_and_only_if_the_arcs_come_within_reach(
    x: float, y: float, heading: float, speed: float, turn: float, v: float, w: float
) -> None:
    assume(math.hypot(x, y) > REACH + 0.01)
    time = np.linspace(0.0, 4.0, 40_001)
    gaps = np.hypot(*(on_arc(x, y, heading, speed, turn, time) - on_arc(0.0, 0.0, 0.0, v, w, time)).T) - REACH
    one = run(world(v, 0.0, w), discs((x, y, heading, speed, turn)), 4.0)
    assert one.min_clearance == pytest.approx(float(gaps.min()), abs=CHORD)
    assume(abs(gaps.min()) > CHORD)
    assert (one.t_contact != NEVER) == (gaps.min() < 0.0)
    if one.t_contact != NEVER:
        k = int(np.argmax(gaps < 0.0))
        closing = (gaps[k - 1] - gaps[k]) / 1e-4
        assert abs(one.t_contact - time[k] * SECOND) <= SECOND * (1e-4 + 2.0 * CHORD / max(closing, 1e-3))


def drive_at_random(seed: int) -> tuple[Record, Record, Floats]:
    """Drive 21 s by random commands among three discs that set out and stop; return world, discs, track (2101, 2)."""
    rng = np.random.default_rng(seed)
    one, others = world(0.249, math.pi / 4), np.zeros(3, OBSTACLE)
    others["x0"], others["y0"] = rng.uniform(0.4, 1.9, (2, 3))
    others["heading0"], others["turn"] = rng.uniform(-math.pi, math.pi, 3), rng.uniform(-1.5, 1.5, 3)
    others["speed"], others["radius"] = rng.uniform(0.1, 0.5, 3), DISC
    others["start"] = rng.integers(1 * SECOND, 6 * SECOND, 3)
    others["stop"] = others["start"] + rng.integers(2 * SECOND, 12 * SECOND, 3)
    begin(one, others)
    track = [(0.0, 0.0)]
    for _ in range(42):
        one.robot.command_v, one.robot.command_w = rng.uniform(-0.1, 0.3), rng.uniform(-1.6, 1.6)
        for _ in range(50):
            advance(one, others, int(one.now) + TICK)
            track.append((float(one.robot.x), float(one.robot.y)))
    return one, others, np.array(track)


def resampled(row: Record, track: Floats, per_tick: int = 8) -> tuple[Floats, Floats]:
    """Return (times [s], robot minus disc [m], (n, 2)) several times a tick: true arcs, and chords of the track."""
    time = np.linspace(0.0, (len(track) - 1) * 0.01, (len(track) - 1) * per_tick + 1)
    moved = np.clip(time, row["start"] / SECOND, row["stop"] / SECOND) - row["start"] / SECOND
    there = on_arc(row["x0"], row["y0"], row["heading0"], row["speed"], row["turn"], moved)
    ticks = np.arange(len(track)) * 0.01
    return time, np.stack([np.interp(time, ticks, track[:, k]) for k in (0, 1)], axis=1) - there


@pytest.mark.parametrize("seed", range(10))
def test_clearance_of_a_whole_run_is_shapely_s_on_the_densely_resampled_motion(seed: int) -> None:
    one, others, track = drive_at_random(seed)
    firsts, leasts = [], []
    for row in others:
        time, gap = resampled(row, track)
        steps = shapely.linestrings(np.stack([gap[:-1], gap[1:]], axis=1))
        distances = shapely.distance(steps, shapely.Point(0.0, 0.0)) - REACH
        when = time[np.argmin(distances)]
        moving = row["start"] / SECOND + 0.01 < when < row["stop"] / SECOND - 0.01
        leasts.append((distances.min(), CHORD if moving else CHORD + SETTING_OUT))
        firsts.extend(time[:-1][distances <= 0.0][:1])
    least, tolerance = min(leasts)
    assert one.min_clearance == pytest.approx(least, abs=tolerance)
    assert (one.t_contact != NEVER) == bool(firsts)
    if firsts:
        assert one.t_contact / SECOND == pytest.approx(min(firsts), abs=0.01)
    assert one.travelled == pytest.approx(shapely.LineString(track).length, abs=1e-9)


def test_among_the_random_runs_are_some_with_contact_and_some_without() -> None:
    touched = [drive_at_random(seed)[0].t_contact != NEVER for seed in range(10)]
    assert 2 <= sum(touched) <= 8
