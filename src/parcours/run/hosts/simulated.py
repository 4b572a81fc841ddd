"""Runs components in simulated time, deterministically, and records a trace.

At most one transition of a component is in progress at a time; while it is, or while the component waits for
room on a link, what arrives is queued. A transition is recorded, and its messages leave, when its execution
time is over.

Simultaneous events happen in a total order: 1. faults that strike components; 2. transitions that end, so that a
component due to be free is free; 3. messages that arrive, so that a message counts as in time at its very
deadline; 4. wakes. Among equals: components in the order given, the environment last, channels in the order of
the links; then in the order in which they were caused.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from typing import cast

from parcours.errors import HostFailure
from parcours.run.clocks import SimulatedClock
from parcours.run.faults import FaultPlan, FlatCodec
from parcours.run.hosts.component_faults import Death, Striker
from parcours.run.hosts.slots import Answer, Answering, Queue, Slot, injection_time, silence
from parcours.run.hosts.traffic import ARRIVE, END, STRIKE, WAKE, Traffic
from parcours.run.noise import Noise
from parcours.run.port import ENVIRONMENT, Component, Link, Step, reported
from parcours.run.trace import Trace

# The queue of events: a heap of (time, what, who, which), so that equal times have an order that no dict decides.
#
#   time  what     who                          who: place of component or link; which: order of being caused
#   2000  STRIKE   Planner  crash
#   2000  END      Control  take c7, its messages leave ──► ARRIVE at 2000 + delay
#   2000  ARRIVE   obstacles #12
#   2000  WAKE     Sensing
#   2500  END      ...
#
# A transition that costs no time and is what happens next anyway is ended at once: most never enter the heap.


class SimulatedHost(Traffic):
    """A discrete-event host. The same arguments give the same trace, on every machine.

    Args:
        components: the system under test; the environment plays those that are absent.
        links: the channels between them, e.g. `links(cefsm)`.
        environment: the tester, which receives what is sent to it and injects: a function
            (channel, payload, time [ns]) -> sends, or a component called "environment".
        execution: (component, transition) -> how long it works on that [ns].
        transport: channel -> how long a message that leaves now is on its way [ns]; none overtakes another.
        recording: whether what happens is written into the trace; without it the trace stays empty.
        faults: what goes wrong; under a plan, a component that raises has died and all others go on.
        codec: the flat form of the messages, for faults that corrupt them.

    Raises:
        HostFailure: two components share a name.
        BadRequest: a fault names what is not there, or corrupts without a codec.
    """

    label = "simulated"

    def __init__(
        self,
        components: Sequence[Component],
        links: Sequence[Link],
        *,
        environment: Component | Answer = silence,
        execution: Callable[[str, str], int] | None = None,
        transport: Callable[[str], int] | None = None,
        recording: bool = True,
        faults: FaultPlan | None = None,
        codec: FlatCodec | None = None,
    ) -> None:
        tester = Answering(environment) if not hasattr(environment, "next_wake") else cast(Component, environment)
        self._clock = SimulatedClock()
        self._slots = {part.name: Slot(part, k) for k, part in enumerate((*components, tester))}
        self._environment = self._slots[tester.name]
        self._links = {link.channel: link for link in links}
        self._queues = {link.channel: Queue(link, k) for k, link in enumerate(links)}
        self._execution, self._transport = execution, transport
        self._open = True
        self._recording = recording
        if tester.name != ENVIRONMENT or len(self._slots) != len(components) + 1:
            names = ", ".join(part.name for part in (*components, tester))
            rule = f"component names differ, and the tester's is {ENVIRONMENT!r}, but given were: {names}"
            raise HostFailure(f"{self.label} host", rule, slug="host-names")
        self._striker = Striker(faults, codec, self._slots, self._queues, self._clock, self) if faults else None
        self._clear()

    def _clear(self) -> None:
        super()._clear()
        if self._striker is not None:
            self._striker.begin()

    def reset(self) -> None:
        """Return everything to where it began: no message, no event."""
        self._must_be_open()
        self._clear()
        for slot in self._slots.values():
            slot.component.reset()
            slot.clear()
        for queue in self._queues.values():
            queue.clear()
        self._clock.restart()

    def close(self) -> None:
        """Let go of the components. Closing again does nothing; the trace stays readable."""
        self._open = False
        self._heap.clear()
        for slot in self._slots.values():
            slot.clear()

    def trace(self, case: str = "", noise: Noise | None = None) -> Trace:
        """Return what has happened since the beginning or the last reset; payloads included."""
        return Trace(self._clock.name, tuple(self._events), self.label, case, noise)

    def note(self, text: str) -> None:
        """Write a remark of the tester's into the trace."""
        self._record("note", text=text)

    @property
    def deaths(self) -> tuple[Death, ...]:
        """The components that have died since the beginning or the last reset; without faults none ever does."""
        return tuple(self._striker.deaths) if self._striker is not None else ()

    @property
    def strikes(self) -> int:
        """How many messages and components a fault has struck so far."""
        return self._striker.strikes if self._striker is not None else 0

    def acted(self, component: str) -> int:
        """Return when a component of this host last ended a transition or action [ns]; 0 if never, or if it is dead."""
        return self._slots[component].acted

    def inject(self, channel: str, message: object, at: int | None = None) -> None:
        """Send `message` in the place of the environment, or of a component that is not on this host.

        Raises BadRequest if the channel is unknown, belongs to a component of this host, or the time is past.
        """
        self._must_be_open()
        due = injection_time(channel, self._links, self._slots, at, self._clock.now())
        queue = self._queues[channel]
        self._push(due, ARRIVE, queue.index, lambda: self._send(None, queue, message))

    def run(self, until: int) -> None:
        """Run until the time `until` [ns], or until nothing is left that could happen.

        Raises HostFailure if a component raised, sent on a channel that is not its own, or never comes to rest.
        """
        self._must_be_open()
        for slot in self._slots.values():
            self._push(self._clock.now(), WAKE, slot.index, lambda slot=slot: self._work(slot, rung=True))  # type: ignore[misc]
        while self._heap and self._heap[0][0] <= until:
            due, _, _, _, act = heapq.heappop(self._heap)
            self._watch(self._clock.advance(due))
            act()
        if self._heap:
            self._clock.advance(until)
            return
        stuck = [
            f"{slot.name} waits to send on {slot.waits}"
            for slot in self._slots.values()
            if slot.waits and not slot.dead
        ]
        if stuck:
            self.note("deadlock: " + ", ".join(stuck))
        self._clock.advance(until)

    def _must_be_open(self) -> None:
        if not self._open:
            raise HostFailure(f"{self.label} host", "is closed", "make a new one", slug="host-closed")

    def _work(self, slot: Slot, *, rung: bool = False) -> None:
        """Let a component go on until it waits for time, for room, or for something to do.

        A wake that is due at this very instant begins only when its own event `rung`: messages come first.
        """
        if slot.is_out:
            return
        fruitless = 0
        self._acting = slot.name
        while slot.step is None and not slot.waits and not slot.outbox:
            if slot.work is None and not self._take_up(slot, rung):
                return
            rung = False
            assert slot.work is not None
            try:
                slot.step = next(slot.work, None)
                cost = self._cost(slot, slot.step)
            except HostFailure:
                raise
            except Exception as error:
                self._broke(slot, error)
                return
            if slot.step is None:
                slot.work = None
                fruitless += 1
                self._count(fruitless, slot.name)
            elif cost == 0 and self._is_next(slot):
                self._watch(self._clock.now())
                self._finish(slot)
            else:
                self.ends(slot, self._clock.now() + cost)

    def _take_up(self, slot: Slot, rung: bool) -> bool:
        """Give an idle component the message or wake that has been due longest; say whether there was one."""
        now = self._clock.now()
        try:
            wake = slot.component.next_wake()
        except Exception as error:
            self._broke(slot, error)
            return False
        first = slot.first()
        is_due = wake is not None and (wake < now or (rung and wake == now))
        if is_due and (first is None or cast(int, wake) < first.arrived):
            return self._begin(slot, slot.component.wake, now)
        if first is not None:
            slot.forget(first)
            self._record("receive", slot, first)
            self._make_room(first)
            return self._begin(slot, slot.component.handle, first.channel, first.payload, now)
        if wake is not None and wake != slot.wake:
            slot.wake = wake
            self._push(wake, WAKE, slot.index, lambda: self._ring(slot, wake))
        return False

    def _begin(self, slot: Slot, act: Callable[..., Iterator[Step]], *arguments: object) -> bool:
        try:
            slot.work = iter(act(*arguments))
        except Exception as error:
            self._broke(slot, error)
            return False
        return True

    def _ring(self, slot: Slot, wake: int) -> None:
        if slot.wake == wake:
            slot.wake = None
            self._work(slot, rung=True)

    def _cost(self, slot: Slot, step: Step | None) -> int:
        if step is None or (slot is self._environment and not step.transition):
            return 0
        for _channel, _payload in step.sends:
            pass  # an object that is not a step is found here, while its component can be blamed
        cost = 0
        if self._execution is not None:
            cost = self._execution(slot.name, step.transition)
        return cost if self._striker is None else self._striker.cost(slot, cost)

    def _is_next(self, slot: Slot) -> bool:
        """Whether a transition of the component's that ends now is what happens next anyway."""
        return not self._heap or self._heap[0][:3] > (self._clock.now(), END, slot.index)

    def _end(self, slot: Slot, turn: int) -> None:
        if slot.turn == turn:
            self._finish(slot)
            self._work(slot)

    def _finish(self, slot: Slot) -> None:
        """Record the transition in progress, and let its messages leave."""
        step, slot.step = slot.step, None
        assert step is not None
        slot.acted = self._clock.now()
        if step.transition:
            self._record("take", slot, transition=step.transition, payload=reported(step))
        if step.sends:
            slot.outbox.extend(step.sends)
            self._drain(slot)

    # What its faults need, see `Striker`.

    def strike(self, time: int, slot: Slot, act: Callable[[], None]) -> None:
        """Let `act` happen to the slot at `time` [ns], before all else that happens then."""
        self._push(time, STRIKE, slot.index, act)

    def ends(self, slot: Slot, time: int) -> None:
        """Let the transition in progress end at `time` [ns]."""
        slot.turn, slot.ends = slot.turn + 1, time
        self._push(time, END, slot.index, lambda turn=slot.turn: self._end(slot, turn))  # type: ignore[misc]

    def go_on(self, slot: Slot) -> None:
        """Send what waits to be sent, and go on working; a wake that was due meanwhile comes first."""
        self._drain(slot)
        self._work(slot, rung=True)

    def _broke(self, slot: Slot, error: Exception) -> None:
        """Blame a component that raised; under a plan of faults it has died of it, as a process would."""
        if self._striker is not None and slot is not self._environment:
            self._striker.kill(slot, f"{type(error).__name__}: {error}")
            return
        rule = f"must keep to the port's contract, but raised {type(error).__name__}: {error}"
        after = next((e.transition for e in reversed(self._events) if e.transition and e.component == slot.name), "")
        remedy = f"it happened at {self._clock.now()} ns" + (f", after {after}" if after else ", before any transition")
        raise HostFailure(f"component {slot.name!r}", rule, remedy, slug="component-raised") from error
