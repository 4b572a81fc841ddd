"""Follows the messages on each channel of a trace: was each received once, in order, within the channel's capacity?

send ---> under_way ---------------------------> receive
             |                                      ^
             +---- hold ----> held ---- release ----+        held by the tester: others may overtake, no room taken
             |                 |
             +------ drop -----+                             lost: it must not be received
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from parcours.model.configuration import Message
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel

_OPEN: tuple[Message, ...] = ((),)


@dataclass(slots=True)
class _Under:
    """A message under way."""

    number: int  # as the trace numbers it; -1 if it does not
    order: int  # place among all that were sent on its channel
    sender: str
    contents: tuple[Message, ...]
    let_go: bool = False
    """Whether it lies before its receiver, as far as anybody said."""


@dataclass(slots=True)
class _Queue:
    channel: Channel
    is_bounded: bool
    under_way: deque[_Under] = field(default_factory=deque)
    held: list[_Under] = field(default_factory=list)
    n_sent: int = 0
    last: int = -1
    """The greatest number of a message that was sent."""
    taken: dict[tuple[str, str], int] = field(default_factory=dict)
    """The order of the last message between two ends."""


class Channels:
    """The traffic of a trace.

    Complaints are sentences, empty where all is well. Messages without a number (-1) are told apart by their order.

    Between numbered instances the tester hands messages on in an order of its own: there only messages between the
    same two keep theirs.
    """

    def __init__(self, cefsm: Cefsm) -> None:
        self._queues = {each.name: _Queue(each, _is_service(cefsm, each)) for each in cefsm.channels}

    def __contains__(self, channel: str) -> bool:
        return channel in self._queues

    def send(self, channel: str, number: int, sender: str, contents: tuple[Message, ...]) -> str:
        """Note a message that was sent by a component, as the trace names it; return what is wrong with it."""
        queue = self._queues[channel]
        message = _Under(number, queue.n_sent, sender, contents, sender == ENVIRONMENT)
        queue.n_sent += 1
        queue.last = max(queue.last, number)
        room = max(queue.channel.capacity, 1)
        own = sum(other.sender == sender for other in queue.under_way) if queue.is_bounded else 0
        is_full = own >= room and not _is_gated(sender)
        queue.under_way.append(message)
        return f"{channel} holds {room}, but one more was sent before it was taken up" if is_full else ""

    def receive(self, channel: str, number: int, receiver: str) -> tuple[tuple[Message, ...], str]:
        """Note a message that was taken up; return what it may hold, and what is wrong."""
        queue = self._queues[channel]
        found = _found(queue.under_way, number) or _found(queue.held, number)
        if found is None:
            if number < 0 and queue.channel.sender == ENVIRONMENT:
                return _OPEN, ""
            if 0 <= number <= queue.last:
                return _OPEN, f"a message is received once, but {_named(channel, number)} was received or lost before"
            return _OPEN, f"a message is sent before it is received, but {_named(channel, number)} was not"
        gated = _is_gated(found.sender) or _is_gated(receiver)
        if not gated and found in queue.under_way and queue.under_way[0] is not found:
            first = _named(channel, queue.under_way[0].number)
            return _OPEN, f"messages keep their order, but {_named(channel, number)} was received before {first}"
        if gated:
            ends = found.sender, receiver
            if queue.taken.get(ends, -1) > found.order:
                return _OPEN, f"messages keep their order, but {_named(channel, number)} was received late"
            queue.taken[ends] = found.order
        _forget(queue, found)
        return found.contents, ""

    def note(self, kind: str, channel: str, number: int) -> None:
        """Note that the tester kept a message back (hold) or let it go (release), or that it was lost (drop).

        While the tester keeps a message back, others may pass it, and it takes no room.
        """
        queue = self._queues[channel]
        sent, held = _found(queue.under_way, number), _found(queue.held, number)
        if kind == "release" and held is not None:
            held.let_go = True
        elif kind == "hold" and sent is not None:
            _forget(queue, sent)
            queue.held.append(sent)
        elif kind == "drop" and (found := sent or held) is not None:
            _forget(queue, found)

    def waiting(self, channel: str) -> tuple[Message, ...]:
        """Return what the latest message may hold that lies before its receiver; nothing if there is none."""
        queue = self._queues[channel]
        there = [message for message in (*queue.held, *queue.under_way) if message.let_go]
        return max(there, key=lambda message: message.order).contents if there else ()


def _is_gated(component: str) -> bool:
    return "#" in component


def _found(messages: deque[_Under] | list[_Under], number: int) -> _Under | None:
    for message in messages:
        if message.number == number:
            return message
    return None


def _forget(queue: _Queue, message: _Under) -> None:
    if queue.under_way and queue.under_way[0] is message:
        queue.under_way.popleft()
    elif message in queue.under_way:
        queue.under_way.remove(message)
    else:
        queue.held.remove(message)


def _named(channel: str, number: int) -> str:
    return f"message {number} of {channel}" if number >= 0 else f"a message of {channel}"


def _is_service(cefsm: Cefsm, channel: Channel) -> bool:
    ends = channel.receiver, channel.sender
    if not channel.capacity:
        return True
    return bool(channel.topic) and any(
        other.topic == channel.topic and (other.sender, other.receiver) == ends for other in cefsm.channels
    )
