"""System campaigns -> replays of telling cases: re-simulations from their numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Section
from parcours_navigation.outcomes import Outcome, outcomes, published
from parcours_navigation.study.still import animation
from parcours_ramp.paper.results import PaperResults
from parcours_ramp.system.campaigns import SystemResults, replay


def replays_chapter(results: PaperResults) -> Section:
    """Return replays: a case that original ends stuck and guarded solves, its repair, a late stop and a success."""
    original, guarded = results.system["table-vii", "original"], results.system["table-vii", "guarded"]
    stuck = outcomes(original.facts) == Outcome.STUCK
    untouched = original.facts["min_clearance"] >= 0.0
    stopped_too_near = outcomes(original.facts) != Outcome.REACHED
    stopped_too_near &= published(original.facts).stuck & (original.facts["n_obstacle_contacts"] == 0)
    solved = outcomes(guarded.facts) == Outcome.REACHED
    touched = outcomes(original.facts) == Outcome.COLLIDED
    picks: list[tuple[str, SystemResults, int]] = []
    first = _first(stopped_too_near & stuck & untouched & solved, stopped_too_near & solved, stuck & solved, stuck)
    if first is not None:
        picks += [("Stuck", original, first), ("The same case, repaired", guarded, first)]
    late = _first(touched & solved & ~stuck, touched)
    if late is not None:
        picks.append(("Stopped too late", original, late))
    success = _first((outcomes(original.facts) == Outcome.REACHED) & (original.facts["n_halts"] > 0), solved)
    if success is not None:
        picks.append(("Paused, then reached the goal", original, success))
    pieces = tuple(animation(replay(campaign, number, words)) for words, campaign, number in picks)
    lead = "Cases run again from their numbers. Orange: halted for imminent collision."
    return Section("Replays", lead, pieces, "replays")


def _first(*preferred: NDArray[np.bool_]) -> int | None:
    """Return the first case of the first non-empty choice."""
    for flags in preferred:
        if flags.any():
            return int(np.flatnonzero(flags)[0])
    return None
