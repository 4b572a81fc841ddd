"""What a planner's run of one case leaves behind: the judge's facts, and why the case ended early if it did."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from parcours.run.exception_text import REASON_LENGTH, reason_bytes
from parcours_navigation.facts import FACTS as BASE
from parcours_navigation.facts import NEVER
from parcours_navigation.measures.table import MEASURES

FACTS = np.dtype([*BASE.descr, ("n_track", "i8"), ("reason", f"S{REASON_LENGTH}"), ("measures", MEASURES)])
"""Facts of one case: the judge's, the entries of its track, the planner's own fault in words (UTF-8), and the measures
of its way up to the end, all NaN where that fault ended the case."""


class PlannerFault(IntEnum):
    """Why a case ended in an error: the codes of FACTS.error."""

    NONE = 0
    RAISED = 1
    """The planner raised an exception."""
    BAD_ANSWER = 2
    """It answered with something that is no command and no trajectory."""
    HUNG = 3
    """It did not answer within the deadline."""
    DIED = 4
    """It took its whole process down."""
    TAMPERED = 5
    """It changed what others rely on in its process."""


def lost(number: int, fault: PlannerFault, reason: str, time: int) -> NDArray[np.void]:
    """Return the facts of a case of which nothing is known but when [ns] and why it was lost, shape (1,)."""
    facts = np.zeros(1, FACTS)
    for name in BASE.names or ():
        if name.startswith("t_"):
            facts[name] = NEVER
    facts["number"], facts["t_end"], facts["error"] = number, time, fault
    facts["reason"] = reason_bytes(reason)
    unmeasured(facts)
    return facts


def unmeasured(facts: NDArray[np.void]) -> None:
    """Leave no measure in the facts, array of FACTS of any shape."""
    for name in MEASURES.names or ():
        facts["measures"][name] = np.nan
