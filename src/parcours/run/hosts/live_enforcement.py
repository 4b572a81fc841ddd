"""Drives the instances of an abstract case, on a transport's nodes, turn by turn by gated execution.

Each reference is an instance in its component's node; a message between references passes through the tester, which
holds it in its gate.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from typing import Protocol, cast

from msgspec import structs

from parcours.abtc import Event
from parcours.errors import HostFailure
from parcours.run.clocks import ClockName, WallClock
from parcours.run.enforcement import Turn as Due
from parcours.run.hosts.frames import Begin, Died, Grant, Look, OfferedTurn, Ready, Report, Turned, ViewShown, Wire
from parcours.run.hosts.launching import bring_to_rest, ending
from parcours.run.hosts.node_program import Codec, Transport
from parcours.run.instance import HandedOver, TurnOutcome
from parcours.run.port import StepReport

_ANSWER = 10_000_000_000
"""How long a node may take to make instances, or to show them [ns]."""

_REST = 2_000_000_000
"""How long a node may take to forget a case [ns]; then it is killed."""


class LiveStimuli(Protocol):
    """How a case's tester moves instances on: by names and messages, since it happens in processes of their own."""

    def case(self) -> bytes:
        """Return the case as node programs know it."""

    def prompt(self, event: Event) -> str:
        """Return the name of what moves the idle instance to a transition that no message starts."""

    def given(self, event: Event) -> tuple[str, object] | None:
        """Return the message that does so instead of a prompt; None if none does."""

    def settling(self, event: Event) -> Sequence[tuple[str, object]]:
        """Return the messages that set, before the event, what the model calls input variables."""


class DrivenInstances:
    """Instances on a transport's nodes."""

    ahead = True
    clock: ClockName = "wall"

    def __init__(self, transport: Transport, codec: Codec, stimuli: LiveStimuli) -> None:
        self._transport, self._codec, self._stimuli = transport, codec, stimuli
        self.label = transport.label
        self._clock = WallClock()
        self._nodes: dict[int, str] = {}
        self._frames: dict[int, OfferedTurn] = {}
        self._heard: list[tuple[str, Report]] = []
        self._gone: set[str] = set()

    def begin(self, case: str, events: Sequence[Event]) -> None:
        """Make the instances, and wait until all are made.

        Raises HostFailure if a component has no node, or its node is gone or does not answer.
        """
        self._nodes = {event.reference: event.component for event in events}
        for name in self._nodes.values():
            if name not in self._transport.nodes:
                raise HostFailure(
                    f"case {case}", f"each component has a node, but {name} has none", slug="node-missing"
                )
        self._frames = {event.position: self._frame(event) for event in events}
        self._clock.restart()
        waiting = set(self._nodes.values())
        for name in waiting:
            references = tuple(reference for reference, node in self._nodes.items() if node == name)
            self._transport.command(name, Begin(self._stimuli.case(), references, self._clock.zero))
        while waiting:
            node, said = self._next(waiting)
            if isinstance(said, Ready):
                waiting.discard(node)

    def _frame(self, event: Event) -> OfferedTurn:
        settling = tuple(
            Wire(channel, self._codec.encode(channel, one)) for channel, one in self._stimuli.settling(event)
        )
        if event.receives is not None:
            return OfferedTurn(event.transition, settle=settling)
        given = self._stimuli.given(event)
        wire = None if given is None else Wire(given[0], self._codec.encode(*given))
        return OfferedTurn(event.transition, -1, self._stimuli.prompt(event), wire, settling)

    def sealed(self, channel: str, payload: object) -> object:
        """Return the payload's bytes."""
        return self._codec.encode(channel, payload)

    def opened(self, channel: str, sealed: object) -> object:
        """Return the payload."""
        return self._codec.decode(channel, cast(bytes, sealed))

    def now(self) -> int:
        """The time since the case began [ns]."""
        return self._clock.now()

    def grant(self, turns: Sequence[Due]) -> None:
        """Deliver the messages that the turns await, and grant them."""
        frames = []
        for due in turns:
            frame = self._frames[due.event.position]
            if due.event.receives is not None:
                self._transport.deliver(due.event.receives.channel, due.message, cast(bytes, due.payload))
                frame = structs.replace(frame, awaits=due.message)
            frames.append(frame)
        reference = turns[0].event.reference
        self._transport.command(self._nodes[reference], Grant(reference, tuple(frames)))

    def outcomes(self, patience: int) -> Sequence[tuple[int, TurnOutcome]]:
        """Return what came of turns; a node that is gone raises in all its instances."""
        until = time.perf_counter_ns() + patience
        over: list[tuple[int, TurnOutcome]] = []
        while not over and time.perf_counter_ns() < until:
            for node, said in self._transport.poll(until):
                if isinstance(said, Turned):
                    over.append((said.reference, _outcome(said)))
                elif isinstance(said, Died):
                    self._gone.add(node)
                    text = f"its process ended: {ending(said.status)}"
                    gone = TurnOutcome("raised", self._clock.now(), text=text)
                    over += ((reference, gone) for reference, name in self._nodes.items() if name == node)
        return over

    def views(self) -> dict[int, tuple[str, object]]:
        """Ask every instance what it shows of itself."""
        for reference, node in self._nodes.items():
            self._transport.command(node, Look(reference))
        waiting = set(self._nodes)
        shown: dict[int, tuple[str, object]] = {}
        while waiting:
            _, said = self._next(set(self._nodes.values()))
            if isinstance(said, ViewShown):
                waiting.discard(said.reference)
                if said.message is not None:
                    shown[said.reference] = (said.message.channel, said.message.data)
        return shown

    def end(self) -> None:
        """Let the nodes forget the case: what is still under way of it is not heard any more."""
        bring_to_rest(self._transport, set(self._nodes.values()) - self._gone, _REST)
        self._nodes = {}

    def _next(self, waiting: Collection[str]) -> tuple[str, Report]:
        """Return the next report; raise HostFailure if a node that is waited for is gone, or says nothing for long."""
        until = time.perf_counter_ns() + _ANSWER
        while not self._heard:
            self._heard.extend(self._transport.poll(until))
            if not self._heard and time.perf_counter_ns() >= until:
                rule = f"nodes must answer within {_ANSWER * 1e-9:g} s, but silent are: {', '.join(sorted(waiting))}"
                raise HostFailure(f"{self.label} host", rule, slug="node-silent")
        node, said = self._heard.pop(0)
        if isinstance(said, Died) and node in waiting:
            rule = f"must live as long as the host, but its process ended: {ending(said.status)}"
            raise HostFailure(f"node {node}", rule, "start the host again", slug="node-gone")
        return node, said


def _outcome(said: Turned) -> TurnOutcome:
    sends = tuple((wire.channel, wire.data) for wire in said.sends)
    asides = tuple((time, (wire.channel, wire.data)) for time, wire in said.asides)
    told = None if said.variables is None else StepReport(said.variables, said.operations)
    settled = tuple(
        HandedOver(time, (one.channel, one.data), tuple((wire.channel, wire.data) for wire in sent))
        for time, one, sent in said.settled
    )
    return TurnOutcome(said.manner, said.time, said.transition, sends, said.received, asides, said.text, told, settled,
                   early=sum(time < said.received for time, _ in said.asides))  # fmt: skip
