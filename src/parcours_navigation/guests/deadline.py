"""Interrupts a call that takes too long, where the interpreter can be interrupted at all.

Compiled code that never returns to the interpreter is beyond this: there the parent process ends the worker
(`parcours.run.heartbeat`).
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours.run.exception_text import Overdue
from parcours.run.heartbeat import TIME

FIRST_CASE = 6.0
"""In the first case of a process a call may take this many times longer: imports, and compilation."""

_IDLE = float("inf")


class Deadline:
    """While entered, looks from time to time whether a case goes on, and raises Overdue when its time stands still.

    How far it is it reads in the words of `parcours.run.heartbeat`; `call_timeout` is the shortest limit to come [s].
    Does nothing in threads other than the main one, where signals do not arrive.
    """

    def __init__(self, words: NDArray[np.float64], call_timeout: float) -> None:
        self._words = words
        self._interval = min(call_timeout / 4.0, 1.0)
        self._works = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
        self._limit, self._seen, self._looks = _IDLE, -1.0, 0
        self._before: Any = None
        self.rang = False
        """Whether Overdue was raised in the case, also where the planner has caught it."""

    def __enter__(self) -> Deadline:
        if self._works:
            self._before = signal.getsignal(signal.SIGALRM)
        return self

    def begin(self, limit: float) -> None:
        """Watch a case from here on, whose calls may take `limit` [s], whatever the last case has made of the alarm."""
        self._limit, self._seen, self._looks, self.rang = limit, -1.0, 0, False
        if self._works:
            signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, self._interval, self._interval)

    def end(self) -> None:
        """Let what follows take any time; no alarm rings while nobody handles it."""
        self._limit = _IDLE
        if self._works:
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.end()
        if self._works:
            signal.signal(signal.SIGALRM, self._before)

    def _look(self, number: int, frame: FrameType | None) -> None:
        now = float(self._words[TIME])
        self._looks = self._looks + 1 if now == self._seen else 0
        self._seen = now
        if self._looks * self._interval >= self._limit:
            self.rang, self._looks = True, 0  # a planner that catches it is interrupted again
            raise Overdue
