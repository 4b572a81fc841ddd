"""A component -> its state space, explored as far as asked, and paths through it that meet requirements.

All machines of the component move; the tester stands in at both ends of every channel that leaves it. Where the
space is finite and every choice of inputs was tried, what was not met cannot be met.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from parcours.errors import BadModel, BadRequest
from parcours.model import Steps
from parcours.model.choice import inexact
from parcours.model.configuration import Configuration, Move, Site
from parcours.model.solutions import Question
from parcours.model.structure import Cefsm, Component
from parcours.paths.criteria.requirement import Requirement
from parcours.paths.solving.targets import Node, Targets

Position = tuple[int, Node]
"""Where a run stands, by the configuration's number, and which parts of requirements it has just done."""


Wanted = Callable[[Node], bool]
"""Whether to stop at a node of the requirements' automaton."""

Found = tuple[list[Move], Position, set[Requirement]]
"""A way, where it ends, and what it meets."""


class Full(Exception):
    """The state space is larger than allowed, or the time is up; the text says which."""


@dataclass(frozen=True, slots=True)
class Explored:
    """Runs that meet requirements, and why what they do not meet is not proven infeasible; empty if it is."""

    runs: tuple[tuple[Move, ...], ...]
    doubt: str
    n_states: int


def alone(cefsm: Cefsm, component: Component) -> tuple[Cefsm, frozenset[str]]:
    """Return a model of one component by itself, and its channels where the tester stands in at both ends."""
    opened = frozenset(
        channel.name for channel in cefsm.channels if not channel.sender == channel.receiver == component.name
    )
    return Cefsm(cefsm.name, (component,), cefsm.channels, cefsm.messages), opened


