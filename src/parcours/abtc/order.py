"""A partial order of numbered events on paths: each path in its own order, and what waits for what between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import TypeVar

from parcours.errors import BadRequest

_Node = TypeVar("_Node", int, tuple[int, int])

Place = tuple[int, int]
"""(path, position): the event at a position, from 0, of a path, from 0."""


@dataclass(frozen=True, slots=True)
class Order:
    """A partial order of events that lie on paths. Events are numbered path by path.

    Attributes:
        names: of the events, all different.
        paths: for each path its events, in order; an event of two paths is a rendezvous in one step.
        needs: for each event those that must come before it, directly.
    """

    names: tuple[str, ...]
    paths: tuple[tuple[int, ...], ...]
    needs: tuple[tuple[int, ...], ...]

    @classmethod
    def of(
        cls, paths: Sequence[Sequence[str]], before: Iterable[tuple[Place, Place]] = (),
        together: Iterable[tuple[Place, Place]] = (),
    ) -> Order:  # fmt: skip
        """Return the order of some paths.

        Args:
            paths: for each path the names of its events; equal names get a number.
            before: (earlier, later) places, such as a send and its receive.
            together: pairs of places that are one event, a rendezvous in one step.

        Raises:
            BadRequest: events wait for each other in a circle, so that nothing can be serialised.
        """
        places = [(path, at) for path, names in enumerate(paths) for at in range(len(names))]
        same = {place: place for place in places}
        for pair in together:
            join(same, *pair)
        groups: dict[Place, list[str]] = {}
        for place in places:
            groups.setdefault(_root(same, place), []).append(paths[place[0]][place[1]])
        number = {root: at for at, root in enumerate(groups)}
        event = {place: number[_root(same, place)] for place in places}
        lines = tuple(tuple(event[path, at] for at in range(len(names))) for path, names in enumerate(paths))
        needs: list[set[int]] = [set() for _ in groups]
        for line in lines:
            for earlier, later in pairwise(line):
                needs[later].add(earlier)
        for earlier_place, later_place in before:
            needs[event[later_place]].add(event[earlier_place])
        names = _numbered(["+".join(group) for group in groups.values()])
        order = cls(names, lines, tuple(tuple(sorted(each)) for each in needs))
        try:
            TopologicalSorter(dict(enumerate(order.needs))).prepare()
        except CycleError as error:
            caught = ", ".join(order.spelled(sorted({*error.args[1]})[:8]))
            rule = f"no two events may wait for each other, but some of {caught} do"
            remedy = "let the paths meet in the same order on both sides"
            raise BadRequest("serialised execution sequences", rule, remedy, slug="circular-order") from None
        return order

    def spelled(self, sequence: Iterable[int]) -> tuple[str, ...]:
        """Return the names of a sequence of events."""
        return tuple(self.names[event] for event in sequence)

    def fault(self, sequence: Sequence[str]) -> str:
        """Return why a sequence of names is no serialisation of all the events; empty if it is one.

        >>> Order.of([["send"], ["receive"]], [((0, 0), (1, 0))]).fault(["receive", "send"])
        'receive comes before send'
        """
        number = {name: event for event, name in enumerate(self.names)}
        done: set[int] = set()
        for name in sequence:
            if name not in number:
                return f"{name} is not among its events"
            event = number[name]
            if event in done:
                return f"{name} comes twice"
            for need in self.needs[event]:
                if need not in done:
                    return f"{name} comes before {self.names[need]}"
            done.add(event)
        missing = [name for event, name in enumerate(self.names) if event not in done]
        return f"{missing[0]} is missing" if missing else ""


def join(parents: dict[_Node, _Node], one: _Node, other: _Node) -> None:
    """Unite the groups of two nodes of a union-find forest; the least node of a group is its root."""
    low, high = sorted((_root(parents, one), _root(parents, other)))
    parents[high] = low


def _root(parents: dict[_Node, _Node], one: _Node) -> _Node:
    while parents[one] != one:
        one = parents[one]
    return one


def grouped(parents: dict[_Node, _Node]) -> list[list[_Node]]:
    """Return the groups of a union-find forest, by least member."""
    members: dict[_Node, list[_Node]] = {}
    for one in parents:
        members.setdefault(_root(parents, one), []).append(one)
    return list(members.values())


def _numbered(names: Sequence[str]) -> tuple[str, ...]:
    # Equal names get a number; one that a given name already has is passed over.
    often, used, last = Counter(names), set(names), Counter[str]()
    found = []
    for name in names:
        chosen = name
        while often[name] > 1 and chosen in used:
            last[name] += 1
            chosen = f"{name}#{last[name]}"
        used.add(chosen)
        found.append(chosen)
    return tuple(found)
