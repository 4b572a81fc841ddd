"""What became of a case: the paper's four results by the published rule, and a sound verdict beside them.

The published rule (section VI-B, and the harness behind it) looks at flags at the end of the test. The sound rule asks
the world: was the goal ever reached, who caused a contact, did a halted robot ever move again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import NDArray

from parcours.verdict.judgement import Verdict
from parcours_navigation.facts import NEVER

Flags = NDArray[np.bool_]
Facts = NDArray[np.void]

GOAL_TOLERANCE = 0.2
"""Distance to the goal that counts as reached [m] (published harness)."""


@dataclass(frozen=True, slots=True)
class Published:
    """The paper's results of each case, shape (n_cases,) each."""

    reached: Flags  # within tolerance of the goal at the end
    feasible: Flags  # the last published trajectory was called feasible
    # time stamp of its last sample where it was feasible, else NaN [s]; not the time to the goal
    time_left: NDArray[np.float64]
    halted_once: Flags  # imminent collision was signalled at any time
    stuck: Flags  # imminent collision was signalled at the end


def published(facts: Facts) -> Published:
    """Return the paper's results by the published rule; `facts` is an array of FACTS, shape (n_cases,)."""
    feasible = facts["feasible"] == 1
    return Published(
        reached=facts["to_goal"] < GOAL_TOLERANCE,
        feasible=feasible,
        time_left=np.where(feasible, facts["time_left"], np.nan),
        halted_once=facts["n_halts"] > 0,
        stuck=facts["halted"] == 1,
    )


class Share(StrEnum):
    """The four slices of the paper's Fig. 5b."""

    GOAL = "reached goal"
    FEASIBLE = "on a feasible trajectory"
    INFEASIBLE = "on an infeasible trajectory"
    STUCK = "stuck in imminent collision"


def shares(facts: Facts) -> dict[Share, Flags]:
    """Return which cases fall in each slice of Fig. 5b; every case falls in exactly one.

    Where several rules hold, the goal comes first, then stuck, then feasible.
    """
    result = published(facts)
    goal = result.reached
    stuck = result.stuck & ~goal
    feasible = result.feasible & ~goal & ~stuck
    return {
        Share.GOAL: goal,
        Share.FEASIBLE: feasible,
        Share.INFEASIBLE: ~(goal | stuck | feasible),
        Share.STUCK: stuck,
    }


class Outcome(IntEnum):
    """The sound outcome of a case; the first that holds, in this order (but an ERROR before all)."""

    COLLIDED = 0
    """The robot caused a collision: at a contact it moved towards the obstacle, whether or not that moved, too."""
    REACHED = 1
    """The goal was reached in time, and latched."""
    UNDER_WAY = 2
    """The goal was reached later, with nothing touched on the way: the true remaining time is known."""
    BLOCKED = 3
    """An obstacle came to rest on the goal, or no robot could have got there in time."""
    STUCK = 4
    """Halted at the end, and the robot did not move again afterwards."""
    ASTRAY = 5
    """The goal was reached neither during the test nor afterwards."""
    ERROR = 6
    """The planner's own fault ended the case: it raised, hung, died or answered nonsense. Goes before all others."""


VERDICT_OF = dict.fromkeys(Outcome, Verdict.FAIL) | {
    Outcome.REACHED: Verdict.PASS,
    Outcome.UNDER_WAY: Verdict.PASS,
    Outcome.BLOCKED: Verdict.INCONCLUSIVE,
    Outcome.ERROR: Verdict.ERROR,
}
"""The verdict each outcome earns."""


DECISIVE = ("error", "n_robot_contacts", "n_shared_contacts", "n_contacts_after", "t_goal", "t_goal_after", "goal_gap",
            "halted", "moved_after")  # fmt: skip
"""The fields of FACTS that decide the sound outcome."""


