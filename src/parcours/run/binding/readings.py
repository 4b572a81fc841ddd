"""Reads values from messages: formulas over places, compiled once for the messages' types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from parcours.model.expression import Type
from parcours.run.binding.access import Access
from parcours.run.binding.formulas import Formula
from parcours.run.binding.places import Place
from parcours.run.binding.structure import BoundChannel, Constant


@dataclass(frozen=True, slots=True)
class Reading:
    """A formula that is known to make sense for messages of certain channels.

    `sources` say where the value of each place comes from: (place, channel, access in a message of that channel).
    """

    formula: Formula
    type: Type
    sources: tuple[tuple[Place, str, Access], ...]
    constants: Mapping[Place, Constant]
    where: str

    @property
    def channels(self) -> frozenset[str]:
        """The channels of whose messages it speaks."""
        return frozenset(channel for _, channel, _ in self.sources)

    def value(self, messages: Mapping[str, object]) -> object:
        """Return its value.

        Args:
            messages: a message of each of its channels.

        Raises:
            HostFailure: a message has too few items.
            BadModel: the formula cannot be computed, as when it divides by zero.
        """
        values: dict[Place, object] = dict(self.constants)
        for place, channel, access in self.sources:
            values[place] = access.read(messages[channel])
        return self.formula.value(values, self.where)


def message_type(channel: BoundChannel) -> str:
    """Return the type of a channel's messages; a half of a service has one of its own.

    >>> message_type(BoundChannel("plan", "/plan", "nav_msgs/GetPlan", "request"))
    'nav_msgs/GetPlanRequest'
    """
    return channel.type + {"topic": "", "request": "Request", "response": "Response"}[channel.part]
