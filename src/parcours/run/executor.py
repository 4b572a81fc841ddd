"""How gated execution drives instances of components, wherever they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from parcours.abtc import Event
from parcours.run.clocks import ClockName
from parcours.run.instance import Outcome

PATIENCE = 5_000_000_000
"""How long a turn may take on the real clock [ns] before it counts as not coming."""


@dataclass(frozen=True, slots=True)
class Turn:
    """A granted event, with the message that it takes up: its number (-1 for none) and payload."""

    event: Event
    message: int = -1
    payload: object = None


class Instances(Protocol):
    """Where a case's instances are, and how they learn whose turn it is."""

    @property
    def label(self) -> str:
        """The host's name in traces."""

    @property
    def clock(self) -> ClockName:
        """Which kind of time the outcomes are stamped with."""

    @property
    def ahead(self) -> bool:
        """Whether several turns of an instance may be granted at once."""

    def begin(self, case: str, events: Sequence[Event]) -> None:
        """Make a fresh instance for each reference, in the order of their first events; time begins at zero."""

    def sealed(self, channel: str, payload: object) -> object:
        """Return the payload in the form in which it travels."""

    def opened(self, channel: str, sealed: object) -> object:
        """Return the payload that travelled in that form."""

    def now(self) -> int:
        """The time [ns]."""

    def grant(self, turns: Sequence[Turn]) -> None:
        """Let an instance take these turns, all of one reference, one after the other."""

    def outcomes(self, patience: int) -> Sequence[tuple[int, Outcome]]:
        """Return (reference, outcome) of turns that are over, in each one's order; nothing after `patience` [ns]."""

    def views(self) -> dict[int, tuple[str, object]]:
        """Return what instances show of themselves, as sealed payloads of a channel, by reference."""

    def end(self) -> None:
        """Forget the case."""
