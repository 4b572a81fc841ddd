"""Walks through a state space, one move at a time: what they covered, and why they ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from parcours.errors import require_known
from parcours.model.configuration import Configuration, Move
from parcours.paths.spaces import ModelSpace
from parcours.paths.walking.conditions import StopCondition, is_bounded, leaves, parse_condition
from parcours.paths.walking.tallies import Tallies
from parcours.paths.walking.walkers import WALKERS, Chance, Ending, View, Walker

Clock = Callable[[], float]
"""The time [s], from any beginning, never decreasing."""

Question = Callable[[], bool]

AtDeadEnd = Literal["restart", "stop"]
AT_DEAD_END: tuple[AtDeadEnd, ...] = ("restart", "stop")
"""What to do where nothing can be done: start again in the initial configuration, or end."""

BUDGET = 1_000_000
"""Most moves and restarts of a phase that no step or time bound of its condition ends."""


@dataclass(frozen=True, slots=True)
class WalkStep:
    """One move of a walk.

    Attributes:
        number: from 1.
        move: the transition, its partner in a rendezvous, and the inputs chosen.
        after: where the model stands then.
        is_restart: whether the model was set back to its initial configuration before this move.
    """

    number: int
    move: Move
    after: Configuration
    is_restart: bool


@dataclass(frozen=True, slots=True)
class Phase:
    """A walker, and the condition until which it walks."""

    walker: Walker
    until: StopCondition


@dataclass(slots=True)
class Odometer:
    """What a phase has spent: moves, fresh beginnings, and when it began [s]."""

    steps: int = 0
    restarts: int = 0
    began: float = 0.0


class Walk:
    """The moves of a walk, made when they are asked for; iterate once.

    Args:
        space: what is walked.
        phases: walkers one after the other, each from where the one before ended; coverage adds up over all,
            steps, restarts, time and targets count for each phase by itself.
        generator: the source of chance; the same generator state gives the same walk.
        at_dead_end: what to do where nothing can be done.
        budget: most moves and restarts of a phase whose condition does not bound it by steps or time.
        clock: the time [s].
        criteria: what to count besides the criteria that the conditions name.

    Attributes:
        tallies: what was covered so far.
        steps: moves made so far.
        restarts: how often the walk started again.
        ended: why the walk ended; None while it goes on.

    Raises BadRequest: a condition names no criterion, state or transition of the space.
    """

    def __init__(
        self, space: ModelSpace, phases: Sequence[Phase], generator: np.random.Generator, *,
        at_dead_end: AtDeadEnd = "restart", budget: int = BUDGET, clock: Clock = time.monotonic,
        criteria: Sequence[str] = ("node", "edge"),
    ) -> None:  # fmt: skip
        require_known(at_dead_end, AT_DEAD_END, "dead end", slug="unknown-dead-end")
        named = [leaf.name for each in phases for leaf in leaves(each.until) if leaf.kind == "covered"]
        self.tallies = Tallies(space.machines, [*criteria, *named])
        for each in phases:
            self._aim(each)
        self.steps = self.restarts = 0
        self.ended: Ending | None = None
        self._space, self._phases, self._clock, self._budget = space, phases, clock, budget
        self._view = View(space, self.tallies, Chance(generator), at_dead_end == "restart")
        self._here = space.place(space.initial)
        self._moves = self._walked()

    def __iter__(self) -> Iterator[WalkStep]:
        return self._moves

    def _walked(self) -> Iterator[WalkStep]:
        self.tallies.begin(self._here.configuration.states)
        for each in self._phases:
            self.ended = None
            yield from self._phase(each)
            if self.ended not in (Ending.HELD, Ending.PLAN_DONE):
                return

    def _phase(self, phase: Phase) -> Iterator[WalkStep]:
        spent = Odometer(began=self._clock())
        self._aim(phase)
        self.tallies.stand(self._here.configuration.states)
        holds = _compiled(phase.until, self.tallies, spent, self._clock)
        is_free = not is_bounded(phase.until)
        is_asked = any(leaf.kind in ("covered", "reached", "taken") for leaf in leaves(phase.until))
        tallies, view = self.tallies, replace(self._view, is_asked=is_asked)
        fresh = False
        while not holds():
            if is_free and spent.steps + spent.restarts >= self._budget:
                self.ended = Ending.BUDGET
                return
            here = self._here
            options = view.space.options(here)
            chosen = phase.walker.choose(here, options, view)
            if chosen is None or (chosen is Ending.DEAD_END and view.may_restart and not fresh and self.steps):
                fresh = True
                spent.restarts += 1
                self.restarts += 1
                self._here = view.space.place(view.space.initial)
                tallies.begin(self._here.configuration.states)
                continue
            if isinstance(chosen, Ending):
                self.ended = chosen
                return
            option, choice = chosen
            self._here = option.after(view.space, here, choice)
            tallies.take(option.taken)
            spent.steps += 1
            self.steps += 1
            yield WalkStep(self.steps, option.moves[choice], self._here.configuration, fresh)
            fresh = False
        self.ended = Ending.HELD

    def _aim(self, phase: Phase) -> None:
        """Set the targets and goals of a phase: what its condition wants; all edges if it wants nothing."""
        asked = leaves(phase.until)
        self.tallies.aim(leaf for leaf in asked if leaf.kind in ("reached", "taken"))
        for tally in self.tallies.of.values():
            tally.goal = 0
        for leaf in asked:
            if leaf.kind == "covered":
                tally = self.tallies.of[leaf.name]
                tally.goal = max(tally.goal, tally.least(leaf.amount))
        for tally in self.tallies.targets:
            tally.goal = 1
        if not self.tallies.targets and not any(tally.goal for tally in self.tallies.of.values()):
            for tally in self.tallies.of.values():
                tally.goal = tally.size


def phase(walker: str, until: str) -> Phase:
    """Return a phase.

    Args:
        walker: a name in `parcours.paths.walking.walkers.WALKERS`.
        until: a stop condition (`parcours.paths.walking.conditions`).

    Raises BadRequest: no walker has that name, or the condition is not in the language.
    """
    require_known(walker, list(WALKERS), "walker", slug="unknown-walker")
    return Phase(WALKERS[walker](), parse_condition(until))


def _compiled(condition: StopCondition, tallies: Tallies, spent: Odometer, clock: Clock) -> Question:
    """Return the question whether the condition holds now, answered from counters."""
    least = condition.amount
    match condition.kind:
        case "and" | "or" as kind:
            join = any if kind == "or" else all
            asked = [_compiled(part, tallies, spent, clock) for part in condition.parts]
            return lambda: join(each() for each in asked)
        case "covered":
            tally = tallies.of[condition.name]
            enough = tally.least(least)
            return lambda: tally.met >= enough
        case "reached" | "taken":
            target = next(each for each in tallies.targets if each.name == str(condition))
            return lambda: target.met >= 1
        case "steps":
            return lambda: spent.steps >= least
        case "restarts":
            return lambda: spent.restarts >= least
        case "elapsed":
            return lambda: clock() - spent.began >= least
        case "never":
            return lambda: False
