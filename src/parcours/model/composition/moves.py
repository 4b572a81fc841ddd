"""Expresses the moves of a machine, or of two that meet, as numbers that are added to a packed configuration.

An actor sees the states of its machines and the variables and queues that they read and write, nothing else:
under its mask two configurations that it cannot tell apart are the same integer, and its acts are looked up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from parcours.model.composition.local import LocalMove, LocalMoves
from parcours.model.composition.packing import Packing
from parcours.model.configuration import Move
from parcours.model.structure import Machine

REMEMBERED = 1 << 18
"""Most views that an actor remembers; then it forgets them all and starts again."""

Acts = tuple[tuple[int, int], ...]
"""For each move what it adds to the packed configuration, and its number in `Discoveries.moves`."""


@dataclass(slots=True)
class Discoveries:
    """What the actors came upon, each with the number of the first configuration that shows it.

    Attributes:
        moves: the number of each move taken, in the order of first taking.
        blocked: (transition or pair as text, full channel) of sends that found no room.
        faults: (move, what is wrong) where the step relation refuses to go on.
    """

    moves: dict[Move, int] = field(default_factory=dict)
    blocked: dict[tuple[str, str], int] = field(default_factory=dict)
    faults: dict[tuple[Move | None, str], int] = field(default_factory=dict)


class Actor:
    """One machine on its own, or a sender and a receiver that meet.

    `mask` are the bits of a packed configuration that it sees, `table` the acts of each view met so far, `faulty`
    the views in which the step relation refuses to go on.
    """

    def __init__(self, machines: tuple[int, ...], packing: Packing, local: LocalMoves, record: Discoveries) -> None:
        self._packing, self._local, self._record = packing, local, record
        owners = {packing.layout.machines[at][0] for at in machines}
        # Machines of one component meet in one local move; those of two each do their half.
        self._first, self._second = (machines, ()) if len(owners) == 1 else (machines[:1], machines[1:])
        used = {name for at in machines for name in _used(packing.machines[at])}
        self._masks = local.mask(self._first), local.mask(self._second)
        self.mask = self._masks[0] | self._masks[1]
        self.mask |= sum(cell.mask for name, cell in packing.queues.items() if name in used)
        sender = packing.machines[machines[0]].transitions
        self._inboxes = [name for name in packing.queues if any(t.event and t.event.channel == name for t in sender)]
        receivers = [each for at in self._second for each in packing.machines[at].transitions]
        self._offered = {each.event.channel for each in receivers if each.event is not None}
        self.table: dict[int, Acts] = {}
        self.faulty: set[int] = set()

    def work_out(self, view: int, state: int) -> Acts:
        """Return the acts of a view that is not in the table, and remember them."""
        found = []
        for moves in self._meetings(view) if self._second else self._own(view):
            added = self._added(view, moves, state)
            if added is not None:
                found.append((added, self._record.moves.setdefault(_joint(moves), len(self._record.moves))))
        if len(self.table) >= REMEMBERED:
            self.table.clear()
        self.table[view] = acts = tuple(found)
        return acts

    def _own(self, view: int) -> Iterator[tuple[LocalMove, ...]]:
        return ((move,) for move in self._moves(view) if move.offer is None)

    def _meetings(self, view: int) -> Iterator[tuple[LocalMove, ...]]:
        for move in self._moves(view):
            if move.offer is not None and move.offer[0] in self._offered:
                for answer in self._local.of(self._second, view & self._masks[1], *move.offer):
                    yield move, answer

    def _moves(self, view: int) -> Iterator[LocalMove]:
        # Those of the first that take nothing, then those that take what heads its queues.
        here = view & self._masks[0]
        yield from self._local.of(self._first, here)
        for name in self._inboxes:
            if content := self._packing.queues[name].at(view):
                yield from self._local.of(self._first, here, name, content[0])

    def _added(self, view: int, moves: tuple[LocalMove, ...], state: int) -> int | None:
        # What the move adds to the view; None if there is no room for it, or it cannot be computed.
        if full := self._full(view, moves):
            self._record.blocked.setdefault((str(_joint(moves)), full), state)
            return None
        if fault := next((move.fault for move in moves if move.fault), ""):
            said = _joint(moves) if all(move.move for move in moves) else None
            self._record.faults.setdefault((said, fault), state)
            self.faulty.add(view)
            return None
        added = 0
        for move in moves:
            added += sum(self._packing.states[at].put(state, view) for at, state in move.states)
            added += sum(self._packing.values[at].put(value, view) for at, value in move.values)
        for name in dict.fromkeys(_touched(moves)):
            queue = self._packing.queues[name]
            kept = queue.at(view)[any(move.takes == name for move in moves) :]
            put = tuple(message for move in moves for channel, message in move.puts if channel == name)
            added += queue.put((*kept, *put), view)
        return added

    def _full(self, view: int, moves: tuple[LocalMove, ...]) -> str:
        # The first channel that has no room for what the moves send; empty if all have.
        layout = self._packing.layout
        sent: dict[str, int] = {}
        for id in (id for move in moves if move.move for id in (move.move.transition, move.move.partner) if id):
            for send in layout.sites[id].transition.sends:
                sent[send.channel] = sent.get(send.channel, 0) + 1
        for name, count in sent.items():
            if name in self._packing.queues:
                waiting = len(self._packing.queues[name].at(view)) - any(move.takes == name for move in moves)
                if waiting + count > layout.capacity[name]:
                    return name
        return ""


def actors(packing: Packing, local: LocalMoves, record: Discoveries) -> list[Actor]:
    """Return an actor for each machine, and one for each sender and receiver that can meet."""
    spoken = [{send.channel for each in machine.transitions for send in each.sends} for machine in packing.machines]
    heard = [{each.event.channel for each in machine.transitions if each.event} for machine in packing.machines]
    bands: list[tuple[int, ...]] = [(at,) for at in range(len(packing.machines))]
    for sender, sent in enumerate(spoken):
        sent &= packing.layout.meetings
        bands += [(sender, at) for at, received in enumerate(heard) if at != sender and sent & received]
    return [Actor(machines, packing, local, record) for machines in bands]


def _used(machine: Machine) -> Iterator[str]:
    for transition in machine.transitions:
        if transition.event is not None:
            yield transition.event.channel
        yield from (send.channel for send in transition.sends)


def _touched(moves: tuple[LocalMove, ...]) -> Iterator[str]:
    for move in moves:
        yield from (name for name, _ in move.puts)
        # What is taken from a rendezvous was never in a queue.
        yield from ([move.takes] if move.takes and move is moves[0] else [])


def _joint(moves: tuple[LocalMove, ...]) -> Move:
    first, *rest = (move.move or Move("") for move in moves)
    for second in rest:
        inputs = tuple(sorted({*first.inputs, *second.inputs}, key=lambda pair: pair[0]))
        return Move(first.transition, second.transition, inputs)
    return first
