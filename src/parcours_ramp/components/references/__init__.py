"""RAMP's services once more, slow and obvious, from docs/ramp.md: what they must answer, to judge what they do.

Nothing of the planner is used here: a fault in a kernel is no fault in its reference.
"""

from __future__ import annotations

import functools
from pathlib import Path

from parcours.model.structure import Cefsm
from parcours.study.components.references import Reference
from parcours_ramp.planner.viewing import message_of

TOLERANCE = 1e-7
"""How far numbers may be apart: a corner's place is found by a table that is exact to 1e-9."""

_TARGETS = {
    "trajectory_response": "generator:Generator",
    "evaluation_response": "evaluation:Evaluation",
    "modification_response": "modification:Modification",
}


@functools.lru_cache(maxsize=8)
def references(model: Cefsm) -> tuple[Reference, ...]:
    """Return the references of RAMP's services, for a model of its components."""
    return tuple(
        Reference(model, channel, f"{__name__}.{target}", Path(), TOLERANCE, message_of)
        for channel, target in _TARGETS.items()
    )
