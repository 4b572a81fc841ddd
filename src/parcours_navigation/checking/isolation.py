"""Checks a planner in a process of its own, so that a planner that ends or blocks the process is reported, too."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from parcours.run.workers import Crew, Done, Lost, failure_of, tell
from parcours_navigation.checking.battery import CHECKS, Report, run_battery
from parcours_navigation.checking.finding import Finding, error
from parcours_navigation.checking.loading import load_subject

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
    wanted = list(CHECKS) if names is None else list(names)
    done = -1  # while it is loaded

    def heard(said: tuple[str, int, int]) -> None:
        nonlocal done
        done = said[1]
        progress(*said)

    with contextlib.closing(Crew(_check, 1, patience=patience + grace, heard=heard)) as crew:
        crew.pending.append((0, (planner, names, patience)))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Done):
        return answer.result
    if not isinstance(answer, Lost):
        raise failure_of(f"planner {planner}", answer)
    if answer.how == "hung":
        seen = f"no sign of life for {patience + grace:g} s, and no signal ended it"
        remedy = "look for endless loops in compiled code, or give it more patience"
        return _cut_short(planner, wanted, done, error("process-hangs", seen, remedy))
    seen = f"it ended the process that it was checked in, with exit code {answer.status}"
    remedy = "look for crashes of compiled code, and for calls of os._exit"
    return _cut_short(planner, wanted, done, error("process-dies", seen, remedy))


def _cut_short(planner: str, wanted: list[str], done: int, found: Finding) -> Report:
    """Return the report of a battery that ended in the check after `done` others, or before the first if -1."""
    where = f"in {wanted[done]}" if 0 <= done < len(wanted) else "while it was loaded"
    check = wanted[done] if 0 <= done < len(wanted) else ""
    made = max(done, 0)
    whole = Finding(found.slug, found.level, f"{where}: {found.seen}", found.remedy, check)
    return Report(planner, (whole,), tuple(wanted[:made]), tuple(wanted[made:]))


def _check(planner: str, names: Sequence[str] | None, patience: float) -> Report:
    return run_battery(load_subject(planner), names, patience=patience, progress=lambda *said: tell(said))
