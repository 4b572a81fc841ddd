"""A planner's name -> the battery's report, made in a process of its own: a planner that ends or blocks it is told."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection

from parcours.errors import ParcoursError
from parcours_navigation.checking.battery import CHECKS, Report, run_battery
from parcours_navigation.checking.finding import Finding, error
from parcours_navigation.checking.loading import load_subject

_LOOK = 0.1
"""How often the process is looked at [s]; looks are counted, so that a stopped machine (Ctrl-Z) is not waited for."""

_GRACE = 60.0
"""A process may be silent for so much longer than one check may take [s]: it imports, and compiles."""


def check_apart(
    planner: str,
    names: Sequence[str] | None = None,
    *,
    patience: float = 120.0,
    grace: float = _GRACE,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> Report:
    """Return what the checks found of a planner, also where it takes down the process that it is checked in.

    Args:
        planner: see `load_subject`.
        names: of the checks, in CHECKS; all if None.
        patience: how long one check may take [s].
        grace: the process is ended when a check, which ought to be given up by then, takes so much longer [s].
        progress: told (name of the next check, checks made, in all).

    Raises:
        BadRequest: the planner's name leads nowhere, or a check is unknown.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_check, args=(theirs, planner, names, patience))
    process.start()
    theirs.close()
    wanted = list(CHECKS) if names is None else list(names)
    done = -1  # while it is loaded
    try:
        while True:
            try:
                if not any(ours.poll(_LOOK) for _ in range(round((patience + grace) / _LOOK))):
                    seen = f"no sign of life for {patience + grace:g} s, and no signal ended it"
                    remedy = "look for endless loops in compiled code, or give it more patience"
                    return _cut_short(planner, wanted, done, error("process-hangs", seen, remedy))
                heard = ours.recv()
            except (EOFError, OSError):
                process.join()
                seen = f"it ended the process that it was checked in, with exit code {process.exitcode}"
                remedy = "look for crashes of compiled code, and for calls of os._exit"
                return _cut_short(planner, wanted, done, error("process-dies", seen, remedy))
            if isinstance(heard, Report):
                return heard
            if isinstance(heard, ParcoursError):
                raise heard
            done = heard[1]
            progress(*heard)
    finally:
        process.kill()
        process.join()
        ours.close()


def _cut_short(planner: str, wanted: list[str], done: int, found: Finding) -> Report:
    """Return the report of a battery that ended in the check after `done` others, or before the first if -1."""
    where = f"in {wanted[done]}" if 0 <= done < len(wanted) else "while it was loaded"
    check = wanted[done] if 0 <= done < len(wanted) else ""
    made = max(done, 0)
    whole = Finding(found.slug, found.level, f"{where}: {found.seen}", found.remedy, check)
    return Report(planner, (whole,), tuple(wanted[:made]), tuple(wanted[made:]))


def _check(line: Connection, planner: str, names: Sequence[str] | None, patience: float) -> None:
    """Run the battery, and send its progress and its report, or why there can be none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    with contextlib.suppress(BrokenPipeError):
        try:
            report = run_battery(
                load_subject(planner), names, patience=patience, progress=lambda *told: line.send(told)
            )
        except ParcoursError as refused:
            line.send(refused)
        else:
            line.send(report)
