"""An automaton that tells, transition by transition, which requirements of a machine a run has met.

The automaton is that of Aho and Corasick (`parcours.paths.automaton`): its node is the longest part of a required
sequence that the run has just done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Machine, Transition
from parcours.paths.automaton import Trie
from parcours.paths.criteria.requirement import START, Requirement

SEQUENCES = ("transitions", "du-path")
"""The kinds of requirement that name transitions, one straight after the other."""

Node = tuple[str, int]
"""A state of the machine, and a node of the automaton."""


class Targets:
    """What a machine's runs are to visit."""

    def __init__(self, machine: Machine, requirements: Sequence[Requirement]) -> None:
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
        done: dict[int, list[Requirement]] = {}
        for need, end in zip(sequences, self._trie.ends, strict=True):
            done.setdefault(end, []).append(need)
        self._at_state = {need.steps[0]: need for need in self.requirements if need.kind == "state"}
        self._at_node = [self._ended(node, done) for node in range(len(self._trie.last))]

    def start(self) -> Node:
        """Return where every run begins."""
        return self.machine.initial, self._trie.after(0, self.number[START])

    def after(self, node: Node, id: str) -> Node:
        """Return the node after a transition, from the state where it leaves."""
        return self.transitions[id].target, self._trie.after(node[1], self.number[id])

    def at(self, node: Node) -> list[Requirement]:
        """Return the requirements that a run meets by coming to a node."""
        state = self._at_state.get(node[0])
        return self._at_node[node[1]] if state is None else [*self._at_node[node[1]], state]

    def met(self, ids: Iterable[str]) -> list[Requirement]:
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
            self._joined = ids, *self._joins(ids)
        _, queue, before = self._joined
        # Coming to a node counts, standing on it does not: the last transition is one.
        found: dict[Node, int] = {}
        near = [(source, 1) for node in queue if wanted(node) for source in before.get(node, ())]
        for node, far in near:
            if node not in found:
                found[node] = far
                near.extend((source, far + 1) for source in before.get(node, ()))
        return found

    def _joins(self, ids: frozenset[str]) -> tuple[list[Node], dict[Node, list[Node]]]:
        """Return the nodes that the transitions `ids` reach, and for each those that lead to it."""
        queue, before = [self.start()], dict[Node, list[Node]]()
        seen = {self.start()}
        for node in queue:
            for transition in self.leaving.get(node[0], ()):
                if transition.id in ids:
                    then = self.after(node, transition.id)
                    before.setdefault(then, []).append(node)
                    if then not in seen:
                        seen.add(then)
                        queue.append(then)
        return queue, before

    def _ended(self, node: int, done: dict[int, list[Requirement]]) -> list[Requirement]:
        found: list[Requirement] = []
        while node:
            found += done.get(node, ())
            node = self._trie.suffix[node]
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
