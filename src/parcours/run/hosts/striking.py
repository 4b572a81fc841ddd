"""A plan of faults and an exchange -> components that crash, freeze and slow down, and messages that meet their fate.

Under a plan, a component that raises has died, as its process would have: what is sent to it is lost, all others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Protocol

from parcours.errors import BadRequest, HostFailure
from parcours.run.clocks import Clock
from parcours.run.faults import UNTOUCHED, ComponentFault, Fate, Fates, FaultPlan, FlatCodec, corrupted
from parcours.run.faults.figures import time_text
from parcours.run.hosts.seats import Message, Seat
from parcours.run.trace import Kind


@dataclass(frozen=True, slots=True)
class Death:
    """A component that is gone: since when [ns], which, and why, e.g. `crash` or `IndexError: ...`."""

    time: int
    component: str
    why: str


class Floor(Protocol):
    """What an exchange lends to its faults."""

    def strike(self, time: int, seat: Seat, act: Callable[[], None]) -> None:
        """Let `act` happen at `time` [ns], before all else that happens then."""

    def ends(self, seat: Seat, time: int) -> None:
        """Let the transition in progress end at `time` [ns]."""

    def go_on(self, seat: Seat) -> None:
        """Send what waits to be sent, and go on working."""

    def discard(self, seat: Seat, message: Message, text: str) -> None:
        """Record that a message to the seat is lost, and give its place on the link free."""

    def write(self, kind: Kind, seat: Seat | None = None, message: Message | None = None, text: str = "") -> None:
        """Write into the trace."""


class Striker:
    """Strikes one exchange by a plan.

    Args:
        plan: what befalls what.
        codec: the flat form of messages; only needed by corruptions.
        seats: the components.
        channels: the names of all links.
        clock: of the exchange.
        floor: the exchange.

    Raises:
        BadRequest: the plan names what the exchange does not have, or corrupts without a codec.
    """

    def __init__(
        self, plan: FaultPlan, codec: FlatCodec | None, seats: Mapping[str, Seat], channels: Collection[str],
        clock: Clock, floor: Floor,
    ) -> None:  # fmt: skip
        plan.check(tuple(channels), tuple(seats))
        if codec is None and any(fault.kind == "corrupt" for fault in plan.of_channels):
            rule = "to corrupt a message its flat form must be known, but no codec was given"
            raise BadRequest("faults", rule, "give the host the codec of the system's messages", slug="fault-codec")
        self._plan, self._codec, self._fates = plan, codec, Fates(plan)
        self._seats, self._clock, self._floor = seats, clock, floor
        self.deaths: list[Death] = []
        self.strikes = 0
        """How many messages and components have been struck."""

    def begin(self) -> None:
        """Start anew: nothing has been struck, and all strikes of components are yet to come."""
        self.deaths.clear()
        self.strikes = 0
        self._count: dict[str, int] = {}
        self._slow: dict[str, float] = {}
        for fault in self._plan.of_components:
            seat = self._seats[fault.component]
            self._floor.strike(fault.at_ns, seat, lambda seat=seat, fault=fault: self._strike(seat, fault))  # type: ignore[misc]
            if fault.until_ns is not None:
                self._floor.strike(fault.until_ns, seat, lambda seat=seat, fault=fault: self._relent(seat, fault))  # type: ignore[misc]

    def meet(self, message: Message) -> Fate:
        """Return the fate of a message that is being sent; its content is changed if that is part of it."""
        channel = message.channel
        if not self._fates.concerns(channel):
            return UNTOUCHED
        k = self._count.get(channel, 0)
        self._count[channel] = k + 1
        fate = self._fates.fate(channel, k, self._clock.now())
        why = fate.why
        self.strikes += bool(why)
        if fate.corrupt is not None and fate.copies:
            said, arrives = self._corrupt(message, fate)
            why = why.replace("corrupted", f"corrupted, {said}")
            if not arrives:
                fate = Fate((), why=why)
        if not fate.copies:
            self._floor.write("drop", message.sender, message, f"fault: {why}")
        elif why:
            self._floor.write("note", message.sender, message, f"fault: {why}")
        return fate

    def cost(self, seat: Seat, cost: int) -> int:
        """Return how long a transition takes [ns] that would take `cost`, were the component not slowed down."""
        factor = self._slow.get(seat.name)
        return cost if factor is None else round(factor * max(cost, self._plan.work_ns))

    def kill(self, seat: Seat, why: str) -> None:
        """Let a component die: it takes up nothing any more, and what waits for it is lost."""
        self._floor.write("note", seat, text=f"fault: {seat.name} dies, {why}")
        self.deaths.append(Death(self._clock.now(), seat.name, why))
        waiting = list(seat.inbox)
        seat.clear()
        seat.dead = True
        for message in waiting:
            self._floor.discard(seat, message, f"fault: {seat.name} has died")

    def _corrupt(self, message: Message, fate: Fate) -> tuple[str, bool]:
        """Change the content of a message; say how, and whether the receiver can read it still."""
        assert self._codec is not None
        assert fate.corrupt is not None
        try:
            values = self._codec.flatten(message.channel, message.payload)
        except Exception as error:
            rule = f"a message must have a flat form, but: {type(error).__name__}: {error}"
            raise HostFailure(f"channel {message.channel!r}", rule, "corrupt another", slug="fault-codec") from error
        changed, said = corrupted(values, fate.corrupt, fate.how)
        try:
            message.payload = self._codec.restore(message.channel, changed)
        except Exception as error:
            return f"{said}: refused by its receiver, {type(error).__name__}: {error}", False
        return said, True

    def _strike(self, seat: Seat, fault: ComponentFault) -> None:
        if seat.dead:
            return
        self.strikes += 1
        if fault.kind == "crash":
            self.kill(seat, "crash")
            return
        lasts = "" if fault.for_ns is None else f" for {time_text(fault.for_ns)}"
        if fault.kind == "slow_down":
            self._slow[seat.name] = fault.factor
            self._floor.write("note", seat, text=f"fault: {seat.name} is slowed down {fault.factor:g} x{lasts}")
            return
        self._floor.write("note", seat, text=f"fault: {seat.name} is frozen{lasts}")
        seat.frozen = True
        seat.turn += 1  # the end of the transition in progress, if there is one, is put off
        seat.left = seat.ends - self._clock.now()

    def _relent(self, seat: Seat, fault: ComponentFault) -> None:
        if seat.dead:
            return
        self._floor.write("note", seat, text=f"fault: {seat.name} goes on as before")
        self._slow.pop(seat.name, None)
        if fault.kind == "freeze":
            seat.frozen = False
            if seat.step is not None:
                self._floor.ends(seat, self._clock.now() + max(seat.left, 0))
            else:
                self._floor.go_on(seat)
