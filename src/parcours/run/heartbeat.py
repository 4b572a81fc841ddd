"""How a worker says where it is: which case, since when, or in words; and how its parent sees that it is stuck.

Foreign code may hang where no signal reaches it, or take its process down. So what runs such code says where it is; the
parent ends a worker that stays too long, and knows what it was at. Foreign code may also write where it must not: what
the parent believes of cases comes through a pipe, from which nothing said can be taken back, and the shared words can
only say that a case goes on.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

CASE, TIME, LIMIT = range(3)
"""The words: number of the case, or NO_CASE; how far it is [ns]; how long it may stay there [s of wall clock]. The
parent looks at TIME only."""

NO_CASE = -1.0
"""The number while no foreign code is run."""

MANY = 2.0**53
"""The number while several cases are at work at once: what is lost then is no single case."""

POLL = 0.1
"""How often a parent looks [s]."""

_TEXT = 512
"""For the place in words [bytes]."""

_ENTRY = struct.Struct("dd")
"""What goes through the pipe: the number of a case, and how long it may stay at one place [s]. The first entry is the
process itself, as a number below 0."""

_MOST_READS = 64
"""How often a parent reads at one look; a pipe holds what is read in one."""

_FARTHEST = 1e13  # no case is farther [ns]
_NEAREST = 1e7  # two signs of life are at least so far apart in simulated time [ns]

Words = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LostCase:
    """A case that cannot be computed, because it hung, took its process down, or changed what others rely on.

    Attributes:
        number: of the case.
        time: how far it had come [ns]; None where that is not known, or a matter of chance: what ends a process from
            outside takes effect some time after it was sent.
        how: which of them.
        detail: in words, for its facts.
        place: where the process said that it was, in its words; "" if it said nothing.
    """

    number: int
    time: int | None
    how: Literal["hung", "died", "tampered"]
    detail: str
    place: str = ""


@runtime_checkable
class RunsStrangers(Protocol):
    """A study's function that runs code which may hang or take its process down, and says where it is."""

    @property
    def heartbeat_words(self) -> int:
        """How many words it shares, at least 3."""

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same function, which does not run the lost cases but gives their facts as errors."""


@runtime_checkable
class Renumbered(Protocol):
    """A function of consecutive cases that stand for cases of other numbers."""

    @property
    def numbers(self) -> Sequence[int]:
        """The number of the case that each stands for."""


# Strangers' code may load this module a second time.
_shared: Words | None = globals().get("_shared")
_place: Any = globals().get("_place")
_pipe: int = globals().get("_pipe", -1)


def new_block(context: Any, n_words: int) -> Any:
    """Return memory for a worker of a multiprocessing context to share."""
    return context.RawArray(ctypes.c_double, [NO_CASE] * max(n_words, 3) + [0.0] * (_TEXT // 8))


def share(block: Any, pipe: int = -1) -> None:
    """Make the parent's memory and the pipe to it this process's own; called once when a worker starts."""
    global _shared, _place, _pipe
    _shared = _parts(np.frombuffer(block))[0]
    # Bytes of Python's own: the last words of a process in which nothing of NumPy's works any more go there.
    _place = memoryview(block).cast("B")[-_TEXT:]
    _pipe = pipe
    enter(-float(os.getpid()), math.inf)


def _parts(block: Words) -> tuple[Words, NDArray[np.uint8]]:
    return block[: -_TEXT // 8], block[-_TEXT // 8 :].view(np.uint8)


def words(size: int) -> Words:
    """Return the array that is shared with the parent if there is one of that size, else a new one, shape (size,)."""
    if _shared is not None and len(_shared) >= size:
        return _shared
    fresh = np.zeros(size)
    fresh[CASE] = NO_CASE
    return fresh


def write_last_place(block: Any, text: str) -> None:
    """Say in words how a worker ended, in the memory that it shared; for who has ended it."""
    memoryview(block).cast("B")[-_TEXT:] = _padded(text)


def case_in(block: Any) -> float:
    """Return the number of the case that a worker's memory holds; for who keeps that worker."""
    return float(block[CASE])


def _padded(text: str) -> bytes:
    return text.encode("utf-8", "replace")[: _TEXT - 1].ljust(_TEXT, b"\0")


def write_place(text: str, padded: Callable[[str], bytes] = _padded) -> None:
    """Say in words what is started now; does nothing in a process that is no worker."""
    if _place is not None:
        _place[:] = padded(text)  # by reference: it may be the last that works in a process that was changed


