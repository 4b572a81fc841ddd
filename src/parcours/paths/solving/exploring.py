"""Runs through the state space of a component that together meet what requirements of one machine can be met.

All machines of the component move; the tester stands in at both ends of every channel that leaves it. Where the
space is finite and every choice of inputs was tried, what was not met cannot be met. Where time counts, a state is a
configuration with the zone of its clocks.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.choice import inexact
from parcours.model.configuration import Move, TransitionSite
from parcours.model.expression import Assignment, names
from parcours.model.solutions import Question
from parcours.model.structure import CLOCK, Cefsm, Machine, Transition
from parcours.paths.automaton import Trie
from parcours.paths.criteria.requirement import START, CoverageRequirement
from parcours.paths.graph import Came, breadth_first, way_to
from parcours.paths.solving.verdicts import BudgetSpent, Path, Work
from parcours.paths.spaces import ModelSpace, SpaceNode
from parcours.paths.timing.time_constraints import is_timed
from parcours.paths.timing.zones import Zone, Zones

SEQUENCES = ("transitions", "du-path")
"""The kinds of requirement that name transitions, one straight after the other."""

Node = tuple[str, int]
"""A state of the machine, and a node of the automaton."""


class Targets:
    """What a machine's runs are to visit: an automaton that knows which requirements a run has met.

    It is that of Aho and Corasick (`parcours.paths.automaton`): its node is the longest part of a required sequence
    that the run has just done.
    """

    def __init__(self, machine: Machine, requirements: Sequence[CoverageRequirement]) -> None:
        self.machine, self.requirements = machine, tuple(dict.fromkeys(requirements))
        self.transitions = {transition.id: transition for transition in machine.transitions}
        self.number = {START: 0, **{id: place for place, id in enumerate(self.transitions, start=1)}}
        self.leaving: dict[str, list[Transition]] = {}
        for transition in machine.transitions:
            self.leaving.setdefault(transition.source, []).append(transition)
        self._joined: tuple[frozenset[str], list[Node], dict[Node, list[Node]]] | None = None
        self._check()
        sequences = [need for need in self.requirements if need.kind in SEQUENCES]
        self._trie = Trie(len(self.number), [[self.number[id] for id in need.steps] for need in sequences])
        done: dict[int, list[CoverageRequirement]] = {}
        for need, end in zip(sequences, self._trie.ends, strict=True):
            done.setdefault(end, []).append(need)
        self._at_state: dict[str, list[CoverageRequirement]] = {}
        for need in self.requirements:
            if need.kind == "state":
                self._at_state.setdefault(need.steps[0], []).append(need)
        self._at_node = [
            [need for end in self._trie.endings(node) for need in done.get(end, ())]
            for node in range(len(self._trie.last))
        ]

    def start(self) -> Node:
        """Return where every run begins."""
        return self.machine.initial, self._trie.after(0, self.number[START])

    def after(self, node: Node, id: str) -> Node:
        """Return the node after a transition, from the state where it leaves."""
        return self.transitions[id].target, self._trie.after(node[1], self.number[id])

    def at(self, node: Node) -> list[CoverageRequirement]:
        """Return the requirements that a run meets by coming to a node."""
        states = self._at_state.get(node[0])
        return self._at_node[node[1]] if states is None else [*self._at_node[node[1]], *states]

    def met(self, ids: Iterable[str]) -> list[CoverageRequirement]:
        """Return the requirements that a run meets, in their own order; other machines' transitions do not count."""
        node = self.start()
        found = set(self.at(node))
        for id in ids:
            if id in self.transitions:
                node = self.after(node, id)
                found.update(self.at(node))
        return [need for need in self.requirements if need in found]

    def distances(self, wanted: Callable[[Node], bool], ids: frozenset[str]) -> dict[Node, int]:
        """Return for each node the fewest transitions, among `ids`, that come to a wanted one; guards aside."""
        if self._joined is None or self._joined[0] != ids:
            before: dict[Node, list[Node]] = {}

            def onward(node: Node) -> Iterator[tuple[str, Node]]:
                for transition in self.leaving.get(node[0], ()):
                    if transition.id in ids:
                        then = self.after(node, transition.id)
                        before.setdefault(then, []).append(node)
                        yield transition.id, then

            self._joined = ids, list(breadth_first([self.start()], onward)), before
        _, reached, before = self._joined
        # Coming to a node counts, standing on it does not: the last transition is one.
        found: dict[Node, int] = {}
        near = [(source, 1) for node in reached if wanted(node) for source in before.get(node, ())]
        for node, far in near:
            if node not in found:
                found[node] = far
                near.extend((source, far + 1) for source in before.get(node, ()))
        return found

    def _check(self) -> None:
        states = set(self.machine.states)
        for need in self.requirements:
            where = f"requirement '{need}'"
            if need.kind != "state" and need.kind not in SEQUENCES:
                rule = f"must name a state or a sequence of transitions, but is of kind {need.kind!r}"
                remedy = "ask for a criterion over nodes, edges or paths, or for du-paths"
                raise BadRequest(where, rule, remedy, slug="requirement-kind")
            known = states if need.kind == "state" else self.transitions.keys()
            named = [step for place, step in enumerate(need.steps) if place or step != START or need.kind == "state"]
            for step in named:
                if step not in known:
                    rule = f"must name what machine {self.machine.name!r} has, but {step!r} is not there"
                    raise BadRequest(where, rule, one_of(step, sorted(known)[:100]), slug="foreign-transition")
            for first, second in pairwise(named if need.kind != "state" else ()):
                into, out_of = self.transitions[first].target, self.transitions[second].source
                if into != out_of:
                    rule = f"{second!r} starts in {out_of!r}, but {first!r} ends in {into!r}"
                    raise BadRequest(where, rule, "name every transition on the way", slug="broken-sequence")