def touched(facts: Facts) -> Flags:
    """Return in which cases the robot caused a collision, during the test or afterwards."""
    counts = facts["n_robot_contacts"] + facts["n_shared_contacts"] + facts["n_contacts_after"]
    return np.asarray(counts > 0)


def outcomes(facts: Facts) -> NDArray[np.int64]:
    """Return the sound Outcome of each case as an integer, shape (n_cases,).

    >>> from parcours_navigation.facts import FACTS
    >>> facts = np.zeros(2, FACTS)
    >>> facts["t_goal"], facts["t_goal_after"], facts["halted"] = [9, NEVER], NEVER, [0, 1]
    >>> [Outcome(code).name for code in outcomes(facts)]
    ['REACHED', 'STUCK']
    """
    found = np.full(len(facts), Outcome.ASTRAY, np.int64)
    found[(facts["halted"] == 1) & (facts["moved_after"] == 0)] = Outcome.STUCK
    found[facts["goal_gap"] < 0.0] = Outcome.BLOCKED
    found[facts["t_goal_after"] != NEVER] = Outcome.UNDER_WAY
    found[facts["t_goal"] != NEVER] = Outcome.REACHED
    found[touched(facts)] = Outcome.COLLIDED
    found[facts["error"] != 0] = Outcome.ERROR
    return found


def true_time_left(facts: Facts) -> NDArray[np.float64]:
    """Return how long after its end each case reached the goal [s]; 0 if before, NaN if never; shape (n_cases,)."""
    after = np.where(facts["t_goal_after"] != NEVER, (facts["t_goal_after"] - facts["t_end"]) * 1e-9, np.nan)
    return np.where(facts["t_goal"] != NEVER, 0.0, after)


def explain(record: np.void) -> str:
    """Return one sentence on why a case, a record of FACTS, got its outcome."""
    outcome = Outcome(int(outcomes(np.array([record]))[0]))
    times = ("t_end", "t_goal", "t_goal_after", "t_last_moving")
    seconds = {name: record[name] * 1e-9 for name in times}
    place = f"({record['x']:.2f}, {record['y']:.2f}) m"
    if outcome is Outcome.ERROR:
        reason = record["reason"].decode("utf-8", "replace") if "reason" in (record.dtype.names or ()) else ""
        return f"the planner failed at {seconds['t_end']:.2f} s: {reason or 'no reason was kept'}"
    if outcome is Outcome.COLLIDED:
        closed = [t for t in (record["t_robot_contact"], record["t_shared_contact"]) if t != NEVER]
        late = ", after the end of the test" if closed and min(closed) > record["t_end"] else ""
        return f"the robot drove into an obstacle at {min(closed) * 1e-9:.2f} s{late}"
    if outcome is Outcome.REACHED:
        return f"goal reached at {seconds['t_goal']:.2f} s, least clearance {record['min_clearance']:.3f} m"
    if outcome is Outcome.UNDER_WAY:
        late = seconds["t_goal_after"] - seconds["t_end"]
        return f"under way at {place} when the test ended; the goal was reached {late:.1f} s later"
    if outcome is Outcome.BLOCKED and record["goal_gap"] == -np.inf:
        return f"no robot of this size and speed can get to the goal in time; this one ended at {place}"
    if outcome is Outcome.BLOCKED:
        return f"an obstacle rests on the goal ({-record['goal_gap']:.2f} m too near); the robot ended at {place}"
    if outcome is Outcome.STUCK:
        hit = ", where an obstacle had run into it" if record["n_obstacle_contacts"] else ""
        since = f"{seconds['t_last_moving']:.1f} s"
        return f"halted for imminent collision at {place}{hit} since {since}, never moved again"
    gap = f"{record['to_goal']:.2f} m from the goal"
    hit = (
        f"; an obstacle had run into it at {record['t_contact'] * 1e-9:.2f} s" if record["n_obstacle_contacts"] else ""
    )
    return f"at {place}, {gap}, when the test ended at {seconds['t_end']:.2f} s{hit}; it did not arrive later, either"
