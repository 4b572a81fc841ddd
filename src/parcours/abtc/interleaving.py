"""Serialised execution sequences of a partial order of paths (APSESCC): counted, drawn, listed, judged.

A serialised execution sequence is a total order of the transitions of a combination that keeps each path's own
order and every rendezvous: no receive before its send. All of them are what the all possible serialised
execution sequence coverage criterion asks for: the linear extensions of a partial order of few chains. How far
each path has come is a position, and sequences are counted over positions: their number may be astronomical
while the work is not.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import comb

from parcours.abtc.combining import Combination
from parcours.abtc.order import Order, Part, Place
from parcours.abtc.sequencing import serialise
from parcours.abtc.serialising import AbstractCase
from parcours.errors import BadRequest
from parcours.model.structure import Cefsm
from parcours.paths.internal import InternalPath

MOST_POSITIONS = 1_000_000
"""Most positions of paths that wait for each other: about 250 MB while their sequences are counted."""


@dataclass(frozen=True, slots=True)
class Serialised:
    """How many of some sequences are serialised execution sequences of an order.

    Attributes:
        given: how many there were.
        legal: how many of them are serialisations; the same one given twice counts twice.
        distinct: how many different serialisations were among them, the requirements that they meet.
        required: how many serialisations there are in all.
        faults: (index, what is wrong) of the others.
    """

    given: int
    legal: int
    distinct: int
    required: int
    faults: tuple[tuple[int, str], ...] = ()


def side_by_side(paths: Sequence[InternalPath], *, changes_only: bool = False) -> Order:
    """Return the order of paths that never wait for each other: each keeps its own order, and that is all.

    Args:
        paths: any internal paths.
        changes_only: leave transitions out that stay in their state.
    """
    return Order.of([[path.ids[at] for at in path.changes] if changes_only else path.ids for path in paths])


def order_of(cefsm: Cefsm, combination: Combination) -> Order:
    """Return the order that every execution of a combination keeps: its paths' own, and its rendezvous.

    What a visit receives from the visit before it, it receives in the order of sending, on each channel the
    first reference first; what that visit does not send, the tester supplies at any time. On a channel of
    capacity 0, send and receive are one event. An event is called by path, reference and transition.

    Args:
        cefsm: the model, which says how much a channel holds.
        combination: an RCC combination.

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
    events = serialise(case)
    lines: list[list[int]] = [[] for _ in case.combination.references]
    for event in events:
        lines[event.reference].append(event.position)
    place = {event: (path, at) for path, line in enumerate(lines) for at, event in enumerate(line)}
    before = [(place[cause], place[event.position]) for event in events for cause in event.after]
    before += [(place[event.position], place[event.before]) for event in events if event.before is not None]
    names = [[f"{events[at].path}#{events[at].reference} {events[at].transition}" for at in line] for line in lines]
    return Order.of(names, before)


def count_sequences(order: Order, most_positions: int = MOST_POSITIONS) -> int:
    """Return the exact number of serialised execution sequences, without making them.

    Paths that never wait for each other are counted apart, and multiplied with the ways to shuffle them
    together; for independent paths that is (sum of lengths)! / product of lengths!.

    Args:
        order: the paths and what waits for what.
        most_positions: how many positions of paths that wait for each other may be looked at.

    Raises:
        BadRequest: there are more positions than that.
    """
    ways, done = 1, 0
    for part in order.parts():
        done += len(part.events)
        ways *= comb(done, len(part.events)) * _Counted(part, most_positions).ways[0]
    return ways


def sample_sequences(
    order: Order, number: int, seed: int, most_positions: int = MOST_POSITIONS
) -> Iterator[tuple[int, ...]]:
    """Yield sequences of events drawn independently, all serialisations being equally likely.

    Args:
        order: the paths and what waits for what.
        number: how many to draw; some may be equal.
        seed: of the random numbers; the same seed draws the same sequences.
        most_positions: how many positions of paths that wait for each other may be looked at.

    Raises:
        BadRequest: there are more positions than that.
    """
    counted = [_Counted(part, most_positions) for part in order.parts()]
    draw = random.Random(seed)
    for _ in range(number):
        yield tuple(_shuffled([part.drawn(draw) for part in counted], draw))


def sequences(order: Order) -> Iterator[tuple[int, ...]]:
    """Yield every serialised execution sequence once, in lexicographic order, in the memory of a few sequences."""
    later, waits = order.later(), [len(needs) for needs in order.needs]
    taken: list[int] = []
    open_: list[Iterator[int]] = [iter(_ready(waits))]
    while open_:
        event = next(open_[-1], None)
        if event is not None:
            taken.append(event)
            waits[event] = -1
            for follower in later[event]:
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


def measure_sequences(order: Order, given: Iterable[Sequence[str]], most_positions: int = MOST_POSITIONS) -> Serialised:
    """Return how many sequences are serialised execution sequences, and how many different ones.

    Args:
        order: the paths and what waits for what.
        given: sequences of names of events, as in `order.names`, planned or recorded.
        most_positions: how many positions may be looked at to count how many serialisations there are.

    Raises:
        BadRequest: there are more positions than that.
    """
    met: set[tuple[str, ...]] = set()
    faults: list[tuple[int, str]] = []
    total = 0
    for sequence in given:
        fault = order.fault(sequence)
        if fault:
            faults.append((total, fault))
        else:
            met.add(tuple(sequence))
        total += 1
    return Serialised(total, total - len(faults), len(met), count_sequences(order, most_positions), tuple(faults))


class _Counted:
    """A part of an order with the number of ways to go on from each of its positions to the end."""

    def __init__(self, part: Part, most_positions: int) -> None:
        self.part = part
        layers = [[0]]
        seen = 1
        while len(layers) <= len(part.events):
            ahead = {position + part.weight[event] for position in layers[-1] for event in part.ready(position)}
            layers.append([*ahead])
            seen += len(ahead)
            if seen > most_positions:
                rule = f"{len(part.paths)} paths that wait for each other may have at most {most_positions} positions"
                raise BadRequest(
                    "serialised execution sequences",
                    f"{rule} to count over, but these have more",
                    "raise the bound, serialise fewer paths together, or take the sequences lazily, one by one",
                    slug="too-many-positions",
                )
        self.ways = dict.fromkeys(layers.pop(), 1)
        for layer in reversed(layers):
            for position in layer:
                self.ways[position] = sum(self.ways[position + part.weight[event]] for event in part.ready(position))

    def drawn(self, draw: random.Random) -> list[int]:
        """Return one sequence of the part; an event is as likely as it has ways to go on."""
        position, sequence = 0, []
        for _ in self.part.events:
            left = draw.randrange(self.ways[position])
            for event in self.part.ready(position):
                after = position + self.part.weight[event]
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
