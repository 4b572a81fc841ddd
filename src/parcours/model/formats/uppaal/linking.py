"""Steps that meet on channels to channels with one sender and one receiver each.

A channel of UPPAAL may have many senders and receivers; ours links two components. So it becomes one for each
pair of components whose processes meet on it, and the steps on it are there once for each partner.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

from parcours.model.expression import names
from parcours.model.formats.naming import Names
from parcours.model.formats.reading import Loss
from parcours.model.formats.uppaal.steps import Step
from parcours.model.formats.uppaal.symbols import Link
from parcours.model.structure import ENVIRONMENT, Channel, MessageClass

SIGNAL = "Signal"
"""The message class of every channel: UPPAAL's carry nothing."""

_Side = dict[str, tuple[int, list[Step]]]


class Linking:
    """The channels of one system.

    Args:
        processes: name, index of the component and steps of each process.
        components: the name of each component.
        tester: (channel of the file, sign) of the steps of the process that stands for the environment.

    Attributes:
        channels: rendezvous, all of them.
        messages: the class of what they carry, if there are any.
        partners: (process, channel of the file, sign) -> (name of the channel, name of the partner) of each step on it.
        losses: what channels of UPPAAL do and ours do not.
    """

    def __init__(
        self,
        processes: Sequence[tuple[str, int, list[Step]]],
        components: Sequence[str],
        tester: Set[tuple[str, str]] = frozenset(),
    ) -> None:
        self.components, self.tester = components, tester
        self.partners: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
        self.losses: list[Loss] = []
        self._names, self._made = Names(), list[Channel]()
        ends: dict[str, tuple[Link, dict[str, _Side]]] = {}
        for name, group, steps in processes:
            for step in steps:
                if step.link is not None:
                    _, sides = ends.setdefault(step.link.id, (step.link, {"!": {}, "?": {}}))
                    sides[step.sign].setdefault(name, (group, []))[1].append(step)
        for link, sides in sorted(ends.values(), key=lambda end: end[0].line):
            self._join(link, sides["!"], sides["?"])
            self._limits(link, sides["!"], sides["?"])
        self.channels = tuple(self._made)
        self.messages = (MessageClass(SIGNAL, ()),) if self._made else ()

    def _join(self, link: Link, senders: _Side, receivers: _Side) -> None:
        pairs: dict[tuple[int, int], list[tuple[str, str]]] = {}
        for sender, (one, _) in senders.items():
            for receiver, (other, _) in receivers.items():
                if sender != receiver:
                    pairs.setdefault((one, other), []).append((sender, receiver))
        for side, sign, other_sign in ((senders, "!", "?"), (receivers, "?", "!")):
            if not pairs or (link.id, other_sign) in self.tester:
                for group in dict.fromkeys(group for group, _ in side.values()):
                    ends = (self.components[group], ENVIRONMENT)
                    name = self._channel(link, ends if sign == "!" else ends[::-1], alone=len(side) == 1)
                    for process in (process for process, (owner, _) in side.items() if owner == group):
                        self.partners.setdefault((process, link.id, sign), []).append((name, ENVIRONMENT))
        for (one, other), members in pairs.items():
            between = (self.components[one], self.components[other])
            name = self._channel(link, between, alone=len(pairs) == 1)
            for end, sign, partner in ((0, "!", between[1]), (1, "?", between[0])):
                for process in dict.fromkeys(pair[end] for pair in members):
                    self.partners.setdefault((process, link.id, sign), []).append((name, partner))

    def _channel(self, link: Link, between: tuple[str, str], *, alone: bool) -> str:
        name = self._names.identifier(link.id if alone else f"{link.id}_{between[0]}_{between[1]}")
        self._made.append(Channel(name, *between, SIGNAL, capacity=0, line=link.line))
        return name

    def _limits(self, link: Link, senders: _Side, receivers: _Side) -> None:
        where = f"channel {link.id!r}"
        met = any(sender != receiver for sender in senders for receiver in receivers)
        if link.is_broadcast and (met or not senders):
            rule = "a broadcast meets all that are ready and waits for none; here it meets one, and waits for it"
            self.losses.append(Loss(where, link.line, rule))
        if link.is_urgent:
            self.losses.append(Loss(where, link.line, "is urgent; here time may pass before it is taken"))
        meets_tester = any((link.id, sign) in self.tester for sign in "!?")
        if not met and not meets_tester and not (link.is_broadcast and senders):
            other = "no other process" if senders and receivers else "no process"
            rule = f"{other} {'receives' if senders else 'sends'} on it, so that it blocks; here the environment does"
            self.losses.append(Loss(where, link.line, rule))
        sent = {action.target for _, steps in senders.values() for step in steps for action in step.actions}
        read = {id for _, steps in receivers.values() for step in steps for id in names(step.guard)}
        if both := sorted(sent & read):
            rule = f"a receiver's guard reads {', '.join(both)} before the sender's update; here it reads after it"
            self.losses.append(Loss(where, link.line, rule))
