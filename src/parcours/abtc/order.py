"""A partial order of numbered events on paths: each path in its own order, and what waits for what between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import TypeVar

from parcours.errors import BadRequest

Node = TypeVar("Node", int, tuple[int, int])

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
        cls,
        paths: Sequence[Sequence[str]],
        before: Iterable[tuple[Place, Place]] = (),
        together: Iterable[tuple[Place, Place]] = (),
    ) -> Order:
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
            one, other = sorted(_root(same, place) for place in pair)
            same[other] = one
        groups: dict[Place, list[str]] = {}
        for place in places:
            groups.setdefault(_root(same, place), []).append(paths[place[0]][place[1]])
        number = {root: at for at, root in enumerate(groups)}
        lines = tuple(
            tuple(number[_root(same, (path, at))] for at in range(len(names))) for path, names in enumerate(paths)
        )
        needs: list[set[int]] = [set() for _ in groups]
        for line in lines:
            for earlier, later in pairwise(line):
                needs[later].add(earlier)
        for earlier_place, later_place in before:
            needs[number[_root(same, later_place)]].add(number[_root(same, earlier_place)])
        names = _numbered(["+".join(group) for group in groups.values()])
        order = cls(names, lines, tuple(tuple(sorted(each)) for each in needs))
        order._refuse_circles()
        return order

    def spelled(self, sequence: Iterable[int]) -> tuple[str, ...]:
        """Return the names of a sequence of events."""
        return tuple(self.names[event] for event in sequence)

    def later(self) -> list[list[int]]:
        """Return for each event those that need it."""
        found: list[list[int]] = [[] for _ in self.names]
        for event, needs in enumerate(self.needs):
            for need in needs:
                found[need].append(event)
        return found

    def fault(self, sequence: Sequence[str]) -> str:
        """Return why a sequence of names is no serialisation of all the events; empty if it is one.

        >>> Order.of([["send"], ["receive"]], [((0, 0), (1, 0))]).fault(["receive", "send"])
        'receive comes before send'
        """
        number = {name: event for event, name in enumerate(self.names)}
        done: set[int] = set()
        for name in sequence:
            if name not in number:
                return f"{name} is none of its events"
            event = number[name]
            if event in done:
                return f"{name} comes twice"
            for need in self.needs[event]:
                if need not in done:
                    return f"{name} comes before {self.names[need]}"
            done.add(event)
        missing = [name for event, name in enumerate(self.names) if event not in done]
        return f"{missing[0]} is missing" if missing else ""

    def parts(self) -> list[Part]:
        """Return the groups of paths that never wait for a path of another group."""
        home = {event: at for at, path in reversed([*enumerate(self.paths)]) for event in path}
        group = {at: at for at in range(len(self.paths))}
        for at, path in enumerate(self.paths):
            for event in path:
                for other in (home[event], *(home[need] for need in self.needs[event])):
                    low, high = sorted((_root(group, at), _root(group, other)))
                    group[high] = low
        members: dict[int, list[tuple[int, ...]]] = {}
        for at, path in enumerate(self.paths):
            members.setdefault(_root(group, at), []).append(path)
        return [Part(self, paths) for paths in members.values()]

    def _refuse_circles(self) -> None:
        try:
            TopologicalSorter(dict(enumerate(self.needs))).prepare()
        except CycleError as error:
            caught = ", ".join(self.spelled(sorted({*error.args[1]})[:8]))
            raise BadRequest(
                "serialised execution sequences",
                f"no two events may wait for each other, but some of {caught} do",
                "let the paths meet in the same order on both sides",
                slug="circular-order",
            ) from None


class Part:
    """Paths of an order that wait for each other, with positions as integers.

    A position says how far each path has come: one integer, a digit of its own radix for each path.

    Attributes:
        events: the different events of the paths.
        paths: for each path its events, in order.
        weight: for each event what it adds to a position.
    """

    def __init__(self, order: Order, paths: list[tuple[int, ...]]) -> None:
        self.paths = paths
        self.events = sorted({event for path in paths for event in path})
        self.weight = dict.fromkeys(self.events, 0)
        self._digits: list[tuple[int, int, tuple[int, ...]]] = []
        radix = 1
        where: dict[int, list[tuple[int, int]]] = {}
        for path in paths:
            self._digits.append((radix, len(path) + 1, path))
            for at, event in enumerate(path):
                self.weight[event] += radix
                where.setdefault(event, []).append((len(self._digits) - 1, at))
            radix *= len(path) + 1
        # An event is ready once each of these paths has come so far; its own paths must stand right before it.
        self._asks = {
            event: [(path, at + 1) for need in order.needs[event] for path, at in where[need]] for event in self.events
        }
        self._stands = where

    def ready(self, position: int) -> Iterator[int]:
        """Yield the events that can come next, lowest number first among those of one path."""
        digits = [position // radix % size for radix, size, _ in self._digits]
        for at, (_, _, path) in enumerate(self._digits):
            if digits[at] < len(path):
                event = path[digits[at]]
                stands = self._stands[event]
                # An event of several paths is yielded once, for the first.
                if (len(stands) == 1 or (stands[0][0] == at and all(digits[p] == q for p, q in stands))) and all(
                    digits[other] >= least for other, least in self._asks[event]
                ):
                    yield event


def _root(parents: dict[Node, Node], one: Node) -> Node:
    while parents[one] != one:
        one = parents[one]
    return one


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
