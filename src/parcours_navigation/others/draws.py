"""A stream of random numbers on the Python side: the words of `parcours.streams`, in order."""

from __future__ import annotations

import numpy as np

from parcours.elementary import TAU, log, sin_cos
from parcours.streams import starts, uniforms
from parcours_navigation.others.ranges import Box, Point


class Draws:
    """The numbers of one stream, in order: that of a seed, a case and a purpose."""

    def __init__(self, seed: int, case: int, purpose: int) -> None:
        self._start, self._first = starts(seed, np.array([case], np.int64), purpose), 0
        self._words: list[float] = []

    def number(self) -> float:
        """Return the next number, uniform on [0, 1)."""
        if not self._words:
            self._words = uniforms(self._start, self._first, 256)[0].tolist()[::-1]
            self._first += 256
        return self._words.pop()

    def between(self, low: float, high: float) -> float:
        """Return the next number, uniform on [low, high)."""
        return low + (high - low) * self.number()

    def normal(self) -> float:
        """Return the next number of a normal distribution, cut off at three standard deviations."""
        while True:
            radius = float(np.sqrt(-2.0 * log(1.0 - self.number())))
            value = radius * sin_cos(TAU * self.number())[1]
            if abs(value) <= 3.0:
                return value

    def point(self, box: Box) -> Point:
        """Return the next point of a box."""
        return self.between(box[0], box[2]), self.between(box[1], box[3])
