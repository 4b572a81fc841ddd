"""Formulas over the places of observed messages, compiled once for their types, to values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from parcours.errors import BadModel
from parcours.model.expression import BOOL, INT, REAL, TEXT, Type
from parcours.run.binding.access import Access, compile_place
from parcours.run.binding.formulas import Formula
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.places import Place, path_text
from parcours.run.binding.structure import Binding, BoundChannel, Constant

TYPE_OF = {bool: BOOL, int: INT, float: REAL, str: TEXT}
"""The type in the guard language of a plain value."""


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


class Compiler:
    """Compiles the formulas of one binding for the message types of one system."""

    def __init__(self, binding: Binding, types: MessageTypes) -> None:
        self.types = types
        self.constants: dict[str, Constant] = dict(binding.constants)
        self.bound = {channel.name: channel for channel in binding.channels}

    def own(self, formula: Formula, channel: BoundChannel, where: str) -> Reading:
        """Return the reading of a formula whose places lie in the message of one channel.

        Raises:
            BadModel: a place is not in the message's type, or the formula does not work on what lies there.
        """
        return self._reading(formula, {place: (channel, place) for place in formula.places}, where)

    def prefixed(self, formula: Formula, where: str) -> Reading:
        """Return the reading of a formula whose places start with the name of a channel.

        Raises:
            BadModel: as for `own`.
        """
        owners = {
            place: (self.bound[str(place.steps[0])], place.within())
            for place in formula.places
            if path_text(place.steps) not in self.constants
        }
        return self._reading(formula, owners, where)

    def _reading(self, formula: Formula, owners: Mapping[Place, tuple[BoundChannel, Place]], where: str) -> Reading:
        types: dict[Place, Type] = {}
        sources: list[tuple[Place, str, Access]] = []
        constants: dict[Place, Constant] = {}
        for place in formula.places:
            if not place.lens and path_text(place.steps) in self.constants:
                constants[place] = self.constants[path_text(place.steps)]
                types[place] = TYPE_OF[type(constants[place])]
                continue
            channel, inner = owners[place]
            if not inner.steps:
                rule = f"a name must go on to a field, but {place} is a whole message"
                raise BadModel(where, rule, f"write {place}.something", slug="binding-field")
            access = compile_place(inner, message_type(channel), self.types, where)
            sources.append((place, channel.name, access))
            types[place] = access.type
        given = types[formula.places[0]] if formula.place else formula.type(types, where)
        return Reading(formula, given, tuple(sources), constants, where)
