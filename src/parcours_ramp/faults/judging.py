"""What a case under a fault left behind, and the same case without -> what became of the robot.

Judged by what the world saw, never by what RAMP says of itself. A robot stands if it has neither driven nor turned for
the last five seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from parcours.run.hosts.component_faults import Death
from parcours_navigation.facts import NEVER
from parcours_ramp.system.component_form import ComponentRun

TOLERANCE = 1_000_000_000  # A goal reached by so much later than without the fault counts as reached in time [ns]
STILL = 5_000_000_000  # A robot stands that has not moved for so long [ns]

SILENT = 2_000_000_000
"""A component that always has something to do, and has done nothing for so long at the end of a case, hangs [ns]."""

SLOW_V, SLOW_W = 0.01, 0.02  # What is slower does not move [m/s], [rad/s]


class RobotOutcome(StrEnum):
    """What became of the robot; the first that holds, in this order, with `ERROR` before all."""

    NOT_STRUCK = "not struck"
    """Nothing was sent that the fault could have struck: the case says nothing about it."""
    CONTACT = "contact"
    """A collision that the robot caused."""
    COASTS = "coasts"
    """It reached the goal although a component was dead or hung: nothing could have stopped it."""
    NO_EFFECT = "no effect"
    """It reached the goal within a second of when it does without the fault, or earlier."""
    RECOVERS = "recovers"
    """It reached the goal later, after the fault was over."""
    LATE = "late"
    """It reached the goal later, with the fault still in force."""
    STOPS = "stops safely"
    """It stands, without contact, and the fault is still in force."""
    STUCK = "stuck"
    """It stands, without contact, though the fault is over."""
    RUNS_ON = "runs on"
    """It still moves when nobody watches any more, far later than without the fault."""
    ERROR = "error"
    """The case could not be computed to its end: an endless loop, or a process that hung or died."""


UNWELCOME = (RobotOutcome.CONTACT, RobotOutcome.RUNS_ON, RobotOutcome.ERROR, RobotOutcome.COASTS, RobotOutcome.STUCK)
"""Outcomes that a page lists, the worst first."""


@dataclass(frozen=True, slots=True)
class CaseOutcome:
    """What became of one case under one fault.

    Attributes:
        rest_after: if it stops or is stuck, how long after the fault began, or a component died, it stood [ns]; NEVER.
    """

    number: int  # of the case
    outcome: RobotOutcome  # of the robot
    t_goal: int = NEVER  # when it reached the goal [ns]; NEVER
    t_contact: int = NEVER  # when it, moving, first touched an obstacle [ns]; NEVER
    rest_after: int = NEVER
    strikes: int = 0  # how many messages and components were struck
    deaths: tuple[Death, ...] = ()  # components that died, with their reasons
    silent: tuple[str, ...] = ()  # components that live, but had done nothing for the last two seconds of the case
    detail: str = ""  # what went wrong with the computation; else empty


def rest_since(track: NDArray[np.void]) -> int | None:
    """Return since when the robot has not moved [ns], None if it moves.

    Args:
        track: array of TRACK, shape (n,), one entry a command.

    >>> from parcours_navigation.facts import TRACK
    >>> track = np.zeros(200, TRACK)
    >>> track["time"], track["v"][:50] = np.arange(200) * 50_000_000, 0.2
    >>> rest_since(track)
    2500000000
    """
    moving = np.flatnonzero((np.abs(track["v"]) > SLOW_V) | (np.abs(track["w"]) > SLOW_W))
    first = int(moving[-1]) + 1 if len(moving) else 0
    if first >= len(track) or track["time"][-1] - track["time"][first] < STILL:
        return None
    return int(track["time"][first])


def judge(ran: ComponentRun, begins: int, until: int | None, t_goal_without: int) -> CaseOutcome:
    """Return what became of a case.

    Args:
        begins: when the fault begins [ns].
        until: when it is over [ns]; None is never.
        t_goal_without: when the robot reaches the goal without the fault [ns].
    """
    assert ran.facts is not None
    facts = ran.facts[0]
    number, t_goal = int(facts["number"]), int(facts["t_goal"])
    touched = [int(facts[name]) for name in ("t_robot_contact", "t_shared_contact") if facts[name] != NEVER]
    since = rest_since(ran.track) if t_goal == NEVER else None
    dead = {death.component for death in ran.deaths}
    silent = tuple(name for name, at in ran.acted if name not in dead and facts["t_end"] - at > SILENT)
    if ran.deaths:
        begins = min(death.time for death in ran.deaths)
    if dead or silent:
        until = None
    if ran.strikes == 0:
        outcome = RobotOutcome.NOT_STRUCK
    elif touched:
        outcome = RobotOutcome.CONTACT
    elif t_goal != NEVER:
        if dead or silent:
            outcome = RobotOutcome.COASTS
        elif t_goal <= t_goal_without + TOLERANCE:
            outcome = RobotOutcome.NO_EFFECT
        else:
            outcome = RobotOutcome.LATE if until is None or t_goal < until else RobotOutcome.RECOVERS
    elif since is None:
        outcome = RobotOutcome.RUNS_ON
    else:
        outcome = RobotOutcome.STOPS if until is None else RobotOutcome.STUCK
    rest = (
        max(since - begins, 0) if since is not None and outcome in (RobotOutcome.STOPS, RobotOutcome.STUCK) else NEVER
    )
    return CaseOutcome(number, outcome, t_goal, min(touched, default=NEVER), rest, ran.strikes, ran.deaths, silent)
