"""ORCA's half-planes: walls against the definition, and RVO2 beside them. Bodies are tested with the planner."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from parcours_navigation.others import half_planes
from parcours_navigation.protocol import Floats

places = st.floats(-4.0, 4.0)
speeds = st.floats(-2.0, 2.0)


def test_half_planes_of_walls_are_kept_where_those_of_bodies_cannot_be() -> None:
    wall = [-1.0, 0.0, -0.1]  # at most 0.1 m/s to the right
    pushed = [1.0, 0.0, 1.0]  # at least 1 m/s to the right
    planes = np.array([wall, pushed, [0.0, 1.0, 0.2]])
    x, y = half_planes.new_velocity(planes, np.empty_like(planes), 3, 1, 0.0, 0.0, 1.5)
    assert x == pytest.approx(0.1)
    assert 0.2 - y <= 0.9 + 1e-12  # as much as the other one is broken
    x, _ = half_planes.new_velocity(planes, np.empty_like(planes), 3, 0, 0.0, 0.0, 1.5)
    assert x == pytest.approx(0.55)


def touches(a: Floats, b: Floats, v: Floats, reach: float, horizon: float) -> float:
    """Return by how much a body that leaves the origin at v comes nearer to the wall than `reach` [m]."""
    at = v[None] * np.linspace(0.0, horizon, 2001)[:, None]
    d = b - a
    square = float(d @ d)
    t = np.clip((at - a) @ d / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(at))
    return reach - float(np.linalg.norm(at - a - t[:, None] * d, axis=1).min())


@given(places, places, places, places, speeds, speeds, st.floats(0.1, 0.5), st.floats(0.5, 3.0), st.booleans())
def test_the_border_of_what_a_wall_permits_is_the_border_of_what_hits_it(
    ax: float, ay: float, bx: float, by: float, vx: float, vy: float, reach: float, horizon: float, is_post: bool
) -> None:
    a, b, v = np.array([ax, ay]), np.array([ax, ay] if is_post else [bx, by]), np.array([vx, vy])
    assume(is_post or math.dist(a, b) > 0.05)
    assume(touches(a, b, np.zeros(2), reach, horizon) < -0.02)
    nx, ny, border = half_planes.wall_plane(a[0], a[1], b[0], b[1], reach, horizon, vx, vy)
    n = np.array([nx, ny])
    assert math.hypot(nx, ny) == pytest.approx(1.0)
    short = border - float(n @ v)
    hits = touches(a, b, v, reach, horizon)
    # It is forbidden if it hits, and where it does not, the half-plane holds all that hits: none of it is permitted.
    assert (short > 0.0) == (hits > 0.0) or abs(short) < 0.02
    foot = v + short * n
    assert abs(touches(a, b, foot + 1e-9 * n, reach, horizon)) < 0.02 * max(1.0, horizon)
    if hits < 0.0:
        for angle in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
            other = foot + 0.5 * np.array([math.cos(angle), math.sin(angle)])
            if touches(a, b, other, reach, horizon) > 0.01:
                assert float(n @ other) <= border + 1e-9


def test_a_body_in_a_wall_may_go_along_it_and_away_only() -> None:
    nx, ny, border = half_planes.wall_plane(-1.0, 0.1, 1.0, 0.1, 0.3, 1.0, 0.5, 0.5)
    assert (nx, ny, border) == (0.0, -1.0, 0.0)


def test_half_planes_and_velocities_agree_with_rvo2() -> None:
    import pyrvo

    rng = np.random.default_rng(7)
    lines = 0
    for _ in range(300):
        rvo = pyrvo.RVOSimulator()
        rvo.set_time_step(0.05)
        n, radius, horizon, top = int(rng.integers(2, 9)), 0.3, 3.0, 1.7
        rvo.set_agent_defaults(100.0, 20, horizon, 1.0, radius, top)
        # float32, as RVO2 has it
        at, v = rng.uniform(-3, 3, (n, 2)).astype("f4"), rng.uniform(-1.2, 1.2, (n, 2)).astype("f4")
        want = rng.uniform(-1.2, 1.2, 2).astype("f4")
        for i in range(n):
            rvo.add_agent(at[i].tolist())
            rvo.set_agent_velocity(i, v[i].tolist())
            rvo.set_agent_pref_velocity(i, want.tolist())
        rvo.do_step()
        order = sorted(range(1, n), key=lambda j: float(((at[j].astype(float) - at[0]) ** 2).sum()))
        planes = np.empty((n - 1, 3))
        for k, j in enumerate(order):
            p, u = (at[j].astype(float) - at[0]), (v[0].astype(float) - v[j])
            ux, uy, nx, ny = half_planes.half_plane(p[0], p[1], u[0], u[1], 2 * radius, horizon, 0.05)
            planes[k] = nx, ny, (v[0, 0] + 0.5 * ux) * nx + (v[0, 1] + 0.5 * uy) * ny
            (dx, dy), (px, py) = rvo.get_agent_orca_line(0, k)  # direction, point
            assert (nx, ny) == pytest.approx((-dy, dx), abs=2e-4)
            assert planes[k, 2] == pytest.approx(-dy * px + dx * py, abs=1e-3)
            lines += 1
        x, y = map(float, want)
        if half_planes.nearest_permitted(planes, n - 1, top, x, y, False)[0] == n - 1:
            mine = half_planes.new_velocity(planes, np.empty_like(planes), n - 1, 0, x, y, top)
            assert mine == pytest.approx(rvo.get_agent_velocity(0).to_tuple(), abs=2e-3)
    assert lines > 900


def test_half_planes_of_walls_agree_with_rvo2() -> None:
    import pyrvo

    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(400):
        a, b = rng.uniform(-2.5, 2.5, (2, 2)).astype("f4")
        vx, vy = map(float, rng.uniform(-1.2, 1.2, 2).astype("f4"))
        if touches(a.astype(float), b.astype(float), np.zeros(2), 0.35, 1.0) > 0.0:
            continue
        rvo = pyrvo.RVOSimulator()
        rvo.set_time_step(0.05)
        rvo.set_agent_defaults(100.0, 20, 3.0, 1.5, 0.3, 3.0)
        rvo.add_obstacle([a.tolist(), b.tolist()])
        rvo.process_obstacles()
        rvo.add_agent((0.0, 0.0))
        rvo.set_agent_velocity(0, (vx, vy))
        rvo.set_agent_pref_velocity(0, (vx, vy))
        rvo.do_step()
        mine = half_planes.wall_plane(float(a[0]), float(a[1]), float(b[0]), float(b[1]), 0.3, 1.5, vx, vy)
        theirs = []  # both sides of the wall are one
        for k in range(rvo.get_agent_num_orca_lines(0)):
            (dx, dy), (px, py) = rvo.get_agent_orca_line(0, k)
            theirs.append((-dy, dx, -dy * px + dx * py))
        assert any(plane == pytest.approx(mine, abs=1e-3) for plane in theirs)
        compared += 1
    assert compared > 200
