"""Walkers choose the next move: random, weighted, least-visited, guided, planned.

A walker is asked for one move at a time, so that a host can drive a live system with it. Random numbers come
from the bits of a numpy generator, whose stream numpy keeps the same between its versions.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from parcours.errors import BadModel
from parcours.paths.graph import Came, way_to
from parcours.paths.spaces import ModelSpace, Option, SpaceNode
from parcours.paths.walking.tallies import Nodes, Tallies

LOOK_AHEAD = 10_000
"""Most places that a guided walk looks at before it goes on at random."""

_PER_STEP = 16
"""Failed looks for each random step after that: looking stays within a fixed multiple of walking."""


class Ending(StrEnum):
    """Why a walk ended."""

    HELD = "the stop condition holds"
    DEAD_END = "nothing can be done there"
    EXHAUSTED = "no configuration that the offered choices reach meets anything more"
    PLAN_DONE = "the planned path is done"
    BLOCKED = "the planned path goes on with a transition that cannot be taken there"
    BUDGET = "the budget is spent, and the stop condition does not hold"


Choice = tuple[Option, int] | Ending | None
"""A move (an option and its choice of inputs), or an end, or None: start again in the initial configuration."""


class Chance:
    """Numbers from the bits of a generator, drawn in batches.

    >>> chance = Chance(np.random.default_rng(7))
    >>> 0 <= chance.below(6) < 6, chance.below(1)
    (True, 0)
    """

    def __init__(self, generator: np.random.Generator) -> None:
        self._numbers = self._drawn(generator)

    def _drawn(self, generator: np.random.Generator) -> Iterator[float]:
        while True:
            bits = np.asarray(generator.bit_generator.random_raw(4096), np.uint64)
            yield from ((bits >> np.uint64(11)) * 2.0**-53).tolist()

    def below(self, n: int) -> int:
        """Return a whole number, uniform on 0 .. n - 1; nothing is drawn for n = 1."""
        return int(next(self._numbers) * n) if n > 1 else 0

    def share(self) -> float:
        """Return a number, uniform on [0, 1)."""
        return next(self._numbers)


@dataclass(frozen=True, slots=True)
class View:
    """What a walker may look at."""

    space: ModelSpace
    tallies: Tallies
    chance: Chance
    may_restart: bool
    is_asked: bool = False
    """Whether the stop condition asks for coverage or targets, so that a walk may end where none can be met."""


class Walker(Protocol):
    """Chooses the next move."""

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return what to do here; Ending.DEAD_END if there is no option."""


def _any(options: Sequence[Option], view: View) -> Choice:
    if not options:
        return Ending.DEAD_END
    option = options[view.chance.below(len(options))]
    return option, view.chance.below(len(option.moves))


class Random:
    """Any transition that can be taken, each as likely as the others; then any choice of inputs for it."""

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return one of the options."""
        return _any(options, view)


class Weighted:
    """Any transition, as likely as its weight is beside those of its rivals; never one of weight 0."""

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return one of the options, or a dead end if none has weight."""
        left = view.chance.share() * sum(option.weight for option in options)
        chosen: list[Option] = []
        for option in options:
            if option.weight > 0:
                chosen = [option]
                if left < option.weight:
                    break
                left -= option.weight
        return _any(chosen, view)


class LeastVisited:
    """The transition taken least often so far; ties at random."""

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return one of the options."""
        counts = view.tallies.counts
        often = [sum(counts[transition.id] for _, transition in option.taken) for option in options]
        least = min(often, default=0)
        rarest = [option for option, count in zip(options, often, strict=True) if count == least]
        return _any(rarest, view)


class Guided:
    """The shortest way to something that the stop condition still wants; at random where none is near.

    Args:
        look_ahead: most places that are looked at for one way.
    """

    def __init__(self, look_ahead: int = LOOK_AHEAD) -> None:
        self._look_ahead = look_ahead
        self._pause = max(1, look_ahead // _PER_STEP)
        self._way: deque[tuple[Option, int]] = deque()
        self._patience = 0

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return the next step of the way; start again, or end, if only that can help."""
        if self._way:
            return self._way.popleft()
        if self._patience > 0 or not view.tallies.is_wanting:
            self._patience -= 1
            return _any(options, view)
        way, is_all = self._nearest(here, view.tallies.nodes, view)
        if way:
            self._way.extend(way)
            return self._way.popleft()
        if is_all and view.may_restart and here.configuration != view.space.initial:
            start = view.space.place(view.space.initial)
            way, is_all = self._nearest(start, (0,) * len(view.tallies.nodes), view)
            if way or not is_all:  # nothing is left here, but there may be elsewhere
                self._patience = 0 if way else self._pause
                return None
        if is_all and options and view.is_asked:
            return Ending.EXHAUSTED
        self._patience = self._pause
        return _any(options, view)

    def _nearest(self, here: SpaceNode, nodes: Nodes, view: View) -> tuple[list[tuple[Option, int]], bool]:
        """Return the fewest moves to something wanted, none if none was found, and whether every place was seen."""
        came: Came[tuple[SpaceNode, Nodes], tuple[Option, int]] = {(here, nodes): None}
        queue = deque(came)
        while queue and len(came) < self._look_ahead:
            place, done = key = queue.popleft()
            for option in view.space.options(place):
                onward, is_wanted = view.tallies.look(done, option.taken)
                for choice in range(len(option.moves)):
                    try:
                        after = option.after(view.space, place, choice)
                    except BadModel:  # a move that breaks the model's own rules; the walk that takes it says so
                        continue
                    if is_wanted:
                        return [*way_to(key, came), (option, choice)], False
                    if (after, onward) not in came:
                        came[after, onward] = (option, choice), key
                        queue.append((after, onward))
        return [], not queue


class Planned:
    """Given paths of transitions, one after the other, each from the initial configuration.

    Args:
        paths: the ids of the transitions of each path.
    """

    def __init__(self, paths: Sequence[Sequence[str]]) -> None:
        self._left = deque(deque(path) for path in paths if path)
        self._begun = False

    def choose(self, here: SpaceNode, options: Sequence[Option], view: View) -> Choice:
        """Return the next step of the plan, or that it cannot be taken here."""
        while self._left and not self._left[0]:
            self._left.popleft()
            if self._left:
                return None
        if not self._left:
            return Ending.PLAN_DONE
        wanted = self._left[0].popleft()
        for option in options:
            if option.moves[0].transition == wanted:
                return _any([option], view)
        return Ending.BLOCKED


WALKERS: dict[str, Callable[[], Walker]] = {
    "random": Random,
    "weighted": Weighted,
    "least-visited": LeastVisited,
    "guided": Guided,
}
"""The walkers that need nothing but their name."""