class Space:
    """The state space of a component, one configuration after the other.

    Args:
        cefsm: the model.
        component: the component.
        most: how many configurations may be visited.
        deadline: when to stop, on `time.monotonic`.
    """

    def __init__(self, cefsm: Cefsm, component: Component, most: int, deadline: float) -> None:
        self._steps = Steps(*alone(cefsm, component))
        self._most, self._deadline = most, deadline
        # Configurations by number, the initial one first; and what can happen in each, once it was asked for.
        self._known = [self._steps.layout.initial()]
        self._number = {self._known[0]: 0}
        self._after: dict[int, list[tuple[Move, int]]] = {}
        self._doubts: dict[str, str] = {}
        self.doubt = ""

    def __len__(self) -> int:
        return len(self._after)

    def explore(self, targets: Targets, finals: Iterable[str], *, complete: bool) -> Explored:
        """Return few runs that together meet what can be met: always on to the nearest requirement not met yet.

        Args:
            targets: what the runs of one machine are to meet.
            finals: the states of that machine where a run may end.
            complete: whether runs go on to such a state, where they can.
        """
        missing, ends = set(targets.requirements), set(finals)
        begin = (0, targets.start())
        missing.difference_update(targets.at(begin[1]))

        def meets(node: Node) -> bool:
            return not missing.isdisjoint(targets.at(node))

        runs: list[tuple[Move, ...]] = []
        run: list[Move] = []
        here = begin
        doubt = ""
        while missing:
            try:
                found = self._onward(here, targets, meets)
            except Full as why:
                found, doubt = None, str(why)
            if found is not None:
                moves, here, seen = found
                run += moves
                missing.difference_update(seen)
            elif run:
                runs.append(self._closed(run, here, targets, ends, complete=complete))
                run, here = [], begin
            else:
                break
        if run or not runs:
            runs.append(self._closed(run, here, targets, ends, complete=complete))
        return Explored(tuple(runs), doubt or self.doubt, len(self))

    def _closed(
        self, run: list[Move], here: Position, targets: Targets, ends: set[str], *, complete: bool
    ) -> tuple[Move, ...]:
        if not complete or here[1][0] in ends:
            return tuple(run)

        def home(node: Node) -> bool:
            return node[0] in ends

        try:
            found = self._straight(here, targets, home) or self._onward(here, targets, home)
        except Full:
            return tuple(run)
        return (*run, *found[0]) if found is not None else tuple(run)

    def _onward(self, here: Position, targets: Targets, wanted: Wanted) -> Found | None:
        """Return the shortest way to a wanted node, with where it ends and what it meets."""
        came: dict[Position, tuple[Position, Move]] = {}
        queue, seen = deque([here]), {here}
        while queue:
            place = queue.popleft()
            if time.monotonic() > self._deadline:
                raise Full(f"the budget was spent after {len(self)} states")
            for move, then in self.after(place[0]):
                node = place[1]
                for id in (move.transition, move.partner):
                    if id in targets.transitions:
                        node = targets.after(node, id)
                following = (then, node)
                if following in seen:
                    continue
                came[following] = place, move
                if node != place[1] and wanted(node):
                    moves, met, back = [], set(), following
                    while back != here:
                        met.update(targets.at(back[1]))
                        back, move = came[back]
                        moves.append(move)
                    return moves[::-1], following, met
                seen.add(following)
                queue.append(following)
                if len(seen) > 4 * self._most:
                    raise Full(f"more than {4 * self._most} states with what they have just met")
        return None

    def _straight(self, here: Position, targets: Targets, wanted: Wanted) -> Found | None:
        """Return the way that comes one transition nearer to a wanted node by every move, if one is met at once.

        It is as short as any, and needs no search, however large the space is.
        """
        far = targets.distances(wanted, frozenset(targets.transitions))
        moves, met = list[Move](), set[Requirement]()
        while not moves or not wanted(here[1]):
            nearer = (
                (move, (then, node))
                for move, then in self._moves(here[0])
                if move.transition in targets.transitions and not move.partner
                for node in [targets.after(here[1], move.transition)]
                if wanted(node) or far.get(node, len(far)) < far.get(here[1], 0)
            )
            if (found := next(nearer, None)) is None:
                return None
            moves.append(found[0])
            here = found[1]
            met.update(targets.at(here[1]))
        return moves, here, met

    def after(self, place: int) -> list[tuple[Move, int]]:
        """Return what can happen in a configuration, and where it leads."""
        if place not in self._after:
            if len(self._after) >= self._most:
                raise Full(f"more than {self._most} states")
            self._after[place] = list(self._moves(place))
        return self._after[place]

    def _moves(self, place: int) -> Iterator[tuple[Move, int]]:
        for move, then in self._successors(self._known[place]):
            if then not in self._number:
                self._number[then] = len(self._known)
                self._known.append(then)
            yield move, self._number[then]

    def _successors(self, configuration: Configuration) -> Iterator[tuple[Move, Configuration]]:
        for state, leaving in zip(configuration.states, self._steps.layout.leaving, strict=True):
            for site in leaving.get(state, ()):
                # Only what can be reached counts: a transition is looked at when its state is.
                if site.transition.id not in self._doubts:
                    self._doubts[site.transition.id] = self._inexact(site)
                self.doubt = self.doubt or self._doubts[site.transition.id]
        try:
            moves = self._steps.enabled(configuration, {})
        except BadModel as error:
            self.doubt = self.doubt or f"{error.where}: {error.rule}"
            return
        for move in moves:
            try:
                yield move, self._steps.step(configuration, move)
            except BadModel:
                continue  # a value leaves its range: the model does not allow the move
            except BadRequest:
                self.doubt = self.doubt or f"guard of {move}: no values were found for which it surely holds"

    def _inexact(self, site: Site) -> str:
        """Return why the step relation may not try every different choice at a transition; empty if it does."""
        scopes, transition = self._steps.layout.scopes, site.transition
        types, domains = scopes.types(site.component, transition), scopes.domains(site.component)
        known = {each.name: None for owner, each in self._steps.layout.variables if owner == site.component}
        question = Question(types, scopes.classes, domains, known)
        guards = [transition.guard] if transition.guard is not None else []
        return inexact(question, guards, site.effects(), repr(transition.id))
