"""Takes the user's own measures of a case where its planner runs, and says which of them does harm there."""

from __future__ import annotations

import contextlib
import os
import re

from parcours.run import canaries as canaries
from parcours.run.exception_text import Overdue
from parcours.run.heartbeat import LostCase, write_place
from parcours_navigation.guests.deadline import Deadline
from parcours_navigation.guests.planners import end_if_forked
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.requirements.user_measures import BadMeasure, CaseRun, own_value


def take_own(monitor: Monitor, run: CaseRun, deadline: Deadline, limit: float) -> None:
    """Take the measures in Python of a case, once it is known what its planner has done to this process.

    Args:
        monitor: keeps the values.
        run: the case.
        deadline: rings where one takes longer than `limit` [s of wall clock].

    Raises BadMeasure if one raises, returns no number, or does not come to an end.
    """
    taken, pid = [], os.getpid()
    for one in monitor.measures:
        where = f"measure {one.name!r}"
        write_place(where)
        try:
            deadline.begin(limit)
            with contextlib.suppress(Overdue):
                taken.append(own_value(one.name, one.text, run))
        except Overdue:  # again, while the first was on its way
            pass
        finally:
            end_if_forked(pid)
            deadline.end()
        if deadline.rang:
            raise _fault(f"{where} of case {run.number}", f"it did not come to an end within {limit:g} s")
        canaries.after_case(by=where)
    write_place("")
    monitor.own[run.number] = tuple(taken)


def require_innocent(lost: LostCase) -> None:
    """Raise BadMeasure if it was a measure that took a process down, made it hang or changed it, and not a planner."""
    found = re.match(f"(?:{canaries.CHANGED})?(measure '[^']+')", lost.place)
    if found is None:
        return
    deed = {"hung": "it did not come to an end", "died": f"its process {lost.detail}"}.get(lost.how)
    raise _fault(f"{found[1]} of case {lost.number}", deed or "it " + lost.detail.replace(f"{found[1]}: ", ""))


def _fault(where: str, deed: str) -> BadMeasure:
    rule = f"it must return, and leave its process as it is, but {deed}"
    return BadMeasure(where, rule, "correct it", slug="measure-raised")
