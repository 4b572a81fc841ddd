"""What passes the tester on its way between nodes: messages, the calls they belong to, and where they go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from parcours.run.binding.slots import Spoke

BEGINS, ENDS = "the case begins", "the case ends"
"""Notes in a trace: the nodes are ready; the case is over."""

STOPPED, CONTINUED = "stopped by the tester", "continued by the tester"
"""Notes in a trace between which a component was kept from doing anything; nothing is owed meanwhile."""

SCHEDULED = "runs under "
"""How the note begins that says under which rule a component runs that was to run in real time."""

MADE = "made by the tester"
"""The text of what the tester sends in place of other nodes: what cannot be read of it is no sender's fault."""

STALLED = "the machine stood still for [ns] "
"""How the note begins that says for how long, from then on, an ordinary process was not let run."""

Answered = Callable[[bytes | None, str], None]


class Ends(Protocol):
    """Lets bytes go on to a node."""

    def say(self, spoke: Spoke, data: bytes) -> int:
        """Publish; return to how many listeners it was lost."""

    def ask(self, spoke: Spoke, data: bytes, answered: Answered) -> None:
        """Call a service; `answered` gets the response, or None and why there is none."""

    def abandon(self, spoke: Spoke, answered: Answered) -> None:
        """Wait no longer for a response."""


@dataclass(eq=False, slots=True)
class ServiceCall:
    """A call of a service, from the request to the response. Without `reply`, the tester itself asks."""

    service: str
    client: str
    reply: Callable[[bytes | None], None] | None
    is_over: bool = False
    request: bytes = b""


@dataclass(eq=False, slots=True)
class RawMessage:
    """A message of which the tester has the bytes. `slot` is who sent it; empty for the tester."""

    number: int
    channel: str
    slot: str
    sender: str
    data: bytes
    time: int
    call: ServiceCall | None = None
