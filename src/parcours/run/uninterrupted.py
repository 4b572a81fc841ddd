"""A stretch of real time -> the same stretch without the interpreter's own pauses.

A full garbage collection lasts some 80 ms once RAMP's code is loaded: it would be taken for a component's slowness.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def uninterrupted(wanted: bool = True) -> Iterator[None]:
    """Run the block without garbage collection, if that is wanted; afterwards it is as it was.

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
