"""Measures how late the machine wakes an ordinary process, beat by beat, and writes it to a pipe.

Run as a file: `wakeup_latency.py DESCRIPTOR BEAT`. Foreign nodes run in the ordinary class, and on a loaded machine
stand still now and then; that must not count as their silence. It ends when the pipe is closed.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time


def main(descriptor: int, beat: int) -> None:
    """Write `TIME LATE` [ns of the monotonic clock, ns] every `beat` [ns], for as long as somebody reads."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(OSError, KeyboardInterrupt):
        while True:
            due = time.perf_counter_ns() + beat
            time.sleep(beat * 1e-9)
            now = time.perf_counter_ns()
            os.write(descriptor, b"%d %d\n" % (now, now - due))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
