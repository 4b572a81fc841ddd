"""Compiles every kernel ahead of use, several at a time, so that nobody waits for it later.

Each part runs something small in a process of its own; what it needs is compiled on the way and kept by
`parcours.kernels`.
"""

from __future__ import annotations

import atexit
import gc
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.metadata import entry_points
from multiprocessing import get_context

from parcours.kernels import require_numba

GROUP = "parcours.compiled"
"""Entry points of this group are mappings of names to parts, which packages add."""


@dataclass(frozen=True, slots=True)
class CompiledPart:
    """Something that is compiled.

    Args:
        run: runs something small of it; found by a process of its own by its module and name.
        seconds: how long that takes, roughly; the longest parts come first.
    """

    run: Callable[[], None]
    seconds: float


def parts() -> Mapping[str, CompiledPart]:
    """Return what is compiled, the longest first."""
    found: dict[str, CompiledPart] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        found |= entry.load()
    return dict(sorted(found.items(), key=lambda item: -item[1].seconds))


def compile_all(workers: int, report: Callable[[str, int, int], None] = lambda part, done, total: None) -> None:
    """Compile every part that is not on disk yet.

    Args:
        workers: processes, at least 1.
        report: gets (part, done, in all) at the start, with no part, and when a part is done.

    Raises:
        BadRequest: numba is not installed.
    """
    require_numba("compile")
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=_clear_nothing) as pool:
        running: dict[Future[None], str] = {pool.submit(part.run): name for name, part in parts().items()}
        report("", 0, len(running))
        for done, finished in enumerate(as_completed(running), 1):
            finished.result()
            report(running[finished], done, len(running))


def _clear_nothing() -> None:
    """Clear no memory in this process, neither while it works nor when it ends.

    Collecting garbage would take a twentieth of the time to save 150 MB, and an ordinary exit two seconds or more.
    """
    gc.disable()
    atexit.register(os._exit, 0)
