"""Reads values from messages, and makes messages, by formulas that are compiled once for the messages' types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from parcours.errors import HostFailure
from parcours.model.expression import Type
from parcours.run.binding.access import Access
from parcours.run.binding.formulas import PlacedFormula
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.places import Place
from parcours.run.binding.structure import BoundChannel, Constant


@dataclass(frozen=True, slots=True)
class Reading:
    """A formula that is known to make sense for messages of certain channels.

    `sources` say where the value of each place comes from: (place, channel, access in a message of that channel).
    """

    formula: PlacedFormula
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


@dataclass(frozen=True, slots=True)
class MessageWriter:
    """Makes messages of one type: all 0 or empty, but for some places with values, then some set to formulas.

    Of a response `asked` are the names that speak of its request, with where they are in it; `each` is the list whose
    items are counted.
    """

    type: str
    types: MessageTypes
    where: str
    base: tuple[tuple[Access, object], ...] = ()
    set: tuple[tuple[Access, PlacedFormula], ...] = ()
    asked: tuple[tuple[str, Access], ...] = ()
    each: Access | None = None

    def message(self, values: Mapping[str, object], items: Sequence[Mapping[str, object]] = ()) -> object:
        """Return a new message.

        Args:
            values: a value for each name that the formulas use, e.g. {"robot.x": 0.5}.
            items: further values for each item of a list: a place with `[*]` is set once for each.

        Raises:
            HostFailure: a name has no value, or a value does not fit its field.
            BadModel: a formula cannot be computed, as when it divides by zero.
        """
        made = self.types.create(self.type)
        for access, value in self.base:
            access.write(made, value)
        for access, formula in self.set:
            rounds = items if access.place.is_each else [{}]
            for index, more in enumerate(rounds):
                access.write(made, self._value(formula, values, more), index)
        return made

    def of_request(self, request: object) -> tuple[dict[str, object], list[dict[str, object]]]:
        """Return the values that a request gives to names, and those of each item of its list.

        Raises HostFailure if it has too few items for an index.
        """
        values = {name: access.read(request) for name, access in self.asked if not access.place.is_each}
        if self.each is None:
            return values, []
        listed = {name: access.read(request) for name, access in self.asked if access.place.is_each}
        n = len(cast(Sequence[object], self.each.read(request)))
        return values, [
            {"item.index": k, **{name: cast(Sequence[object], found)[k] for name, found in listed.items()}}
            for k in range(n)
        ]

    def _value(self, formula: PlacedFormula, values: Mapping[str, object], more: Mapping[str, object]) -> object:
        found: dict[Place, object] = {}
        for place in formula.places:
            name = str(place)
            if name not in more and name not in values:
                rule = f"a name must have a value when a message is made, but {name!r} has none"
                raise HostFailure(self.where, rule, "give it as an input of the case", slug="binding-value")
            found[place] = more[name] if name in more else values[name]
        return formula.value(found, self.where)


def message_type(channel: BoundChannel) -> str:
    """Return the type of a channel's messages; a half of a service has one of its own, and so has a goal.

    >>> message_type(BoundChannel("plan", "/plan", "nav_msgs/GetPlan", "request"))
    'nav_msgs/GetPlanRequest'
    """
    return channel.type + {"topic": "", "request": "Request", "response": "Response", "goal": "Goal"}[channel.part]
