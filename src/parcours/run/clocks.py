"""The two clocks of a host: simulated time, which jumps, and real time, which must be waited for without pauses."""

from __future__ import annotations

import contextlib
import gc
import time
from collections.abc import Iterator
from typing import Literal, Protocol

ClockName = Literal["simulated", "wall"]

_SPIN = 200_000
"""The last stretch before a due time is waited out awake [ns]: a sleeping process oversleeps."""


class Clock(Protocol):
    """Whole nanoseconds since `restart`, never decreasing."""

    @property
    def name(self) -> ClockName:
        """Which kind of time this is; durations are judged on "wall" only."""

    def now(self) -> int:
        """The time [ns]."""

    def advance(self, until: int) -> int:
        """Return once it is `until` [ns] or later, with the time it then is."""

    def rest(self, until: int) -> None:
        """Nothing happens before `until` [ns]: pass over it if that costs nothing."""

    def restart(self) -> None:
        """Begin again at zero."""


class SimulatedClock:
    """Time that passes only by `advance`.

    >>> clock = SimulatedClock()
    >>> clock.advance(5), clock.advance(3), clock.now()
    (5, 5, 5)
    """

    name: ClockName = "simulated"

    def __init__(self) -> None:
        self._now = 0

    def now(self) -> int:
        """The time [ns]."""
        return self._now

    def advance(self, until: int) -> int:
        """Jump to `until` [ns], unless it is past."""
        self._now = max(self._now, until)
        return self._now

    def rest(self, until: int) -> None:
        """Jump to `until` [ns]."""
        self.advance(until)

    def restart(self) -> None:
        """Begin again at zero."""
        self._now = 0


class WallClock:
    """The machine's monotonic clock, counted from construction or `restart`.

    Args:
        zero: count from there instead [ns of the monotonic clock, which all processes of a machine read alike].
    """

    name: ClockName = "wall"

    def __init__(self, zero: int | None = None) -> None:
        self.zero = time.perf_counter_ns() if zero is None else zero

    def now(self) -> int:
        """The time [ns]."""
        return time.perf_counter_ns() - self.zero

    def advance(self, until: int) -> int:
        """Sleep until shortly before `until` [ns], then watch the clock."""
        remaining = until - self.now()
        if remaining > _SPIN:
            time.sleep((remaining - _SPIN) * 1e-9)
        while (now := self.now()) < until:
            pass
        return now

    def rest(self, until: int) -> None:
        """Return at once: real time is not waited for when nothing can happen."""

    def restart(self) -> None:
        """Begin again at zero."""
        self.zero = time.perf_counter_ns()


@contextlib.contextmanager
def uninterrupted(wanted: bool = True) -> Iterator[None]:
    """Run the block without garbage collection, if that is wanted; afterwards it is as it was.

    A full collection lasts some 80 ms once compiled code is loaded: it would be taken for a component's slowness.

    >>> with uninterrupted():
    ...     gc.isenabled()
    False
    """
    was = gc.isenabled()
    if wanted:
        gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
