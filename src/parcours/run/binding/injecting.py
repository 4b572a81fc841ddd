"""Makes the tester's messages: a base, and formulas over names, compiled for the message's type."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from parcours.errors import HostFailure
from parcours.run.binding.access import Access
from parcours.run.binding.formulas import Formula
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.places import Place


@dataclass(frozen=True, slots=True)
class Writer:
    """Makes messages of one type: all 0 or empty, but for some places with values, then some set to formulas."""

    type: str
    types: MessageTypes
    where: str
    base: tuple[tuple[Access, object], ...] = ()
    set: tuple[tuple[Access, Formula], ...] = ()

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

    def _value(self, formula: Formula, values: Mapping[str, object], more: Mapping[str, object]) -> object:
        found: dict[Place, object] = {}
        for place in formula.places:
            name = str(place)
            if name not in more and name not in values:
                rule = f"a name must have a value when a message is made, but {name!r} has none"
                raise HostFailure(self.where, rule, "give it as an input of the case", slug="binding-value")
            found[place] = more[name] if name in more else values[name]
        return formula.value(found, self.where)
