"""Steps that meet on channels to channels with one sender and one receiver each.

A channel of UPPAAL may have many senders and receivers; ours links two components. So it becomes one for each
pair of components whose processes meet on it, and the steps on it are there once for each partner.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

from parcours.errors import BadModel
from parcours.model.conversion import Loss
from parcours.model.expression import names
from parcours.model.structure import ENVIRONMENT, Channel, MessageClass
from parcours_formats.naming import Names
from parcours_formats.uppaal.steps import MAX_STEPS, Step
from parcours_formats.uppaal.symbols import Link

SIGNAL = "Signal"
"""The message class of every channel: UPPAAL's carry nothing."""

_Side = dict[str, tuple[int, list[Step]]]


class Linking:
    """The channels of one system.

    Args:
        processes: name, index of the component and steps of each process.
        components: the name of each component.
        tester: (channel of the file, sign) of the steps of the process that stands for the environment.
        origin: the file's name, for messages.

    Raises:
        BadModel: steps that meet would be written out more than MAX_STEPS times.

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
        origin: str = "",
    ) -> None:
        self.components, self.tester, self.origin, self._steps = components, tester, origin, 0
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
        self._bounded(link, senders, receivers)
        pairs = {
            (one, other): (mine, theirs)
            for one, mine in _by_component(senders).items()
            for other, theirs in _by_component(receivers).items()
            if mine != theirs or len(mine) > 1
        }
        for side, sign, other_sign in ((senders, "!", "?"), (receivers, "?", "!")):
            if not pairs or (link.id, other_sign) in self.tester:
                for group in dict.fromkeys(group for group, _ in side.values()):
                    ends = (self.components[group], ENVIRONMENT)
                    name = self._channel(link, ends if sign == "!" else ends[::-1], alone=len(side) == 1)
                    for process in (process for process, (owner, _) in side.items() if owner == group):
                        self.partners.setdefault((process, link.id, sign), []).append((name, ENVIRONMENT))
        for (one, other), (mine, theirs) in pairs.items():
            between = (self.components[one], self.components[other])
            name = self._channel(link, between, alone=len(pairs) == 1)
            for processes, others, sign, partner in ((mine, theirs, "!", between[1]), (theirs, mine, "?", between[0])):
                for process in processes:
                    if others != [process]:  # nobody meets itself
                        self.partners.setdefault((process, link.id, sign), []).append((name, partner))

    def _bounded(self, link: Link, senders: _Side, receivers: _Side) -> None:
        # Each step on the channel is there once for each component on the other side.
        for side, others in ((senders, receivers), (receivers, senders)):
            partners = len({group for group, _ in others.values()})
            self._steps += max(partners, 1) * sum(len(steps) for _, steps in side.values())
        if self._steps > MAX_STEPS:
            ends = f"{len(senders)} processes that send with {len(receivers)} that receive"
            rule = (
                f"steps that meet are written out once for each partner, at most {MAX_STEPS} in all, "
                f"but channel {link.id!r} joins {ends}"
            )
            remedy = "instantiate fewer processes: a few on each side behave like many"
            raise BadModel(f"{self.origin}:{link.line}", rule, remedy, slug="expansion-size")

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


def _by_component(side: _Side) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    for process, (group, _) in side.items():
        found.setdefault(group, []).append(process)
    return found
