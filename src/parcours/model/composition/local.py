"""Works out, once for all that a machine can see, which moves it can make by itself.

A machine is set free of the others: it stands alone in a configuration in which every other machine is nowhere,
queues have room without end, and a rendezvous with another component is cut into a message left waiting and a
message found waiting. What `StepRelation` then says of it holds wherever its state and the variables that it reads are
the same.

    as modelled       A ──c──> B            c is a rendezvous: neither moves without the other
    A set free        A ──c──> [message]    an offer, which the search gives to B
    B set free        [message] ──c──> B    the answer to each offer, looked up

Two machines of one component that meet share variables, so they are set free together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from parcours.errors import BadModel, BadRequest
from parcours.model.composition.packing import Packing
from parcours.model.configuration import Configuration, Message, Move
from parcours.model.steps import StepRelation
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel

_ENDLESS = 1 << 40
_NOWHERE = ""


@dataclass(frozen=True, slots=True)
class LocalMove:
    """A move of one machine, of two machines of one component that meet, or half a rendezvous of components.

    Args:
        move: as the step relation returns it; None where a guard cannot be computed.
        states: (machine, state) for each machine that moves, by index.
        values: (variable, value) for each variable that may have changed, by index.
        takes: the channel whose oldest message it takes; empty if none.
        puts: (channel, message) for each message it adds to a queue, in order.
        offer: (channel, message) that the other component of a rendezvous must take now.
        fault: what is wrong if the step relation refuses to say what comes after; empty if nothing.
    """

    move: Move | None
    states: tuple[tuple[int, str], ...] = ()
    values: tuple[tuple[int, object], ...] = ()
    takes: str = ""
    puts: tuple[tuple[str, Message], ...] = ()
    offer: tuple[str, Message] | None = None
    fault: str = ""


class LocalMoves:
    """The local moves of the machines of one model, remembered by what the machines see.

    `meetings` are channels on which two components meet; on other rendezvous channels, machines of one do.
    `touched` holds for each machine the variables, by index, that its transitions read or assign.
    """

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why what was never seen may happen all the same: choices that were left out, in words."""
        return tuple(self._steps.choices.doubts.values()) + tuple(self._refused)

    def __init__(self, cefsm: Cefsm, packing: Packing) -> None:
        self.packing = packing
        self.meetings = {channel.name for channel in cefsm.channels if _joins_two(channel)} & packing.layout.meetings
        self._steps = StepRelation(replace(cefsm, channels=tuple(map(_freed, cefsm.channels))))
        self._start = self._steps.layout.initial()
        self._refused: dict[str, None] = {}
        self._known: dict[tuple[tuple[int, ...], int, str, Message], tuple[LocalMove, ...]] = {}
        self.touched: list[list[int]] = []
        for leaving in packing.layout.leaving:
            sites = [site for each in leaving.values() for site in each]
            read = {at for site in sites for _, at in site.reads}
            self.touched.append(sorted(read | {at for site in sites for at, _ in site.assigned}))

    def mask(self, machines: tuple[int, ...]) -> int:
        """Return the bits of a packed configuration that hold what the machines see, queues apart."""
        found = 0
        for machine in machines:
            found |= self.packing.states[machine].mask
            for variable in self.touched[machine]:
                found |= self.packing.values[variable].mask
        return found

    def of(
        self, machines: tuple[int, ...], view: int, channel: str = "", message: Message = ()
    ) -> tuple[LocalMove, ...]:
        """Return the moves that take a message from a channel, or, without one, those that take none.

        Two machines stand for the moves in which the first sends to the second; `view` is under their `mask`.
        """
        key = (machines, view, channel, message)
        if key not in self._known:
            self._known[key] = tuple(self._work_out(*key))
        return self._known[key]

    def _work_out(self, machines: tuple[int, ...], view: int, channel: str, message: Message) -> list[LocalMove]:
        here = self._alone(machines, view, channel, message)
        try:
            moves = self._steps.enabled(here, {})
        except BadModel as error:
            return [LocalMove(None, fault=str(error))]
        layout, found = self._steps.layout, []
        for move in moves:
            sites = [layout.sites[id] for id in (move.transition, move.partner) if id]
            event = sites[0].transition.event
            takes = event.channel if event is not None and event.channel in layout.queue else ""
            if takes == channel and tuple(site.slot for site in sites) == machines:
                try:
                    found.append(self._taken(machines, here, move, takes))
                except BadRequest:
                    self._refused[f"{move} was offered with a choice that cannot be taken"] = None
        return found

    def _taken(self, machines: tuple[int, ...], here: Configuration, move: Move, takes: str) -> LocalMove:
        try:
            after = self._steps.step(here, move)
        except BadModel as error:
            return LocalMove(move, takes=takes, fault=str(error))
        added = [
            (name, message)
            for name, content in zip(self._steps.layout.channels, after.queues, strict=True)
            for message in content
        ]
        offers = [each for each in added if each[0] in self.meetings]
        return LocalMove(
            move,
            tuple((machine, after.states[machine]) for machine in machines),
            tuple((at, value) for at, value in enumerate(after.values) if value != here.values[at]),
            takes,
            tuple(each for each in added if each[0] not in self.meetings),
            offers[0] if offers else None,
        )

    def _alone(self, machines: tuple[int, ...], view: int, channel: str, message: Message) -> Configuration:
        states, values = [_NOWHERE] * len(self._start.states), list(self._start.values)
        for machine in machines:
            states[machine] = self.packing.states[machine].at(view)
            for variable in self.touched[machine]:
                values[variable] = self.packing.values[variable].at(view)
        queues = tuple((message,) if name == channel else () for name in self._steps.layout.channels)
        return Configuration(tuple(states), tuple(values), queues)


def _joins_two(channel: Channel) -> bool:
    return not channel.capacity and channel.sender != channel.receiver


def _freed(channel: Channel) -> Channel:
    inner = ENVIRONMENT not in (channel.sender, channel.receiver)
    return replace(channel, capacity=_ENDLESS) if inner and (channel.capacity or _joins_two(channel)) else channel
