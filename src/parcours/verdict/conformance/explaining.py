"""An observation that the model does not allow -> the sentence that says which rule of the model it breaks."""

from __future__ import annotations

from parcours.model.configuration import Message
from parcours.verdict.conformance.tracking import Node, Tracker


def why_not_taken(tracker: Tracker, node: Node, transition: str) -> str:
    """Return why a transition cannot have been taken from any state of the set."""
    behaviour = tracker.behaviour
    known = behaviour.transitions.get(transition)
    if known is None:
        return f"{transition} is no transition of {behaviour.name}"
    if not tracker.is_settled(node):
        return f"{transition} came before what the last transition must send"
    if known.event is not None:
        channel = known.event.channel
        told = [behaviour.receive(state._replace(foreign=frozenset()), channel, ()) for state in node.states]
        if any(True for state in told for _ in behaviour.take(state, transition)):
            return f"{transition} needs a message of {channel}, but none was there to take up"
    return f"{transition} cannot be taken here"


def why_not_sent(tracker: Tracker, node: Node, channel: str, observed: Message) -> str:
    """Return why a message cannot have been sent from any state of the set."""
    behaviour = tracker.behaviour
    if channel not in behaviour.sends:
        return f"{channel} is no channel that {behaviour.name} sends on"
    if observed and tracker.send(node, channel).node is not None:
        values = ", ".join(f"{name} = {value!r}" for name, value in observed)
        return f"{channel} was sent with {values}, which is not what the model says"
    if tracker.observes == "messages":
        return f"{channel} was sent, but nothing that it may do now sends it"
    if not tracker.is_settled(node):
        return f"{channel} was sent, where the transition taken sends another message"
    return f"{channel} was sent, but no transition taken sends it"
