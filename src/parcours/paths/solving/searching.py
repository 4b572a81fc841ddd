"""Searches for paths of one machine that run and meet requirements, by solving along the search.

Paths grow by one transition at a time, those first that may come soonest to something missing (A*: their length and
the distance in the machine's graph). One solver walks along: what two paths share at their beginning is solved
once, a path that cannot run is never made longer, and where all values are constants, two paths that come to the
same values are one.
"""

from __future__ import annotations

import heapq
import sys
from collections.abc import Callable, Iterator

from parcours.model.configuration import Inputs
from parcours.model.structure import Component, Machine
from parcours.paths.solving.exploring import Node, Targets
from parcours.paths.solving.reading import ModelTables
from parcours.paths.solving.terms import NoTerm
from parcours.paths.solving.verdicts import BudgetSpent, Work
from parcours.paths.solving.walk import SymbolicWalk
from parcours.paths.timing.events import TimedEvent

Ids = tuple[str, ...]
"""A path: transitions from the initial state on."""

Verified = Callable[[Ids, tuple[Inputs, ...]], bool]
"""Whether a path with inputs runs in the model."""

CHECK_WORK = 2000
"""Most work for one question to the solver."""

LOOPS = 50
"""Where time counts, a path takes at most this many transitions for each state and transition of the machine."""


class Prefixes:
    """One solver that walks along the paths of a machine; the other machines of its component stand still.

    `allowed` are the transitions that the machine can take by itself; `doubt` says why not having found a path proves
    nothing, and is empty if it does.
    """

    def __init__(self, ground: ModelTables, component: Component, machine: Machine, seed: int, work: Work) -> None:
        self._place = (0, component.name, machine.name)
        self._walk = SymbolicWalk(
            ground, [(0, component.name, each.name) for each in component.machines], seed=seed, work=work
        )
        self._ids: Ids = ()
        # Where time counts no two paths are alike, so loops would have no end.
        self.longest = LOOPS * (len(machine.states) + len(machine.transitions)) if ground.timed else sys.maxsize
        self._transitions = {transition.id: transition for transition in machine.transitions}
        self.work, self.until, self.checks = work, work.budget, 0
        meetings = {each.name for each in ground.cefsm.channels if each.sender == each.receiver == component.name}
        self.allowed = frozenset(
            transition.id
            for transition in machine.transitions
            if (transition.event is None or transition.event.channel not in meetings)
            and meetings.isdisjoint(send.channel for send in transition.sends)
        )
        self.doubt = ""
        watched = any(each.invariants for each in component.machines if each is not machine)
        if watched or len(self.allowed) < len(self._transitions) or ground.unsteady(component.name, machine.name):
            self.doubt = "other machines of the component may help"

    def runs(self, ids: Ids) -> bool:
        """Return whether a path can run, all but its last transition being known to; `key`, `inputs` are then its.

        Raises Spent: the work allowed is done.
        """
        self._go(ids[:-1])
        if not ids:
            return True
        try:
            self._step(ids[-1])
        except NoTerm as reason:
            self.doubt = self.doubt or str(reason)
            return False
        self.checks += 1
        answer = self._walk.check(min(CHECK_WORK, self.until - self.work.spent))
        if answer is None:
            if self.work.spent > self.until:
                raise BudgetSpent
            self.doubt = self.doubt or f"the solver gave no answer to a question within {CHECK_WORK} units of work"
        elif not answer and self._walk.rounds:
            self.doubt = self.doubt or "rounding might make a path run"
        return answer is True

    def key(self) -> object | None:
        """Return what tells whether two paths come to the same values; None if they may not."""
        return self._walk.key()

    def inputs(self) -> Iterator[tuple[Inputs, ...]]:
        """Yield inputs that may make the path run that was just found to."""
        yield self._walk.inputs()
        if self._walk.rounds and self._walk.check(CHECK_WORK):
            yield self._walk.settled()

    def _go(self, ids: Ids) -> None:
        shared = 0
        for ours, theirs in zip(self._ids, ids, strict=False):
            if ours != theirs:
                break
            shared += 1
        self._walk.pop(len(self._ids) - shared)
        self._ids = ids[:shared]
        for id in ids[shared:]:
            self._step(id)

    def _step(self, id: str) -> None:
        _, component, machine = self._place
        self._walk.push(TimedEvent(len(self._walk) + 1, 0, component, machine, self._transitions[id]))
        self._ids = (*self._ids, id)


# The paths form a tree of prefixes. One solver stands at one node of it; to look at another path it pops back to the
# common prefix and pushes the rest, so the newest of equally good paths, which is near, goes first:
#
#       (start)
#       /     \
#     t1       t2         looking at t1 t3 t5 after t1 t4:  pop t4, push t3, push t5
#    /  \                 t1 stays asserted and solved
#   t3   t4 <- solver     a node without a solution is cut off with everything below it
#   |
#   t5
class PathSearch:
    """A best-first search from the end of one path; it can be continued."""

    def __init__(self, prefixes: Prefixes, targets: Targets, root: Ids, verified: Verified) -> None:
        self._prefixes, self._targets, self._verified = prefixes, targets, verified
        node = targets.start()
        for id in root:
            node = targets.after(node, id)
        self._heap: list[tuple[int, int, Ids, Node]] = [(0, 0, root, node)]
        self._order, self._root = 0, root
        self._seen: set[object] = set()
        self.unverified: set[Ids] = set()

    def beginning(self, root: Ids) -> PathSearch:
        """Return another search, from the end of a path that runs."""
        return PathSearch(self._prefixes, self._targets, root, self._verified)

    def onward(self, wanted: Callable[[Node], bool], effort: int) -> tuple[Ids, tuple[Inputs, ...]] | None:
        """Return the next path that comes to a wanted node, with inputs; None if there is none within the effort."""
        prefixes, last = self._prefixes, self._prefixes.checks + effort
        distances = self._targets.distances(wanted, prefixes.allowed)
        while self._heap:
            if prefixes.work.spent > prefixes.until or prefixes.checks >= last:
                raise BudgetSpent
            cost, order, ids, node = heapq.heappop(self._heap)
            hits = len(ids) > len(self._root) and wanted(node) and ids not in self.unverified
            now = len(ids) + (0 if hits else distances.get(node, -1))
            if now < len(ids):
                continue  # nothing wanted lies ahead
            if now > cost:
                heapq.heappush(self._heap, (now, order, ids, node))
                continue
            try:
                runs = prefixes.runs(ids)
            except BudgetSpent:
                heapq.heappush(self._heap, (cost, order, ids, node))
                raise
            if not runs:
                continue
            if hits:
                heapq.heappush(self._heap, (cost, order, ids, node))  # to be continued from here
                for inputs in prefixes.inputs():
                    if self._verified(ids, inputs):
                        return ids, inputs
                self.unverified.add(ids)
                prefixes.doubt = prefixes.doubt or "a solution over real numbers did not run in floating point"
                continue
            if (key := prefixes.key()) is not None:
                if (node, key) in self._seen:
                    continue
                self._seen.add((node, key))
            if len(ids) >= prefixes.longest:
                prefixes.doubt = prefixes.doubt or f"no path of more than {prefixes.longest} transitions was tried"
                continue
            for transition in self._targets.leaving.get(node[0], ()):
                if transition.id in prefixes.allowed:
                    self._order -= 1  # the newest first among equals: the solver need not go far
                    then = self._targets.after(node, transition.id)
                    heapq.heappush(self._heap, (0, self._order, (*ids, transition.id), then))
        return None
