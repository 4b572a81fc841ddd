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

from parcours.run.heartbeat import CASE, LIMIT, NO_CASE, TIME

FIRST_CASE = 6.0
"""In the first case of a process a call may take this many times longer: imports, and compilation."""


class Hung(BaseException):
    """Raised in a planner that takes too long; not an Exception, so that it is not caught by mistake."""


class Deadline:
    """While entered, looks at the clock words of a case from time to time, and raises Hung when they stand still.

    The words are those of `parcours.run.heartbeat`; `call_timeout` is the shortest limit to come [s]. Does nothing in
    threads other than the main one, where signals do not arrive.
    """

    def __init__(self, words: NDArray[np.float64], call_timeout: float) -> None:
        self._words = words
        self._interval = min(call_timeout / 4.0, 1.0)
        self._works = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
        self._seen = (NO_CASE, 0.0)
        self._looks = 0
        self._before: Any = None

    def __enter__(self) -> None:
        if self._works:
            self._before = signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, self._interval, self._interval)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._works:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._before)

    def _look(self, number: int, frame: FrameType | None) -> None:
        now = (float(self._words[CASE]), float(self._words[TIME]))
        self._looks = self._looks + 1 if now == self._seen else 0
        self._seen = now
        if now[0] != NO_CASE and self._looks * self._interval >= self._words[LIMIT]:
            raise Hung
