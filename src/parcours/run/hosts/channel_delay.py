"""How long messages travel and work takes, and what gets lost: inputs of a host, drawn from seeded streams.

All times are whole nanoseconds. Nothing is late, lost or overtaken unless it is said here.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.errors import BadRequest

Latency = Callable[[np.random.Generator], int]
"""Draws how long one message travels [ns]."""

Execution = Callable[[str, str, np.random.Generator], int]
"""Draws how long a component works on one transition [ns], given both names."""


@dataclass(frozen=True, slots=True)
class ChannelDelay:
    """How messages travel on one channel.

    `drop` is the probability that a message is lost. If `reorder` is false, a message that draws a short
    latency still arrives after the ones before it.
    """

    latency: Latency
    drop: float = 0.0
    reorder: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.drop <= 1.0:
            raise BadRequest("channel_delay", f"drop is a probability, but was given as {self.drop}", slug="drop-range")


def constant(time: int) -> Latency:
    """Return a latency that is always `time` [ns].

    >>> constant(1000)(np.random.default_rng(0))
    1000
    """
    return lambda rng: time


def uniform(low: int, high: int) -> Latency:
    """Return a latency uniform over low..high [ns], both included.

    >>> 5 <= uniform(5, 7)(np.random.default_rng(0)) <= 7
    True
    """
    return lambda rng: int(rng.integers(low, high, endpoint=True))


def measured(times: Sequence[int]) -> Latency:
    """Return a latency that draws one of the measured `times` [ns], each as likely as it occurs.

    >>> measured([4, 4])(np.random.default_rng(0))
    4
    """
    if not times:
        raise BadRequest("latency", "needs at least one measured time, but none was given", slug="latency-empty")
    kept = tuple(times)
    return lambda rng: kept[int(rng.integers(len(kept)))]


def at_once(component: str, transition: str, rng: np.random.Generator) -> int:
    """Return 0 [ns]: the execution time of work that takes none.

    >>> at_once("Planner", "p15", np.random.default_rng(0))
    0
    """
    return 0


class Streams:
    """One random stream a name, so that what one channel draws never depends on the traffic of another.

    Args:
        rng: gives the key from which all streams follow; one number is drawn, once.

    >>> a, b = (Streams(np.random.default_rng(7)) for _ in "ab")
    >>> _ = b["other"].random()
    >>> a["odometry"].random() == b["odometry"].random()
    True
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._key = int(rng.integers(2**63))
        self._streams: dict[str, np.random.Generator] = {}

    def __getitem__(self, name: str) -> np.random.Generator:
        if name not in self._streams:
            word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
            self._streams[name] = np.random.Generator(np.random.Philox(np.random.SeedSequence([self._key, word])))
        return self._streams[name]

    def restart(self) -> None:
        """Begin every stream again."""
        self._streams.clear()
