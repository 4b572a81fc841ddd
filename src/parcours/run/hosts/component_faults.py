"""Applies a plan of faults to the simulated host: components crash, freeze and slow down, messages meet their effect.

Under a plan, a component that raises has died, as its process would have: what is sent to it is lost, all others go on.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from parcours.errors import BadRequest, HostFailure
from parcours.run.clocks import SimulatedClock
from parcours.run.faults import UNTOUCHED, ComponentFault, Effect, Effects, FaultPlan, FlatCodec, corrupted
from parcours.run.faults.plan import time_text
from parcours.run.hosts.slots import Message, Slot

if TYPE_CHECKING:
    from parcours.run.hosts.simulated import SimulatedHost


@dataclass(frozen=True, slots=True)
class Death:
    """A component that is gone: since when [ns], which, and why, e.g. `crash` or `IndexError: ...`."""

    time: int
    component: str
    why: str


class Striker:
    """Strikes the components and messages of one host by a plan.

    Raises BadRequest if the plan names what the host does not have, or corrupts without a codec.
    """

    def __init__(
        self, plan: FaultPlan, codec: FlatCodec | None, slots: Mapping[str, Slot], channels: Collection[str],
        clock: SimulatedClock, host: SimulatedHost,
    ) -> None:  # fmt: skip
        plan.check(tuple(channels), tuple(slots))
        if codec is None and any(fault.kind == "corrupt" for fault in plan.of_channels):
            rule = "to corrupt a message its flat form must be known, but no codec was given"
            raise BadRequest("faults", rule, "give the host the codec of the system's messages", slug="fault-codec")
        self._plan, self._codec, self._effects = plan, codec, Effects(plan)
        self._slots, self._clock, self._host = slots, clock, host
        self.deaths: list[Death] = []
        self.strikes = 0
        """How many messages and components have been struck."""

    def begin(self) -> None:
        """Start again: nothing has been struck, and all strikes of components are yet to come."""
        self.deaths.clear()
        self.strikes = 0
        self._count: dict[str, int] = {}
        self._slow: dict[str, float] = {}
        for fault in self._plan.of_components:
            slot = self._slots[fault.component]
            self._host.strike(fault.at_ns, slot, lambda slot=slot, fault=fault: self._strike(slot, fault))  # type: ignore[misc]
            if fault.until_ns is not None:
                self._host.strike(fault.until_ns, slot, lambda slot=slot, fault=fault: self._relent(slot, fault))  # type: ignore[misc]

    def meet(self, message: Message) -> Effect:
        """Return the effect of a message that is being sent; its content is changed if that is part of it."""
        channel = message.channel
        if not self._effects.concerns(channel):
            return UNTOUCHED
        k = self._count.get(channel, 0)
        self._count[channel] = k + 1
        effect = self._effects.effect(channel, k, self._clock.now())
        why = effect.why
        self.strikes += bool(why)
        if effect.corrupt is not None and effect.copies:
            said, arrives = self._corrupt(message, effect)
            why = why.replace("corrupted", f"corrupted, {said}")
            if not arrives:
                effect = Effect((), why=why)
        if not effect.copies:
            self._host.write("drop", message.sender, message, f"fault: {why}")
        elif why:
            self._host.write("note", message.sender, message, f"fault: {why}")
        return effect

    def cost(self, slot: Slot, cost: int) -> int:
        """Return how long a transition takes [ns] that would take `cost`, were the component not slowed down."""
        factor = self._slow.get(slot.name)
        return cost if factor is None else round(factor * max(cost, self._plan.work_ns))

    def kill(self, slot: Slot, why: str) -> None:
        """Let a component die: it takes up nothing any more, and what waits for it is lost."""
        self._host.write("note", slot, text=f"fault: {slot.name} dies, {why}")
        self.deaths.append(Death(self._clock.now(), slot.name, why))
        waiting = list(slot.inbox)
        slot.clear()
        slot.dead = True
        for message in waiting:
            self._host.discard(slot, message, f"fault: {slot.name} has died")

    def _corrupt(self, message: Message, effect: Effect) -> tuple[str, bool]:
        """Change the content of a message; say how, and whether the receiver can read it still."""
        assert self._codec is not None
        assert effect.corrupt is not None
        try:
            values = self._codec.flatten(message.channel, message.payload)
        except Exception as error:
            rule = f"a message must have a flat form, but: {type(error).__name__}: {error}"
            raise HostFailure(f"channel {message.channel!r}", rule, "corrupt another", slug="fault-codec") from error
        changed, said = corrupted(values, effect.corrupt, effect.how)
        try:
            message.payload = self._codec.restore(message.channel, changed)
        except Exception as error:
            return f"{said}: refused by its receiver, {type(error).__name__}: {error}", False
        return said, True

    def _strike(self, slot: Slot, fault: ComponentFault) -> None:
        if slot.dead:
            return
        self.strikes += 1
        if fault.kind == "crash":
            self.kill(slot, "crash")
            return
        lasts = "" if fault.for_ns is None else f" for {time_text(fault.for_ns)}"
        if fault.kind == "slow_down":
            self._slow[slot.name] = fault.factor
            self._host.write("note", slot, text=f"fault: {slot.name} is slowed down {fault.factor:g} x{lasts}")
            return
        self._host.write("note", slot, text=f"fault: {slot.name} is frozen{lasts}")
        slot.frozen = True
        slot.turn += 1  # the end of the transition in progress, if there is one, is put off
        slot.left = slot.ends - self._clock.now()

    def _relent(self, slot: Slot, fault: ComponentFault) -> None:
        if slot.dead:
            return
        self._host.write("note", slot, text=f"fault: {slot.name} goes on as before")
        self._slow.pop(slot.name, None)
        if fault.kind == "freeze":
            slot.frozen = False
            if slot.step is not None:
                self._host.ends(slot, self._clock.now() + max(slot.left, 0))
            else:
                self._host.go_on(slot)
