"""How much of each criterion a walk has met, at constant cost a move.

States and targets are looked up; sequences of transitions are followed in the trie of all of them (Aho &
Corasick, CACM 18, 1975). A node of the trie whose sequences are all met is never looked into again, so a
whole walk costs its length plus the size of the trie.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from parcours.errors import BadRequest
from parcours.model.structure import Machine
from parcours.paths.automaton import Trie
from parcours.paths.criteria import requirements
from parcours.paths.criteria.requirement import CoverageRequirement
from parcours.paths.spaces import Taken
from parcours.paths.walking.conditions import StopCondition

Nodes = tuple[int, ...]
"""For each machine the node of its trie: the longest part of a wanted sequence that it has just done."""


class CoverageTally:
    """What one criterion, or one target, requires, and how much of it was met.

    Attributes:
        name: of the criterion, or the target as it is written.
        required: the requirements, in order; empty for a target, which is one.
        met: how many are met.
        goal: how many must be met until a walk need not look for more; it can be beyond what there is.
    """

    __slots__ = ("flags", "goal", "met", "name", "required", "size")

    def __init__(self, name: str, required: tuple[CoverageRequirement, ...] = (), size: int = 1) -> None:
        self.name, self.required = name, required
        self.size = len(required) if required else size
        self.flags = bytearray(self.size)
        self.met = self.goal = 0

    @property
    def ratio(self) -> float:
        """The share of the requirements that is met [1]; 1 where nothing is required."""
        return self.met / self.size if self.size else 1.0

    @property
    def missed(self) -> tuple[CoverageRequirement, ...]:
        """The requirements that are not met, in order."""
        return tuple(need for need, flag in zip(self.required, self.flags, strict=True) if not flag)

    def least(self, percent: float) -> int:
        """Return how many requirements are that share [%] of all."""
        return math.ceil(self.size * percent / 100 - 1e-9)

    def mark(self, place: int) -> None:
        """Count one requirement as met, once."""
        self.met += not self.flags[place]
        self.flags[place] = 1


Entry = tuple[CoverageTally, int]
"""One requirement: its tally and its place there."""


class Tallies:
    """The tallies of several criteria on the machines that walk, and of the targets of the moment.

    Attributes:
        of: the tally of each criterion, by name.
        targets: the tallies of the targets.
        counts: how often each transition was taken.
        nodes: where each machine stands in its trie.
    """

    def __init__(self, machines: Sequence[tuple[str, Machine]], criteria: Iterable[str]) -> None:
        self.of: dict[str, CoverageTally] = {}
        self.targets: list[CoverageTally] = []
        self.counts = {t.id: 0 for _, machine in machines for t in machine.transitions}
        self._by_state: dict[tuple[int, str], list[Entry]] = {}
        self._by_id: dict[str, list[Entry]] = {}
        self._machines = machines
        sequences: list[list[tuple[tuple[str, ...], Entry]]] = [[] for _ in machines]
        for name in dict.fromkeys(criteria):
            needs = [(slot, need) for slot, (_, each) in enumerate(machines) for need in requirements(each, name)]
            named = (replace(need, machine=machines[slot][0]) for slot, need in needs)
            tally = self.of[name] = CoverageTally(name, tuple(named), size=0)
            for place, (slot, need) in enumerate(needs):
                if need.kind == "state":
                    self._by_state.setdefault((slot, need.steps[0]), []).append((tally, place))
                elif need.kind == "transitions":
                    sequences[slot].append((need.steps, (tally, place)))
                else:
                    rule = f"must ask for states or transitions in a row, but {name!r} asks for {need.kind}"
                    raise BadRequest("stop condition", rule, "measure it after the walk", slug="online-criterion")
        self._tries = [_Matcher(machine, mine) for (_, machine), mine in zip(machines, sequences, strict=True)]
        self.nodes: Nodes = (0,) * len(machines)

    def aim(self, targets: Iterable[StopCondition]) -> None:
        """Replace the targets: states reached, also as machine.state or component.machine.state, and transitions taken.

        Raises BadRequest: no machine that walks has such a state or transition.
        """
        for entries in [*self._by_state.values(), *self._by_id.values()]:
            entries[:] = [entry for entry in entries if entry[0] not in self.targets]
        self.targets = []
        for target in targets:
            if target.kind == "reached":
                stands = [(slot, state) for slot, (_, each) in enumerate(self._machines) for state in each.states]
                found = [key for key in stands if target.name in self._spelled(*key)]
                lists = [self._by_state.setdefault(key, []) for key in found]
            else:
                lists = [self._by_id.setdefault(target.name, [])] if target.name in self.counts else []
            if not lists:
                what = "state" if target.kind == "reached" else "transition"
                rule = f"must name a {what} of a machine that walks, but {target.name!r} is not one"
                raise BadRequest(f"stop condition {str(target)!r}", rule, slug="unknown-target")
            tally = CoverageTally(str(target))
            self.targets.append(tally)
            for entries in lists:
                entries.append((tally, 0))

    @property
    def is_wanting(self) -> bool:
        """Whether some goal is not met yet."""
        return any(tally.met < tally.goal for tally in (*self.of.values(), *self.targets))

    def begin(self, states: Sequence[str]) -> None:
        """The machines stand in these states, and nothing leads there."""
        self.nodes = (0,) * len(states)
        self.stand(states)

    def stand(self, states: Sequence[str]) -> None:
        """Count the states as visited."""
        for key in enumerate(states):
            _settle(self._by_state.pop(key, ()))

    def take(self, taken: Taken) -> None:
        """Count the transitions of one move, and the states they lead to."""
        nodes = list(self.nodes)
        for slot, transition in taken:
            self.counts[transition.id] += 1
            nodes[slot] = self._tries[slot].take(nodes[slot], transition.id)
            if (key := (slot, transition.target)) in self._by_state:
                _settle(self._by_state.pop(key))
            if transition.id in self._by_id:
                _settle(self._by_id.pop(transition.id))
        self.nodes = tuple(nodes)

    def look(self, nodes: Nodes, taken: Taken) -> tuple[Nodes, bool]:
        """Return where a move would lead from there, and whether it would meet something that is still wanted."""
        after, wanted = list(nodes), False
        for slot, transition in taken:
            after[slot], new = self._tries[slot].look(nodes[slot], transition.id)
            entries = [*self._by_state.get((slot, transition.target), ()), *self._by_id.get(transition.id, ())]
            wanted = wanted or new or any(map(_is_wanted, entries))
        return tuple(after), wanted

    def _spelled(self, slot: int, state: str) -> tuple[str, ...]:
        label, machine = self._machines[slot]
        return state, f"{machine.name}.{state}", f"{label.partition('.')[0]}.{state}", f"{label}.{state}"


class _Matcher:
    """The sequences wanted of one machine, in a trie."""

    def __init__(self, machine: Machine, sequences: list[tuple[tuple[str, ...], Entry]]) -> None:
        self._number = {transition.id: place for place, transition in enumerate(machine.transitions)}
        self._trie = trie = Trie(len(self._number), [[self._number[id] for id in steps] for steps, _ in sequences])
        self._ends: dict[int, list[Entry]] = {}
        for node, (_, entry) in zip(trie.ends, sequences, strict=True):
            self._ends.setdefault(node, []).append(entry)
        self._done = bytearray(len(trie.last))
        self._done[0] = 1

    def take(self, node: int, id: str) -> int:
        """Return the node after a transition, and mark what is complete there."""
        trie = self._trie
        onward = at = trie.after(node, self._number[id])
        while not self._done[at]:
            _settle(self._ends.get(at, ()))
            self._done[at] = 1
            at = trie.suffix[at]
        return self._rest(onward)

    def look(self, node: int, id: str) -> tuple[int, bool]:
        """Return the node after a transition, and whether something wanted would be complete there."""
        onward = at = self._trie.after(node, self._number[id])
        while not self._done[at]:
            if any(map(_is_wanted, self._ends.get(at, ()))):
                return self._rest(onward), True
            at = self._trie.suffix[at]
        return self._rest(onward), False

    def _rest(self, node: int) -> int:
        # Nothing longer begins at a node without children: its suffix says as much about what can follow.
        while node and not self._trie.inner[node]:
            node = self._trie.suffix[node]
        return node


def _settle(entries: Iterable[Entry]) -> None:
    for tally, place in entries:
        tally.mark(place)


def _is_wanted(entry: Entry) -> bool:
    tally, place = entry
    return tally.met < tally.goal and not tally.flags[place]
