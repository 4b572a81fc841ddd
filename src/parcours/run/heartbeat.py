"""Words that a worker shares with its parent -> which case it is on, and whether what it runs there has hung or died.

Code of strangers may hang where no signal reaches it, or take its process down. So a study that runs such code writes
into a shared array where it is; the parent ends a worker that stays too long, and the cases lost are told to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

CASE, TIME, LIMIT = range(3)
"""The words: number of the case, or NO_CASE; how far it is [ns]; how long it may stay there [s of wall clock]."""

NO_CASE = -1.0
"""The word CASE while no stranger's code is run."""

POLL = 0.1
"""How often a parent looks [s]."""

Words = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LostCase:
    """A case that cannot be computed, because it hung or took its process down.

    Attributes:
        number: of the case.
        time: how far it had come [ns].
        how: which of the two.
        detail: in words, for its facts.
    """

    number: int
    time: int
    how: Literal["hung", "died"]
    detail: str


@runtime_checkable
class RunsStrangers(Protocol):
    """A study's function that runs code which may hang or take its process down, and says where it is."""

    @property
    def heartbeat_words(self) -> int:
        """How many words it shares, at least 3."""

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same function, which does not run the lost cases but gives their facts as errors."""


_shared: Words | None = None


def share(words: Words) -> None:
    """Make the parent's array this process's own; called once when a worker begins."""
    global _shared
    _shared = words
    words[CASE] = NO_CASE


def words(size: int) -> Words:
    """Return the array that is shared with the parent if there is one of that size, else a new one, shape (size,)."""
    if _shared is not None and len(_shared) >= size:
        return _shared
    fresh = np.zeros(size)
    fresh[CASE] = NO_CASE
    return fresh


class Watch:
    """The parent's view of one worker: how often it was found at the same place.

    Looks are counted, not seconds, so that a campaign that is stopped as a whole (Ctrl-Z) does not count as hung.
    """

    def __init__(self, words: Words) -> None:
        self._words = words
        self._seen = (NO_CASE, 0.0)
        self._looks = 0

    def has_hung(self) -> bool:
        """Return whether the worker has stayed at one place for half as long again as it may.

        Each call counts as POLL: a caller lets at least so much time pass between two.
        """
        now = (float(self._words[CASE]), float(self._words[TIME]))
        self._looks = self._looks + 1 if now == self._seen else 0
        self._seen = now
        return now[0] != NO_CASE and self._looks * POLL > 1.5 * float(self._words[LIMIT]) + 0.5

    def lost(self, how: Literal["hung", "died"], detail: str) -> LostCase | None:
        """Return the case on which the worker was when it ended; None if it was on none."""
        number = float(self._words[CASE])
        if number == NO_CASE:
            return None
        return LostCase(int(number), int(self._words[TIME]), how, detail)
