"""The trapezoid profile: its invariants, and a twin that marches along the way in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours_ramp.planner.profile import along, reachable, trapezoid

Stretch = tuple[float, float, float, float, float]


@st.composite
def stretches(draw: st.DrawFn) -> Stretch:
    """Return (length, v0, v1, cap, acceleration) whose end speeds can be reached from each other."""
    length, acceleration = draw(st.floats(0.001, 4.0)), draw(st.floats(0.2, 3.0))
    cap = draw(st.floats(0.05, 1.5))
    v0 = cap * draw(st.floats(0.0, 1.0))
    least = math.sqrt(max(v0 * v0 - 2.0 * acceleration * length, 0.0))
    most = min(cap, math.sqrt(v0 * v0 + 2.0 * acceleration * length))
    v1 = least + (most - least) * draw(st.floats(0.0, 1.0))
    return length, v0, v1, cap, acceleration


def marched(length: float, v0: float, v1: float, cap: float, acceleration: float, n: int = 20_000) -> float:
    """Return the time of the fastest profile: at every place the greatest speed that all three limits allow."""
    way = (np.arange(n) + 0.5) * length / n
    speed = np.minimum(
        cap,
        np.minimum(np.sqrt(v0 * v0 + 2.0 * acceleration * way), np.sqrt(v1 * v1 + 2.0 * acceleration * (length - way))),
    )
    return float((length / n / speed).sum())


@given(stretches())
def test_the_profile_covers_exactly_the_length(stretch: Stretch) -> None:
    length, v0, v1, _, acceleration = stretch
    peak, up, hold, down = trapezoid(*stretch)
    assert min(up, hold, down) >= -1e-12
    way, speed = along(up + hold + down, v0, peak, up, hold, down, acceleration)
    assert way == pytest.approx(length, rel=1e-9, abs=1e-9)
    assert speed == pytest.approx(v1, abs=1e-7)


@given(stretches())
def test_speed_and_acceleration_keep_their_limits_and_way_is_the_area_under_speed(stretch: Stretch) -> None:
    _, v0, v1, cap, acceleration = stretch
    peak, up, hold, down = trapezoid(*stretch)
    assert max(v0, v1) <= peak <= cap + 1e-12
    times = np.linspace(0.0, up + hold + down, 400)
    profile = np.array([along(float(t), v0, peak, up, hold, down, acceleration) for t in times])
    way, speed = profile[:, 0], profile[:, 1]
    assert speed[0] == pytest.approx(v0, abs=1e-9)
    assert speed.max() <= cap + 1e-9
    assert speed.min() >= min(v0, v1) - 1e-7
    step = times[1]
    assert np.abs(np.diff(speed)).max() <= acceleration * step + 1e-9
    area = 0.5 * (speed[1:] + speed[:-1]) * np.diff(times)
    assert np.abs(np.diff(way) - area).max() <= acceleration * step * step + 1e-9


@given(stretches())
def test_nothing_that_keeps_the_limits_is_faster(stretch: Stretch) -> None:
    _, up, hold, down = trapezoid(*stretch)
    # The march misses the root-like start from rest by about a hundredth of a step's time.
    assert up + hold + down == pytest.approx(marched(*stretch), rel=0.01, abs=1e-4)


@given(st.floats(0.0, 1.0), st.floats(0.0, 3.0), st.floats(0.2, 3.0))
def test_reachable_is_its_own_inverse_by_braking(speed: float, length: float, acceleration: float) -> None:
    top = reachable(speed, length, acceleration)
    assert (top * top - speed * speed) / (2.0 * acceleration) == pytest.approx(length, abs=1e-9)


def test_after_its_end_the_profile_stands_where_it_ended() -> None:
    peak, up, hold, down = trapezoid(1.0, 0.0, 0.0, 0.5, 1.0)
    assert along(99.0, 0.0, peak, up, hold, down, 1.0) == along(up + hold + down, 0.0, peak, up, hold, down, 1.0)
