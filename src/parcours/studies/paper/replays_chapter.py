"""System campaigns -> replays of telling cases: re-simulations from their numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadResults
from parcours.report.pieces import (
    Replay,
    Section,
)
from parcours.studies.paper.results import PaperResults, SystemResults
from parcours.verdict.facts import FACTS as BASE
from parcours.verdict.navigation import (
    Outcome,
    explain,
    outcomes,
    published,
)


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
    pieces = tuple(replay(campaign, number, words) for words, campaign, number in picks)
    lead = "Cases run again from their numbers. Orange: halted for imminent collision."
    return Section("Replays", lead, pieces, "replays")


def _first(*preferred: NDArray[np.bool_]) -> int | None:
    """Return the first case of the first non-empty choice."""
    for flags in preferred:
        if flags.any():
            return int(np.flatnonzero(flags)[0])
    return None


def replay(campaign: SystemResults, number: int, words: str = "") -> Replay:
    """Return the replay of one case: a re-simulation, shown up to 3 s beyond its end.

    Raises:
        BadResults: the re-simulation differs from the facts that the campaign kept.
    """
    study = campaign.study
    facts, track = study.track(number)
    kept = campaign.facts[campaign.facts["number"] == number]
    if [row[list(BASE.names or ())].tolist() for row in kept] != [facts[0][list(BASE.names or ())].tolist()]:
        raise BadResults(
            study.cases.id(number), "a replay must give the facts that were kept, but gives others",
            "they were made by another version of Parcours, or changed; run the campaign anew", slug="replay-differs",
        )  # fmt: skip
    shown = track[track["time"] <= int(facts[0]["t_end"]) + 3_000_000_000]
    schedule = study.parameters.schedule
    title = f"{words}: {schedule}" if words else f"{study.cases.id(number)}, {schedule}"
    return Replay(
        title=title,
        subtitle=f"{study.cases.id(number)}: {explain(facts[0])}",
        times=shown["time"] * 1e-9,
        x=shown["x"],
        y=shown["y"],
        heading=shown["heading"],
        halted=shown["halted"] == 1,
        obstacle_x=shown["obstacle_x"],
        obstacle_y=shown["obstacle_y"],
        robot_radius=study.parameters.robot_radius,
        obstacle_radii=(study.cases.obstacle_radius,) * 3,
        arena=(study.parameters.arena, study.parameters.arena),
        goal=(2.0, 2.0),
        goal_tolerance=0.2,
    )
