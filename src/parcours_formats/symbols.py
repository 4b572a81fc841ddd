"""Turns the input and output symbols of automata into channels of the environment, and back.

An automaton's alphabet has no data: an input symbol is a message without content that the environment sends, an
output symbol one that it receives. So each symbol becomes a channel of class `Signal`, with the symbol as its topic
where the channel cannot have that very name.
"""

from __future__ import annotations

from collections.abc import Iterator

from parcours.model.conversion import Loss
from parcours.model.nodes import is_label
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel, MessageClass, Receive, Send, Transition
from parcours_formats.naming import UniqueNames

SIGNAL = MessageClass("Signal", ())
"""The class of a message that says nothing but its channel."""


class Alphabet:
    """The channels of the symbols met while reading; a symbol has one channel for each component and direction."""

    def __init__(self) -> None:
        self.names = UniqueNames()
        self.channels: list[Channel] = []
        self._known: dict[tuple[str, str, str], str] = {}

    def received(self, component: str, symbol: str) -> Receive:
        """Return the event in which the component takes the symbol."""
        return Receive(self._channel(symbol, ENVIRONMENT, component))

    def sent(self, component: str, symbol: str) -> tuple[Send, ...]:
        """Return the messages by which the component gives the symbol out."""
        return (Send(self._channel(symbol, component, ENVIRONMENT)),)

    def messages(self) -> tuple[MessageClass, ...]:
        """Return the classes that the channels carry."""
        return (SIGNAL,) if self.channels else ()

    def _channel(self, symbol: str, sender: str, receiver: str) -> str:
        key = (symbol, sender, receiver)
        if key not in self._known:
            name = self._known[key] = self.names.identifier(symbol)
            self.channels.append(Channel(name, *key[1:], SIGNAL.name, "" if name == symbol else symbol))
        return self._known[key]


def symbols_of(cefsm: Cefsm, barred: str = "") -> dict[str, str]:
    """Return the symbol of each channel that has one end at the environment: its topic, or else its name."""
    # A topic is the symbol that a channel was read from; it goes back as long as no two channels become one.
    found: dict[str, str] = {}
    used: set[tuple[str, str, str]] = set()
    for channel in cefsm.channels:
        if ENVIRONMENT in (channel.sender, channel.receiver):
            topic = channel.topic
            # A name of a channel is no other's topic in the same place, or two channels would become one.
            names = {each.name for each in cefsm.channels} if topic else set()
            good = is_label(topic) and not any(sign in topic for sign in barred) and topic not in names
            symbol = topic if good and (channel.sender, channel.receiver, topic) not in used else channel.name
            used.add((channel.sender, channel.receiver, symbol))
            found[channel.name] = symbol
    return found


def is_alphabetic(cefsm: Cefsm) -> bool:
    """Return whether there are no variables, and each transition just takes an input and gives one output or none."""
    outer = {channel.name for channel in cefsm.channels if ENVIRONMENT in (channel.sender, channel.receiver)}
    return not any(component.variables for component in cefsm.components) and all(
        each.event is not None
        and {each.event.channel, *(send.channel for send in each.sends)} <= outer
        and len(each.sends) < 2
        and each.guard is None
        and not each.actions
        and each.duration is None
        and each.weight == 1
        for component in cefsm.components
        for each in component.transitions()
    )


def unsaid_of_channels(cefsm: Cefsm, symbols: dict[str, str]) -> Iterator[Loss]:
    """Yield what symbols do not say of the channels they stand for."""
    transitions = [each for component in cefsm.components for each in component.transitions()]
    used = {each.event.channel for each in transitions if each.event}
    used |= {send.channel for each in transitions for send in each.sends}
    classes = {message.name: message for message in cefsm.messages}
    for channel in cefsm.channels:
        where = f"channel {channel.name!r}"
        if channel.name not in symbols:
            yield Loss(where, channel.line, "a link between components is not known; both its ends become silent")
            continue
        symbol = symbols[channel.name]
        if channel.name not in used:
            yield Loss(where, channel.line, "no transition uses it, and an alphabet holds what is used only")
        if symbol != (channel.topic or channel.name):
            yield Loss(where, channel.line, f"its topic {channel.topic!r} cannot be a symbol; its name stands there")
        elif channel.topic and channel.name != symbol:
            yield Loss(where, channel.line, f"its name is not written; its topic {symbol!r} is the symbol")
        if classes[channel.message] != SIGNAL:
            yield Loss(where, channel.line, f"a symbol has no content; the class {channel.message!r} is left out")
        if channel.capacity != 1:
            yield Loss(where, channel.line, f"its capacity {channel.capacity} is not written")


def silent(transition: Transition, symbols: dict[str, str]) -> Iterator[str]:
    """Yield the channels of a transition that have no symbol."""
    yield from (send.channel for send in transition.sends if send.channel not in symbols)
    if transition.event is not None and transition.event.channel not in symbols:
        yield transition.event.channel
