"""A ground with a start and a goal that suit it, drawn until a disc gets from one to the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours.streams import Stream, below, between, start
from parcours_navigation.ground.connected import is_connected
from parcours_navigation.ground.ground import Ground
from parcours_navigation.ground.outlines import FARTHEST, BadGround, Floats

ATTEMPTS = 1000
"""Grounds that are drawn at most until one is connected; fewer of large ones."""

_MOST_DRAWN = 2_000_000  # random things in all attempts, beyond the first: so refusing takes seconds, not hours


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """A ground and a task on it."""

    ground: Ground
    start: tuple[float, float, float]  # x, y, heading [m, m, rad]
    goal: tuple[float, float]  # [m]
    area: Floats  # where other bodies may be put, x0, y0, x1, y1 [m], shape (4,)


@dataclass(slots=True)
class Draw:
    """Random numbers of one attempt."""

    stream: Stream

    def between(self, low: float, high: float) -> float:
        """Return a number uniform on [low, high)."""
        return between(self.stream, low, high)

    def below(self, n: int) -> int:
        """Return a whole number uniform on 0 .. n - 1."""
        return below(self.stream, n)

    def chance(self, share: float) -> bool:
        """Return True with a probability."""
        return between(self.stream, 0.0, 1.0) < share

    def chances(self, share: float, n: int) -> NDArray[np.bool_]:
        """Return what n calls of `chance` would, shape (n,)."""
        found = np.empty(n, np.bool_)
        _fill_chances(self.stream, share, found)
        return found


@kernel
def _fill_chances(stream: Stream, share: float, found: Record) -> None:
    for k in range(len(found)):
        found[k] = between(stream, 0.0, 1.0) < share


def drawn(name: str, seed: int, purpose: int, radius: float, draw: Callable[[Draw], Site], things: int = 1) -> Site:
    """Return the first of the sites drawn for a seed on which a disc certainly gets from start to goal.

    Args:
        name: of the generator, for messages.
        seed: 0 <= seed < 2**64. Attempt k draws from the stream (seed, k, purpose).
        purpose: of the generator's streams.
        radius: of the disc [m].
        draw: the generator.
        things: how many random things it draws for one ground, about.

    Raises:
        BadGround: the seed does not fit, or no site is connected.
    """
    if not 0 <= seed < 2**64:
        raise BadGround(name, f"a seed is a whole number from 0 to 2**64 - 1, but {seed} was given", slug="seed")
    stream, attempts = np.zeros(1, np.uint64), max(1, min(ATTEMPTS, _MOST_DRAWN // max(things, 1)))
    for attempt in range(attempts):
        start(stream, np.uint64(seed), np.uint64(attempt), np.uint64(purpose))
        site = draw(Draw(stream))
        if is_connected(site.ground.pack(), site.area, site.start[:2], site.goal, radius):
            return site
    rule = (
        f"a disc of {radius:g} m must get from start to goal, but in none of {attempts} grounds of seed {seed} it does"
    )
    raise BadGround(name, rule, "take fewer or smaller obstacles, or a smaller radius", slug="ground-connected")


def require(name: str, low: float, high: float, **given: float) -> None:
    """Raise BadGround unless the given parameters of a generator are from low to high; at most FARTHEST anyway."""
    for parameter, value in given.items():
        if not low <= value <= min(high, FARTHEST):
            rule = f"it must be from {low:g} to {min(high, FARTHEST):g}, but is {value}"
            raise BadGround(f"{name}, {parameter}", rule, slug="ground-range")


def box(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Return the corners of a rectangle [m], shape (4, 2)."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
