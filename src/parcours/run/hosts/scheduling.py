"""Lets a process run before all ordinary ones, on processors that stay awake, where the system allows it.

Deadlines of milliseconds are not kept beside ordinary processes, which are given slices of several milliseconds; and a
processor that sleeps between two messages, as an idle one does, takes longer to wake up than a message to travel.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator
from pathlib import Path

_LATENCY = Path("/dev/cpu_dma_latency")

PRIORITY = 10
"""Of SCHED_FIFO; above ordinary processes, below the threads of the system itself."""

NODE_PRIORITY = PRIORITY - 1
"""Of nodes: a component that never rests on every processor must not keep its tester from ending it."""


def prefer_real_time(priority: int = PRIORITY) -> str:
    """Put this process into the real-time class, and return under which rule it runs now.

    >>> with real_time() as rule:
    ...     rule in ("SCHED_FIFO 10", "SCHED_OTHER")
    True
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return "SCHED_OTHER"
    return f"SCHED_FIFO {priority}"


@contextlib.contextmanager
def real_time() -> Iterator[str]:
    """Run the block in the real-time class, processors awake, if that is allowed; yield the rule; then undo it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    rule = prefer_real_time()
    try:
        with _awake():
            yield rule
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)


@contextlib.contextmanager
def _awake() -> Iterator[None]:
    """Keep the processors from sleeping, as cyclictest does: Linux grants it for as long as the file is open."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            latency = held.enter_context(_LATENCY.open("wb", buffering=0))
            latency.write(struct.pack("i", 0))
        yield


@contextlib.contextmanager
def ordinary() -> Iterator[None]:
    """Run the block in the ordinary class, so that what it starts is of it; then go back to what was."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)
