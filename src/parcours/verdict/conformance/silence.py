"""Decides when silence is a deviation: what each component still owes, and for how long it may.

state of the component   | must send |  must send   | need not |
messages                 |           ^ sent         |          |
debt, timeout 20 ms      |<-- 12 --->|<---- 20 --->! overdue   (a message sent starts the next debt)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Cefsm
from parcours.verdict.conformance.tracking import StateSet, Tracker

NEVER = 1 << 62
"""Later than any time [ns]."""


class MissingMessage(NamedTuple):
    """A message that did not come: when its time was over [ns], who owed it, on which channel."""

    time: int
    component: str
    channel: str


class Debts:
    """The messages that must come and have not.

    A debt starts when the model leaves its component no way around a message, and again when one was sent and the
    next is owed.
    """

    def __init__(self, timeouts: Mapping[str, int], cefsm: Cefsm) -> None:
        channels = [channel.name for channel in cefsm.channels]
        for name, timeout in timeouts.items():
            if name not in channels:
                rule = f"only a channel can be late, but {name!r} is not one"
                raise BadRequest("quiescence", rule, one_of(name, channels), slug="unknown-channel")
            if timeout <= 0:
                rule = f"a timeout is above 0, but {timeout} ns is given"
                raise BadRequest(f"quiescence of {name}", rule, "give it in nanoseconds", slug="quiet-timeout")
        self.timeouts = dict(timeouts)
        self.deadline = NEVER
        self._since: dict[tuple[str, str], int] = {}

    def note(self, component: str, tracker: Tracker, node: StateSet, now: int, sent: str = "") -> None:
        """Take note of where a component stands at `now` [ns], after a message was `sent` on a channel, or none."""
        for channel in self.timeouts:
            key = component, channel
            if not tracker.owes(node, channel):
                self._since.pop(key, None)
            elif channel == sent or key not in self._since:
                self._since[key] = now
        self.deadline = min((since + self.timeouts[key[1]] for key, since in self._since.items()), default=NEVER)

    def first(self) -> MissingMessage:
        """Return the debt that is overdue first; there must be one."""
        return min(MissingMessage(since + self.timeouts[key[1]], *key) for key, since in self._since.items())
