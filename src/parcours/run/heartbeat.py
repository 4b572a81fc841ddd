"""Memory that a worker shares with its parent, and in which it says where it is: which case, since when, or in words.

Foreign code may hang where no signal reaches it, or take its process down. So what runs such code writes here where it
is; the parent ends a worker that stays too long, and knows what it was at.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

CASE, TIME, LIMIT = range(3)
"""The words: number of the case, or NO_CASE; how far it is [ns]; how long it may stay there [s of wall clock]."""

NO_CASE = -1.0
"""The word CASE while no foreign code is run."""

POLL = 0.1
"""How often a parent looks [s]."""

_TEXT = 512
"""For the place in words [bytes]."""

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
_place: Any = None


def new_block(context: Any, n_words: int) -> Any:
    """Return memory for a worker of a multiprocessing context to share."""
    return context.RawArray(ctypes.c_double, [NO_CASE] * max(n_words, 3) + [0.0] * (_TEXT // 8))


def share(block: Any) -> None:
    """Make the parent's memory this process's own; called once when a worker starts."""
    global _shared, _place
    _shared, _place = _parts(np.frombuffer(block))


def _parts(block: Words) -> tuple[Words, NDArray[np.uint8]]:
    return block[: -_TEXT // 8], block[-_TEXT // 8 :].view(np.uint8)


def words(size: int) -> Words:
    """Return the array that is shared with the parent if there is one of that size, else a new one, shape (size,)."""
    if _shared is not None and len(_shared) >= size:
        return _shared
    fresh = np.zeros(size)
    fresh[CASE] = NO_CASE
    return fresh


def write_place(text: str) -> None:
    """Say in words what is started now; does nothing in a process that is no worker."""
    if _place is not None:
        _place[:] = np.frombuffer(text.encode()[: _TEXT - 1].ljust(_TEXT, b"\0"), np.uint8)


class Watch:
    """The parent's view of one worker: how often it was found at the same place.

    Looks are counted, not seconds, so that a campaign that is stopped as a whole (Ctrl-Z) does not count as hung.

    Args:
        block: shared with the worker.
        patience: how long the worker may give no sign of life while it is on no case [s].
    """

    def __init__(self, block: Any, patience: float = math.inf) -> None:
        self._words, self._place = _parts(np.frombuffer(block))
        self._patience = patience
        self._seen = (NO_CASE, 0.0, b"")
        self._looks = 0

    def has_hung(self) -> bool:
        """Return whether the worker has stayed at one place for longer than it may: on a case half as long again.

        Each call counts as POLL: a caller lets at least that time pass between two.
        """
        now = (float(self._words[CASE]), float(self._words[TIME]), self._place.tobytes())
        self._looks = self._looks + 1 if now == self._seen else 0
        self._seen = now
        limit = self._patience if now[0] == NO_CASE else 1.5 * float(self._words[LIMIT]) + 0.5
        return self._looks * POLL > limit

    def restart(self) -> None:
        """Count from here: the worker has given another sign of life."""
        self._looks = 0

    @property
    def place(self) -> str:
        """Where the worker was last, in its words."""
        return self._place.tobytes().rstrip(b"\0").decode("utf-8", "ignore")

    def lost(self, how: Literal["hung", "died"], detail: str) -> LostCase | None:
        """Return the case on which the worker was when it ended; None if it was on none."""
        number = float(self._words[CASE])
        if number == NO_CASE:
            return None
        return LostCase(int(number), int(self._words[TIME]), how, detail)
