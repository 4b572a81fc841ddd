"""What a host remembers of each component and each link while they run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from parcours.errors import BadRequest, one_of
from parcours.run.port import ENVIRONMENT, Component, Link, Send, Step

Answer = Callable[[str, object, int], Iterable[Send]]
"""A tester as a plain function: (channel, payload, time [ns]) -> what it sends in return."""


@dataclass(slots=True)
class Message:
    """One message under way. `order` is its place among all that arrived."""

    channel: str
    number: int
    payload: object
    sender: Slot | None = None
    arrived: int = 0
    order: int = 0


@dataclass(slots=True)
class Slot:
    """A component's place on the host: what it is doing, what waits for it, what it has yet to send."""

    component: Component
    index: int
    inbox: deque[Message] = field(default_factory=deque)
    outbox: deque[Send] = field(default_factory=deque)
    work: Iterator[Step] | None = None
    step: Step | None = None
    waits: str = ""
    """The channel on which it waits for room; empty if it does not."""
    wake: int | None = None
    turn: int = 0
    """Counts the ends of transitions that were foretold: an end of an earlier turn does not happen."""
    ends: int = 0
    """When the transition in progress ends [ns], if there is one."""
    left: int = 0
    """How long it had yet to go when the component was frozen [ns]."""
    acted: int = 0
    """When it last ended a transition or action [ns]."""
    dead: bool = False
    frozen: bool = False

    @property
    def is_out(self) -> bool:
        """Whether it can do nothing now, by a fault."""
        return self.dead or self.frozen

    @property
    def name(self) -> str:
        """The component's name."""
        return self.component.name

    def first(self) -> Message | None:
        """Return the message that has waited longest, of those that the component listens to; None if there is none."""
        if not self.inbox:
            return None
        deaf = getattr(self.component, "deaf", ())
        return next((one for one in self.inbox if one.channel not in deaf), None) if deaf else self.inbox[0]

    def forget(self, message: Message) -> None:
        """Take a message out of the inbox."""
        del self.inbox[next(k for k, one in enumerate(self.inbox) if one is message)]

    def clear(self) -> None:
        """Forget everything but the component."""
        self.inbox.clear()
        self.outbox.clear()
        self.work = self.step = self.wake = None
        self.waits = ""
        self.turn += 1
        self.acted = 0
        self.dead = self.frozen = False


@dataclass(slots=True)
class Queue:
    """A link in use: how many of its messages are under way or waiting, and which wait for room."""

    link: Link
    index: int
    open: int = 0
    parked: deque[Message] = field(default_factory=deque)
    last_arrival: int = 0

    def clear(self) -> None:
        """Forget all traffic."""
        self.open = self.last_arrival = 0
        self.parked.clear()


@dataclass(frozen=True, slots=True)
class _Reply:
    sends: tuple[Send, ...]
    transition: str = ""


class Answering:
    """The tester as a component, made from a plain function; it answers at once and never acts unasked."""

    name = ENVIRONMENT

    def __init__(self, answer: Answer) -> None:
        self._answer = answer

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Send what the function returns."""
        if channel is not None:
            yield _Reply(tuple(self._answer(channel, message, now)))

    def next_wake(self) -> int | None:
        """Return None."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Do nothing."""
        return iter(())

    def reset(self) -> None:
        """A function keeps no state that is ours to reset."""


def silence(channel: str, payload: object, now: int) -> Iterable[Send]:
    """Answer nothing: the tester of a run that only listens.

    >>> list(silence("news", 1, 0))
    []
    """
    return ()


def injection_time(channel: str, links: Mapping[str, Link], here: Container[str], at: int | None, now: int) -> int:
    """Return when a message is to be sent in the place of the environment, or of a component that is not here [ns].

    Raises BadRequest if the channel is unknown, belongs to a component that is here, or the time is past.
    """
    link = links.get(channel)
    if link is None:
        raise BadRequest("inject", f"no link is called {channel!r}", one_of(channel, list(links)),
                         slug="unknown-channel")  # fmt: skip
    if link.sender != ENVIRONMENT and link.sender in here:
        rule = f"only the tester's channels can be injected, but {link.sender} itself sends here"
        raise BadRequest(f"channel {channel!r}", rule, "leave the component out", slug="foreign-channel")
    if at is not None and at < now:
        rule = f"time never runs backwards, but {at} ns was given at {now} ns"
        raise BadRequest(f"inject on {channel!r}", rule, "inject before the run", slug="time-backwards")
    return now if at is None else at
