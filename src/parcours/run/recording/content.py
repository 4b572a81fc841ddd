"""The topics of a recording: what Parcours says at the start and end of a run, its events, and its channels."""

from __future__ import annotations

import re

from parcours.run.recording.layout import Entry, MessageLayout, flat_md5
from parcours.run.recording.topic import Raw, Topic

FORMAT = "recording/1"

BEGIN = 1_000_000_000
"""A run without a known start is written as if it started 1 s after the epoch [ns]: in ROS, time 0 is no time."""

EVENT = MessageLayout(
    (
        Entry("number", "int", "counts the events as they were written, from 0"),
        Entry("time", "int", "since the run began [ns]"),
        Entry("message", "int", "number of the message; -1 if none"),
        Entry("payload", "int", "number of the event whose payload it is, itself or an earlier one; -1 if none"),
        Entry("raw", "bool", "its payload is recorded as it was serialised"),
        Entry("kind", "text", "take, send, receive, hold, release, drop, deviation or note"),
        Entry("component", "text"),
        Entry("transition", "text"),
        Entry("channel", "text"),
        Entry("topic", "text", "where its payload is recorded at the same time; empty if nowhere"),
        Entry("text", "text"),
    ),
    "an event",
)
"""An event as a message; what does not apply is empty."""

EVENTS = Topic("/parcours/events", "parcours/Event", EVENT.md5, EVENT.definition)

TEXT = MessageLayout((Entry("data", "text"),), "a text")
"""std_msgs/String."""

RUN = Topic("/parcours/run", "std_msgs/String", TEXT.md5, TEXT.definition, latched=True)
"""First message of a recording, JSON: clock, host, case, start [ns since the epoch], and what else is known."""

END = Topic("/parcours/end", "std_msgs/String", TEXT.md5, TEXT.definition, latched=True)
"""Last message of a whole recording, JSON: how many events there are, the machine's noise, and what else is known."""


class Names:
    """Gives each channel a topic and a type of its own, under names that ROS allows.

    >>> names = Names()
    >>> [(t.name, t.type) for t in (names.flat("best_trajectory", ""), names.flat("best-trajectory", ""))]
    [('/best_trajectory', 'parcours/BestTrajectory'), ('/best_trajectory_2', 'parcours/BestTrajectory2')]
    """

    def __init__(self) -> None:
        self._names = {RUN.name, EVENTS.name, END.name}
        self._types = {"parcours/Event"}

    def flat(self, channel: str, definition: str) -> Topic:
        """Return a topic for the channel's payloads in their flat form."""
        name = self._name(channel)
        words = re.findall(r"[A-Za-z0-9]+", name)
        kind = _free("parcours/" + "".join(word[0].upper() + word[1:] for word in words), "", self._types)
        return Topic(name, kind, flat_md5(definition), definition)

    def raw(self, channel: str, one: Raw) -> Topic:
        """Return a topic for the channel's messages of a foreign type, that of one of them."""
        return Topic(self._name(channel), one.type, one.md5, one.definition, encoding=one.encoding)

    def _name(self, channel: str) -> str:
        plain = re.sub(r"[^A-Za-z0-9_/]+|/(?![A-Za-z])", "_", channel.strip("/"))
        return _free("/" + (plain if plain[:1].isalpha() else f"channel_{plain}"), "_", self._names)


def _free(wanted: str, joint: str, taken: set[str]) -> str:
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}{joint}{number}"
    taken.add(name)
    return name