BEAM = 256
"""Most runs of each length that are kept while a shorter one is sought."""

LOOK = 1 / 64
"""What it costs to come to a state that was expanded before, in units of work."""

Spot = tuple[SpaceNode, Zone | None]
"""Where a run stands, and what its clocks may read; no zone where no time may pass, an empty one without clocks."""

Position = tuple[Spot, Node]
"""Where a run stands, and which parts of requirements it has just done."""

Wanted = Callable[[Node], bool]
"""Whether to stop at a node of the requirements' automaton."""

Found = tuple[list[Move], Position, set[CoverageRequirement]]
"""A way, where it ends, and what it meets."""


@dataclass(frozen=True, slots=True)
class Explored:
    """Runs that meet requirements, and why what they do not meet is not proven infeasible; empty if it is."""

    runs: tuple[tuple[Move, ...], ...]
    doubt: str
    n_states: int


# The search runs on pairs of a spot (a configuration of the component, and a zone) and a node of the targets'
# automaton: two runs to one spot differ if one has just done more of a required sequence. Spots are expanded once,
# whatever their nodes.
class Exploration:
    """The state space of a component as far as it was asked for.

    Args:
        alone: the model of the component alone (`part_of`).
        targets: what the runs of one machine are to meet.
        finals: the states of that machine where a run may end.
        most: how many configurations, with their zones, may be visited.
        work: counts the states.
        until: when to stop: what `work` may have spent.
    """

    def __init__(
        self, alone: Cefsm, targets: Targets, finals: Iterable[str], most: int, work: Work, until: float
    ) -> None:
        self._space, self._targets, self._finals = ModelSpace(alone, remembered=sys.maxsize), targets, set(finals)
        self._most, self._work, self._until = most, work, until
        (self._component,) = alone.components
        self._zones = Zones(self._component) if is_timed(self._component) else None
        self._after: dict[Spot, list[tuple[Move, Spot]]] = {}
        self._untimed: dict[SpaceNode, list[tuple[Move, SpaceNode]]] = {}
        self._doubts: dict[str, str] = {}
        self._doubt = self._meeting_clock(alone)

    def _meeting_clock(self, alone: Cefsm) -> str:
        # In one step a clock has one reading, whatever the sender of a rendezvous sets it to.
        meetings = {each.name for each in alone.channels if each.sender == each.receiver and not each.capacity}
        steps = list(self._component.transitions())
        senders = (each for each in steps if not meetings.isdisjoint(send.channel for send in each.sends))
        set_ = {action.target for each in senders for action in each.actions if isinstance(action, Assignment)}
        receivers = (each for each in steps if each.event is not None and each.event.channel in meetings)
        read = {name for each in receivers if each.guard is not None for name in names(each.guard)}
        clocks = {each.name for each in self._component.variables if each.type == CLOCK}
        both = sorted(set_ & read & clocks)
        return f"a receiver reads {both[0]}, which its sender sets in the same step" if both else ""

    def runs(self, *, complete: bool) -> Explored:
        """Return few runs that together meet what can be met: always on to the nearest requirement not met yet.

        Where they can, `complete` runs go on to a state where a run may end.
        """
        targets = self._targets
        missing = set(targets.requirements)
        start: Zone | None = () if self._zones is None else self._zones.start(self._space.initial.states)
        begin = ((self._space.place(self._space.initial), start), targets.start())
        missing.difference_update(targets.at(begin[1]))

        def meets(node: Node) -> bool:
            return not missing.isdisjoint(targets.at(node))

        runs: list[tuple[Move, ...]] = []
        run: list[Move] = []
        here = begin
        doubt = ""
        while missing:
            try:
                found = self._onward(here, meets)
            except BudgetSpent as why:
                found, doubt = None, str(why)
            if found is not None:
                moves, here, seen = found
                run += moves
                missing.difference_update(seen)
            elif run:
                runs.append(self._closed(run, here, complete=complete))
                run, here = [], begin
            else:
                break
        if run or not runs:
            runs.append(self._closed(run, here, complete=complete))
        return Explored(tuple(self._shorter(runs, begin)), doubt or self._doubt, len(self._after))

    def _shorter(self, runs: list[tuple[Move, ...]], begin: Position) -> list[tuple[Move, ...]]:
        """Return one run that meets what all of some meet, no longer than they are and as well ended; else these.

        Of all runs of one length, those that have met most are made longer (beam search). It at most doubles the work.
        """
        targets, until = self._targets, min(self._until, 2 * self._work.spent + BEAM)
        needs = dict.fromkeys(need for run in runs for need in targets.met(Path(run).ids))
        bits = {need: 1 << place for place, need in enumerate(needs)}
        at_home = all(self._node_after(begin[1], run)[0] in self._finals for run in runs)

        def met(node: Node) -> int:
            return sum(bits.get(need, 0) for need in targets.at(node))

        layer: dict[tuple[Position, int], tuple[Move, ...]] = {(begin, met(begin[1])): ()}
        for _ in range(sum(map(len, runs)) - (len(runs) == 1)):
            following: dict[tuple[Position, int], tuple[Move, ...]] = {}
            for ((spot, node), done), moves in layer.items():
                self._work.spent += LOOK
                try:
                    leaving = self._expanded(spot) if self._work.spent <= until else []
                except BudgetSpent:
                    return runs
                for move, then in leaving:
                    after = self._node_after(node, (move,))
                    key = ((then, after), done | met(after))
                    if key not in following:
                        following[key] = (*moves, move)
                        if key[1].bit_count() == len(bits) and (not at_home or after[0] in self._finals):
                            return [following[key]]
            best = sorted(following, key=lambda key: -key[1].bit_count())[:BEAM]
            layer = {key: following[key] for key in best}
        return runs

    def _node_after(self, node: Node, moves: Iterable[Move]) -> Node:
        for move in moves:
            for id in (move.transition, move.partner):
                if id in self._targets.transitions:
                    node = self._targets.after(node, id)
        return node

    def _closed(self, run: list[Move], here: Position, *, complete: bool) -> tuple[Move, ...]:
        def is_home(node: Node) -> bool:
            return node[0] in self._finals

        if not complete or is_home(here[1]):
            return tuple(run)
        try:
            found = self._straight(here, is_home) or self._onward(here, is_home)
        except BudgetSpent:
            return tuple(run)
        return (*run, *found[0]) if found is not None else tuple(run)

    def _onward(self, here: Position, wanted: Wanted) -> Found | None:
        """Return the shortest way to a wanted node, with where it ends and what it meets."""
        targets = self._targets
        came: Came[Position, Move] = {here: None}
        queue = deque([here])
        while queue:
            place = queue.popleft()
            self._work.spent += LOOK
            if self._work.spent > self._until:
                raise BudgetSpent(f"the budget was spent after {len(self._after)} states")
            for move, then in self._expanded(place[0]):
                node = self._node_after(place[1], (move,))
                following = (then, node)
                if following in came:
                    continue
                came[following] = move, place
                if node != place[1] and wanted(node):
                    met, back = set[CoverageRequirement](), following
                    while (step := came[back]) is not None:
                        met.update(targets.at(back[1]))
                        back = step[1]
                    return way_to(following, came), following, met
                queue.append(following)
                if len(came) > 4 * self._most:
                    raise BudgetSpent(f"more than {4 * self._most} states with what they have just met")
        return None

    def _straight(self, here: Position, wanted: Wanted) -> Found | None:
        """Return the way that comes one transition nearer to a wanted node by every move, if one is met at once.

        It is as short as any, and needs no search, however large the space is.
        """
        targets = self._targets
        far = targets.distances(wanted, frozenset(targets.transitions))
        moves, met = list[Move](), set[CoverageRequirement]()
        while not moves or not wanted(here[1]):
            nearer = (
                (move, (then, node))
                for move, then in self._timely(here[0])
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

    def _expanded(self, spot: Spot) -> list[tuple[Move, Spot]]:
        if spot not in self._after:
            if len(self._after) >= self._most:
                raise BudgetSpent(f"more than {self._most} states")
            self._work.spent += 1
            self._after[spot] = list(self._timely(spot))
        return self._after[spot]

    def _timely(self, spot: Spot) -> Iterator[tuple[Move, Spot]]:
        """Yield what can happen in time, and where it leads."""
        place, zone = spot
        if self._zones is None:
            yield from ((move, (then, zone)) for move, then in self._moves(place))
        if self._zones is None or zone is None:
            return
        if place not in self._untimed:
            self._untimed[place] = list(self._moves(place))
        if zone is None:
            return
        layout, states = self._space.steps.layout, place.configuration.states
        for move, then in self._untimed[place]:
            moving, known = [], layout.local(place.configuration, self._component.name)
            for id in filter(None, (move.transition, move.partner)):
                site = layout.sites[id]
                moving.append((site.slot, site.transition, dict(known)))
                for at, _ in site.assigned:  # what the partner reads then is left open
                    known.pop(layout.variables[at][1].name, None)
            for after in self._zones.after(zone, states, moving):
                yield move, (then, after)

    def _moves(self, place: SpaceNode) -> Iterator[tuple[Move, SpaceNode]]:
        """Yield what can happen in a place, and where it leads."""
        for state, leaving in zip(place.configuration.states, self._space.steps.layout.leaving, strict=True):
            for site in leaving.get(state, ()):
                # Only what can be reached counts: a transition is looked at when its state is.
                if site.transition.id not in self._doubts:
                    self._doubts[site.transition.id] = self._inexact(site)
                self._doubt = self._doubt or self._doubts[site.transition.id]
        try:
            options = self._space.options(place)
        except BadModel as error:
            self._doubt = self._doubt or f"{error.where}: {error.rule}"
            return
        for option in options:
            for choice, move in enumerate(option.moves):
                try:
                    yield move, option.after(self._space, place, choice)
                except BadModel as error:
                    # A value that leaves its range forbids the move; a guard that may not hold leaves a doubt.
                    if error.slug == "impossible-move":
                        doubt = f"guard of {move}: no values were found for which it surely holds"
                        self._doubt = self._doubt or doubt

    def _inexact(self, site: TransitionSite) -> str:
        """Return why the step relation may not try every different choice at a transition; empty if it does."""
        layout, transition = self._space.steps.layout, site.transition
        types, domains = layout.scopes.types(site.component, transition), layout.scopes.domains(site.component)
        known = {each.name: None for owner, each in layout.variables if owner == site.component}
        question = Question(types, layout.scopes.classes, domains, known)
        guards = [transition.guard] if transition.guard is not None else []
        return inexact(question, guards, site.effects(), repr(transition.id))
