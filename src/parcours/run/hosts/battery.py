"""What every host owes, as checks that a host's author can run; each raises HostFailure for a broken duty.

The checks run toy components: Source sends to Sink, Counting answers the tester. A host is made by a factory
(components, links, environment) -> host with inject, run, trace, reset and close.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from parcours.errors import HostFailure
from parcours.run.hosts.node_program import Plain
from parcours.run.hosts.slots import Answer
from parcours.run.port import ENVIRONMENT, Component, Link, LinkKind, Send, Step
from parcours.run.trace import Trace, transitions


class HostUnderTest(Protocol):
    """What the battery needs of a host."""

    def inject(self, channel: str, message: object, at: int | None = None) -> None:
        """Send in the place of the environment."""

    def run(self, until: int) -> None:
        """Run until `until` [ns], or until nothing is left that could happen."""

    def trace(self) -> Trace:
        """Return what happened."""

    def reset(self) -> None:
        """Return to the start."""

    def close(self) -> None:
        """Let go of everything held."""


Factory = Callable[[Sequence[Component], Sequence[Link], Answer], HostUnderTest]

_LIMIT = 2_000_000_000


@dataclass(frozen=True, slots=True)
class ToyStep:
    """A toy's transition."""

    transition: str
    sends: tuple[Send, ...] = ()


class _Toy:
    """A component that never acts by itself, and has nothing to forget."""

    def next_wake(self) -> int | None:
        """Never."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Do nothing."""
        return iter(())

    def reset(self) -> None:
        """Forget nothing."""


class Source(_Toy):
    """Sends 0, 1, ... on `numbers`: two a transition, `bursts` transitions, one every `period` [ns]."""

    name = "Source"

    def __init__(self, bursts: int = 20, period: int = 100_000) -> None:
        self._bursts, self._period, self._done = bursts, period, 0

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Idle: s0."""
        yield ToyStep("s0")

    def next_wake(self) -> int | None:
        """The next burst."""
        return self._done * self._period if self._done < self._bursts else None

    def wake(self, now: int) -> Iterator[Step]:
        """Send two numbers: s1."""
        k = 2 * self._done
        self._done += 1
        yield ToyStep("s1", (("numbers", k), ("numbers", k + 1)))

    def reset(self) -> None:
        """Start again."""
        self._done = 0


class Sink(_Toy):
    """Passes what it receives to the tester on `seen`: k1 takes it, k2 passes it on."""

    name = "Sink"

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take, pass on."""
        yield ToyStep("k1")
        yield ToyStep("k2", (("seen", message),))


class Counting(_Toy):
    """Answers `ask` on `answer` with how often it was asked: c1 on even, c2 on odd counts."""

    name = "Counting"

    def __init__(self) -> None:
        self._asked = 0

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Count and answer."""
        self._asked += 1
        yield ToyStep("c2" if self._asked % 2 else "c1", (("answer", self._asked),))

    def reset(self) -> None:
        """Forget the count."""
        self._asked = 0


def node_program(component: str) -> Plain:
    """Return the node program of a toy: Source, Sink or Counting."""
    return Plain(component, {"Source": Source, "Sink": Sink, "Counting": Counting})


_PIPE = (Link("numbers", "Source", "Sink", 1, LinkKind.SERVICE), Link("seen", "Sink", ENVIRONMENT, 1000))
_DESK = (Link("ask", ENVIRONMENT, "Counting", 1000), Link("answer", "Counting", ENVIRONMENT, 1000))


def _pipe(make: Factory) -> tuple[list[object], Trace]:
    seen: list[object] = []

    def tester(channel: str, payload: object, now: int) -> Sequence[Send]:
        seen.append(payload)
        return ()

    host = make((Source(), Sink()), _PIPE, tester)
    host.run(_LIMIT)
    trace = host.trace()
    host.close()
    return seen, trace


def keeps_order(make: Factory) -> None:
    """Messages of one channel are taken up in the order in which they were sent."""
    seen, trace = _pipe(make)
    _owe(seen == sorted(seen, key=lambda n: int(str(n))), "order is kept per channel", f"the tester saw {seen}")
    for channel in ("numbers", "seen"):
        got = [e.message for e in trace.events if e.kind == "receive" and e.channel == channel]
        _owe(got == sorted(got), "order is kept per channel", f"{channel} was taken up as {got}")


def loses_and_doubles_nothing(make: Factory) -> None:
    """Every message sent on a service is taken up exactly once, and every transition is recorded once."""
    seen, trace = _pipe(make)
    rule = "nothing is lost or duplicated"
    _owe(Counter(seen) == Counter(range(40)), rule, f"of 0..39, sent once each, the tester saw {seen}")
    for channel in ("numbers", "seen"):
        sent, got = (
            Counter(e.message for e in trace.events if e.kind == kind and e.channel == channel)
            for kind in ("send", "receive")
        )
        _owe(sent == got and max(sent.values(), default=0) == 1, rule, f"{channel}: sent {sent}, taken up {got}")
    taken = Counter(transitions(trace))
    _owe(taken == {"s1": 20, "k1": 40, "k2": 40}, rule, f"transitions recorded: {dict(taken)}")


def never_runs_backwards(make: Factory) -> None:
    """Times in a trace never decrease, and no message is taken up before it is sent."""
    _, trace = _pipe(make)
    times = [event.time for event in trace.events]
    _owe(bool(times) and times[0] >= 0 and times == sorted(times), "time never runs backwards", f"times: {times}")
    sent: set[int] = set()
    for event in trace.events:
        if event.kind == "send":
            sent.add(event.message)
        early = event.kind == "receive" and event.message not in sent
        _owe(not early, "nothing is taken up before it is sent", f"message {event.message} was")


def resets_without_residue(make: Factory) -> None:
    """After reset the same stimuli give the same record, whatever was left undone before."""
    host = make((Counting(),), _DESK, lambda channel, payload, now: ())
    host.inject("ask", "a")
    host.run(_LIMIT)
    first = _story(host.trace())
    host.inject("ask", "never taken up")
    host.reset()
    _owe(not host.trace().events, "reset leaves no residue", f"the trace holds {host.trace().events}")
    host.run(_LIMIT)
    _owe(not host.trace().events, "reset leaves no residue", f"unasked, there came {host.trace().events}")
    host.reset()
    host.inject("ask", "a")
    host.run(_LIMIT)
    again = _story(host.trace())
    host.close()
    _owe(first == again and bool(first), "reset leaves no residue", f"first {first}, after reset {again}")


def closes_twice(make: Factory) -> None:
    """Closing again is harmless, and what ran can still be read."""
    host = make((Counting(),), _DESK, lambda channel, payload, now: ())
    host.inject("ask", "a")
    host.run(_LIMIT)
    host.close()
    try:
        host.close()
    except Exception as error:
        raise HostFailure("host", f"closing twice is harmless, but raised {error!r}", slug="host-duty") from error
    taken = transitions(host.trace())
    _owe(taken == ("c2",), "a closed host's trace can be read", f"it holds {taken}")


DUTIES: dict[str, Callable[[Factory], None]] = {
    duty.__name__: duty
    for duty in (keeps_order, loses_and_doubles_nothing, never_runs_backwards, resets_without_residue, closes_twice)
}
"""All checks by name."""


def _story(trace: Trace) -> list[tuple[object, ...]]:
    return [(e.kind, e.component, e.transition, e.channel, e.message, e.payload) for e in trace.events]


def _owe(held: bool, rule: str, given: str) -> None:
    if not held:
        raise HostFailure("host", f"{rule}, but {given}", "see the duties in docs/hosts.md", slug="host-duty")
