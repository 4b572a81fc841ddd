"""What a name means inside a component: the types of its variables, and of the message an event binds."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, Sequence

from parcours.model.expression.typing import TIME, Type
from parcours.model.structure import BASE_TYPES, CLOCK, Cefsm, Transition, Variable

Classes = Mapping[str, Mapping[str, Type]]
"""The fields of each message class, with their types."""


def classes_of(cefsm: Cefsm) -> dict[str, dict[str, Type]]:
    """Return the fields of each message class, with their types; of equal names the first counts."""
    found: dict[str, dict[str, Type]] = {}
    for message in cefsm.messages:
        found.setdefault(message.name, {f.name: Type(f.type, rank=len(f.shape)) for f in message.fields})
    return found


def variable_type(variable: Variable) -> Type:
    """Return the type of a variable; that of an enumeration carries its values, that of a clock is real."""
    if variable.type == CLOCK:
        return TIME
    if variable.type != "enum":
        return Type(variable.type)
    return Type("enum", tuple(str(value) for value in variable.domain))


def is_local(variable: Variable) -> bool:
    """Return whether the model says the variable's value; inputs, messages that are carried, and clocks are open."""
    return variable.role == "local" and variable.type in BASE_TYPES


class Scopes:
    """The names of every component of one model, looked up once.

    Attributes:
        classes: the fields of each message class, with their types.
    """

    def __init__(self, cefsm: Cefsm) -> None:
        self.classes = classes_of(cefsm)
        self._carried = {channel.name: channel.message for channel in cefsm.channels}
        self._types = {
            component.name: {variable.name: variable_type(variable) for variable in component.variables}
            for component in cefsm.components
        }
        self._domains = {
            component.name: {variable.name: variable.domain for variable in component.variables if variable.domain}
            for component in cefsm.components
        }

    def types(self, component: str, transition: Transition | None = None) -> Mapping[str, Type]:
        """Return the type of each name that a guard or action of the transition may read.

        The event of the transition may bind a name to a message; without a transition, these are the variables alone.
        """
        variables = self._types[component]
        if transition is None or transition.event is None or not transition.event.name:
            return variables
        carried = self._carried.get(transition.event.channel)
        return variables if carried is None else ChainMap({transition.event.name: Type(carried)}, variables)

    def domains(self, component: str) -> Mapping[str, Sequence[object]]:
        """Return the declared domain of each variable that has one."""
        return self._domains[component]
