"""Serialised execution sequences of a partial order of paths (APSESCC): counted, drawn, listed, judged.

A serialised execution sequence is a total order of the transitions of a combination that keeps each path's own
order and every rendezvous: no receive before its send. They are the linear extensions of a partial order of few
chains. How far each path has come is a position, and sequences are counted over positions: their number may be
astronomical while the work is not.

    path a   a1 ── a2 ─┐             a waits for nobody; b1 receives what a2 sends
    path b             └─ b1 ── b2
    path c   c1                      apart from both: counted alone, then shuffled in

    sequences   a1 a2 b1 b2 with c1 at one of 5 places: 1 * 1 * comb(5, 1) = 5
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from math import comb

from parcours.abtc.combining import Combination
from parcours.abtc.order import Order, Place, grouped, join
from parcours.abtc.sequencing import Event, serialise
from parcours.abtc.serialising import AbstractCase
from parcours.errors import BadRequest
from parcours.model.structure import Cefsm
from parcours.paths.internal import InternalPath

MOST_POSITIONS = 1_000_000
"""Most positions of paths that wait for each other: about 250 MB while their sequences are counted."""


def side_by_side(paths: Sequence[InternalPath], *, changes_only: bool = False) -> Order:
    """Return the order of paths that never wait for each other; `changes_only` leaves loops out."""
    return Order.of([[path.ids[at] for at in path.changes] if changes_only else path.ids for path in paths])


def order_of(cefsm: Cefsm, combination: Combination) -> Order:
    """Return the order that every execution of a combination keeps: its paths' own, and its rendezvous.

    What a visit receives from the visit before it, it receives in the order of sending, on each channel the
    first reference first; what that visit does not send, the tester supplies at any time. On a channel of
    capacity 0, send and receive are one event. An event is called by path, reference and transition.

    Raises:
        BadRequest: the paths would meet in a circle.
    """
    references = combination.references
    sent: dict[tuple[int, str], list[Place]] = {}
    received: dict[tuple[int, str], list[Place]] = {}
    for reference, (visit, path) in enumerate(references):
        for at, transition in enumerate(path.transitions):
            for send in transition.sends:
                sent.setdefault((visit + 1, send.channel), []).append((reference, at))
            if transition.event is not None:
                received.setdefault((visit, transition.event.channel), []).append((reference, at))
    before: list[tuple[Place, Place]] = []
    together: list[tuple[Place, Place]] = []
    for (visit, channel), receives in received.items() if combination.meetings else ():
        kept = before if cefsm.channel(channel).capacity else together
        kept += zip(sent.get((visit, channel), ()), receives, strict=False)
    names = [[f"{path.name}#{at} {id}" for id in path.ids] for at, (_, path) in enumerate(references)]
    return Order.of(names, before, together)


def order_of_case(case: AbstractCase) -> Order:
    """Return the order that every execution of an abstract case keeps: what its events wait for and precede.

    Raises:
        BadSuite: references wait for each other, as in a case whose starts were edited.
    """
    return order_of_events(serialise(case))


def order_of_events(events: Sequence[Event]) -> Order:
    """Return the order that every execution of serialised events keeps; paths are its references, by their numbers."""
    lines: dict[int, list[int]] = {reference: [] for reference in sorted({event.reference for event in events})}
    for event in events:
        lines[event.reference].append(event.position)
    place = {event: (path, at) for path, line in enumerate(lines.values()) for at, event in enumerate(line)}
    before = [(place[cause], place[event.position]) for event in events for cause in event.after]
    before += [(place[event.position], place[event.before]) for event in events if event.before is not None]
    names = [
        [f"{events[at].path}#{events[at].reference} {events[at].transition}" for at in line] for line in lines.values()
    ]
    return Order.of(names, before)


def count_sequences(order: Order, most_positions: int = MOST_POSITIONS) -> int:
    """Return the exact number of serialised execution sequences, without making them.

    Paths that never wait for each other are counted apart, and multiplied with the ways to shuffle them
    together; for independent paths that is (sum of lengths)! / product of lengths!.

    Raises:
        BadRequest: paths that wait for each other have more positions than `most_positions`.
    """
    ways, done = 1, 0
    for paths in _apart(order):
        counted = _Counted(order, paths, most_positions)
        done += len(counted.events)
        ways *= comb(done, len(counted.events)) * counted.ways[0]
    return ways


def sample_sequences(
    order: Order, number: int, seed: int, most_positions: int = MOST_POSITIONS
) -> Iterator[tuple[int, ...]]:
    """Yield sequences of events drawn independently, all serialisations being equally likely.

    Raises:
        BadRequest: paths that wait for each other have more positions than `most_positions`.
    """
    sampler, draw = Sampler(order, most_positions), random.Random(seed)
    for _ in range(number):
        yield sampler.drawn(draw)


class Sampler:
    """Draws sequences, all being equally likely.

    Raises BadRequest if paths that wait for each other have more positions than `most_positions`.
    """

    def __init__(self, order: Order, most_positions: int = MOST_POSITIONS) -> None:
        self._counted = [_Counted(order, paths, most_positions) for paths in _apart(order)]

    def drawn(self, draw: random.Random) -> tuple[int, ...]:
        """Return a sequence of events."""
        return tuple(_shuffled([part.drawn(draw) for part in self._counted], draw))


def sequences(order: Order) -> Iterator[tuple[int, ...]]:
    """Yield every serialised execution sequence once, in lexicographic order, in the memory of a few sequences."""
    waits = [len(needs) for needs in order.needs]
    later: list[list[int]] = [[] for _ in waits]
    for event, needs in enumerate(order.needs):
        for need in needs:
            later[need].append(event)
    taken: list[int] = []
    open_: list[Iterator[int]] = [iter(_ready(waits))]
    while open_:
        if (chosen := next(open_[-1], None)) is not None:
            taken.append(chosen)
            waits[chosen] = -1
            for follower in later[chosen]:
                waits[follower] -= 1
            open_.append(iter(_ready(waits)))
            continue
        if len(taken) == len(waits):
            yield tuple(taken)
        open_.pop()
        if taken:
            event = taken.pop()
            waits[event] = 0
            for follower in later[event]:
                waits[follower] += 1


def _apart(order: Order) -> list[list[tuple[int, ...]]]:
    # The groups of paths that never wait for a path of another group.
    home = {event: at for at, path in reversed([*enumerate(order.paths)]) for event in path}
    group = {at: at for at in range(len(order.paths))}
    for at, path in enumerate(order.paths):
        for event in path:
            for other in (home[event], *(home[need] for need in order.needs[event])):
                join(group, at, other)
    return [[order.paths[at] for at in members] for members in grouped(group)]


class _Counted:
    """Paths that wait for each other, with the number of ways to go on from each position to the end.

    A position says how far each path has come: one integer, a digit of its own radix for each path.
    """

    def __init__(self, order: Order, paths: list[tuple[int, ...]], most_positions: int) -> None:
        self.events = sorted({event for path in paths for event in path})
        self._weight = dict.fromkeys(self.events, 0)  # what each event adds to a position
        self._digits: list[tuple[int, int, tuple[int, ...]]] = []
        radix = 1
        where: dict[int, list[tuple[int, int]]] = {}
        for number, path in enumerate(paths):
            self._digits.append((radix, len(path) + 1, path))
            for at, event in enumerate(path):
                self._weight[event] += radix
                where.setdefault(event, []).append((number, at))
            radix *= len(path) + 1
        # An event is ready once each of these paths has come so far; its own paths must stand right before it.
        self._asks = {
            event: [(path, at + 1) for need in order.needs[event] for path, at in where[need]] for event in self.events
        }
        self._stands = where
        layers, seen = [[0]], 1
        while len(layers) <= len(self.events):
            ahead = {position + self._weight[event] for position in layers[-1] for event in self._ready(position)}
            layers.append([*ahead])
            seen += len(ahead)
            if seen > most_positions:
                rule = f"{len(paths)} paths that wait for each other may have at most {most_positions} positions"
                rule += " to count over, but these have more"
                remedy = "raise the bound, serialise fewer paths together, or take the sequences lazily, one by one"
                raise BadRequest("serialised execution sequences", rule, remedy, slug="too-many-positions")
        self.ways = dict.fromkeys(layers.pop(), 1)
        for layer in reversed(layers):
            for position in layer:
                self.ways[position] = sum(self.ways[position + self._weight[event]] for event in self._ready(position))

    def _ready(self, position: int) -> Iterator[int]:
        # The events that can come next, lowest number first among those of one path.
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

    def drawn(self, draw: random.Random) -> list[int]:
        """Return one sequence; an event is as likely as it has ways to go on, so all sequences are equally likely."""
        position, sequence = 0, []
        for _ in self.events:
            left = draw.randrange(self.ways[position])
            for event in self._ready(position):
                after = position + self._weight[event]
                left -= self.ways[after]
                if left < 0:
                    position = after
                    sequence.append(event)
                    break
        return sequence


def _shuffled(lines: Sequence[Sequence[int]], draw: random.Random) -> Iterator[int]:
    # The line that goes on is as likely as it is long from here, which makes all shuffles equally likely.
    done = [0] * len(lines)
    for left in range(sum(map(len, lines)), 0, -1):
        at = draw.randrange(left)
        for line, events in enumerate(lines):
            at -= len(events) - done[line]
            if at < 0:
                yield events[done[line]]
                done[line] += 1
                break


def _ready(waits: Sequence[int]) -> list[int]:
    return [event for event, missing in enumerate(waits) if not missing]
