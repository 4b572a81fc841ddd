"""What a model says of data: every `ensures:` and invariant, with the types of the names that it may read.

channel       it        a message on it              transition   a variable      its value after the transition
              last      the one before it, of its                 old.variable    ... and before it
                        sender                                    the event's     the message received
              request   what it answers: the last                 name
                        one that its sender received              a channel       the message sent on it
                        on the other channel of the               last.channel    the one sent before that
                        same topic
              a variable of its sender               component    a variable      its value after any transition
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from parcours.model.expression import Type
from parcours.model.scope import Classes, Scopes
from parcours.model.structure import Cefsm, Channel, Formula

_QUOTED = 160
"""Longest formula that a verdict quotes [characters]."""

_OLD, _LAST, _RECEIVED = "old values", "last messages", "messages received by "
"""Classes that stand for `old`, `last` and `received`: no class of a model has a blank in its name."""


@dataclass(frozen=True, slots=True)
class Clause:
    """A formula and its subject."""

    of: Literal["channel", "transition", "component"]
    owner: str
    """The name of the channel, transition or component."""
    formula: Formula
    types: Mapping[str, Type]
    classes: Classes

    @property
    def id(self) -> str:
        """Its name in reports: `trajectory_response/speed`."""
        return f"{self.owner}/{self.formula.name}"

    @property
    def said(self) -> str:
        """The formula as a verdict quotes it: in full, or if it is long, by its line in the model's file."""
        text, line = self.formula.text, self.formula.line
        return f'"{text}"' if len(text) <= _QUOTED or not line else f"the formula (line {line} of the model)"


def clauses(cefsm: Cefsm) -> Iterator[Clause]:
    """Yield what a model says of data, in the order of its file."""
    scopes = Scopes(cefsm)
    carried = {channel.name: Type(channel.message) for channel in cefsm.carriers}
    components = {component.name for component in cefsm.components}
    received: dict[str, dict[str, Type]] = {}
    for channel in cefsm.carriers:
        received.setdefault(_RECEIVED + channel.receiver, {})[channel.name] = carried[channel.name]
    classes = {**scopes.classes, **received}
    for channel in cefsm.carriers:
        types = {**scopes.types(channel.sender)} if channel.sender in components else {}
        types |= {"it": carried[channel.name], "last": carried[channel.name]}
        types["received"] = Type(_RECEIVED + channel.sender)
        if (asked := reverse(cefsm, channel)) is not None:
            types["request"] = carried[asked.name]
        for formula in channel.ensures:
            yield Clause("channel", channel.name, formula, types, classes)
    for component in cefsm.components:
        variables = scopes.types(component.name)
        for formula in component.invariants:
            yield Clause("component", component.name, formula, variables, classes)
        for transition in component.transitions():
            sent = {send.channel: carried[send.channel] for send in transition.sends if send.channel in carried}
            types = {**scopes.types(component.name, transition), **sent, "old": Type(_OLD), "last": Type(_LAST)}
            types["received"] = Type(_RECEIVED + component.name)
            for formula in transition.ensures:
                own = {**classes, _OLD: variables, _LAST: sent}
                yield Clause("transition", transition.id, formula, types, own)


def reverse(cefsm: Cefsm, channel: Channel) -> Channel | None:
    """Return the channel of the same topic that leads the other way: requests, if these are answers."""
    ends = channel.receiver, channel.sender
    return next(
        (each for each in cefsm.channels if channel.topic == each.topic != "" and (each.sender, each.receiver) == ends),
        None,
    )