def enter(number: float, limit: float) -> None:
    """Say that a case is started now, or goes on, and that it may stay at one place for `limit` [s of wall clock].

    A number of NO_CASE says that no case is at work. Does nothing in a process that is no worker.
    """
    if _pipe >= 0:
        with contextlib.suppress(OSError):  # closed by foreign code: the canaries will say so
            os.write(_pipe, _ENTRY.pack(number, limit))


def leave() -> None:
    """Say that no case is at work."""
    enter(NO_CASE, math.inf)


class WorkerWatch:
    """The parent's view of one worker: how often it was found at the same place.

    Looks are counted, not seconds, so that a campaign that is stopped as a whole (Ctrl-Z) does not count as hung.

    Args:
        block: shared with the worker.
        pipe: the end of the worker's pipe to read from, which does not block; -1 for none.
        patience: how long the worker may give no sign of life while it is on no case [s].
    """

    def __init__(self, block: Any, pipe: int = -1, patience: float = math.inf) -> None:
        self._words, self._place = _parts(np.frombuffer(block))
        self._pipe, self._patience = pipe, patience
        self._case, self._limit = NO_CASE, math.inf
        self.is_garbled = False
        """Whether foreign code has spoken in the worker's name: nothing that came later is believed."""
        self.process = 0
        """Id of the worker, 0 as long as it has said nothing."""
        self.entered = False
        """Whether it has said that it is on a case, since it was given its item."""
        self._time, self._seen = -math.inf, b""
        self._looks = 0

    def has_hung(self) -> bool:
        """Return whether the worker has stayed at one place for longer than it may: on a case half as long again.

        Each call counts as POLL: a caller lets at least that time pass between two.
        """
        moved, time, place = self._read(), float(self._words[TIME]), self._place.tobytes()
        if moved:
            self._time = -math.inf
        # Time goes forward only, by ticks and to an end, so what else foreign code writes there is no sign of life.
        moved = moved or self._time + _NEAREST <= time < _FARTHEST or (self._case < 0.0 and place != self._seen)
        self._time, self._seen = max(self._time, time if time < _FARTHEST else -math.inf), place
        self._looks = 0 if moved else self._looks + 1
        limit = self._patience if self._case < 0.0 else 1.5 * self._limit + 0.5
        return self._looks * POLL > limit

    def _read(self) -> bool:
        """Read what has come through the pipe; return whether there was anything."""
        moved = False
        with contextlib.suppress(OSError):
            for _ in range(0 if self._pipe < 0 or self.is_garbled else _MOST_READS):  # whatever is written meanwhile
                said = os.read(self._pipe, 4096 * _ENTRY.size)
                if not said:
                    break
                whole = len(said) - len(said) % _ENTRY.size
                for number, limit in _ENTRY.iter_unpack(said[:whole]):
                    # Never a fraction: entries of ours that come after bytes of others begin in the wrong place.
                    self.is_garbled = self.is_garbled or not (number.is_integer() and limit > 0.0)
                    if self.is_garbled:
                        break
                    self.process = self.process or -int(number)
                    self._case, self._limit, moved = number, limit, True
                    self.entered = self.entered or number >= 0.0
                self.is_garbled = self.is_garbled or whole < len(said)
        return moved

    def has_entered(self) -> bool:
        """Return whether the worker has said that it is on a case, since it was given its item."""
        self._read()
        return self.entered

    def was_garbled(self, *, elsewhere: bool = False) -> bool:
        """Return whether foreign code has written into the pipe by now, or `elsewhere` where the worker speaks."""
        self._read()
        self.is_garbled = self.is_garbled or elsewhere
        return self.is_garbled

    def restart(self) -> None:
        """Count from here: the worker has given another sign of life."""
        self._looks = 0

    def begin(self) -> None:
        """Count from here, and forget all cases: the worker is given another item."""
        self._read()
        self._case, self._looks, self.entered = NO_CASE, 0, False

    @property
    def place(self) -> str:
        """Where the worker was last, in its words."""
        return self._place.tobytes().rstrip(b"\0").decode("utf-8", "ignore")

    def lost(self, how: Literal["hung", "died", "tampered"], detail: str) -> LostCase | None:
        """Return the case on which the worker was when it ended; None if it was on none."""
        self._read()
        if not 0.0 <= self._case < MANY:
            return None
        time = float(self._words[TIME])
        at = None if self.is_garbled else int(time) if 0.0 <= time < _FARTHEST else 0
        return LostCase(int(self._case), at, how, detail, self.place)
