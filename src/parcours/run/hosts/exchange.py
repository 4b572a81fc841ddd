"""Components, links and a clock -> a trace: the one set of rules by which every host in this process runs.

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
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import cast

import numpy as np

from parcours.errors import BadRequest, HostFailure, one_of
from parcours.run.clocks import Clock
from parcours.run.faults import FaultPlan, FlatCodec
from parcours.run.hosts.passage import Execution, Passage, Streams, at_once
from parcours.run.hosts.seats import Answer, Answering, Lane, Seat, silence
from parcours.run.hosts.striking import Death, Striker
from parcours.run.hosts.traffic import ARRIVE, END, STRIKE, WAKE, Traffic, not_negative
from parcours.run.noise import Noise
from parcours.run.port import ENVIRONMENT, Component, Link, Step
from parcours.run.trace import Trace


class Exchange(Traffic):
    """Runs components on a clock. See `SimulatedHost` and `WallClockHost` for the arguments."""

    label = "exchange"

    def __init__(
        self,
        components: Sequence[Component],
        links: Sequence[Link],
        clock: Clock,
        *,
        environment: Component | Answer = silence,
        passages: Mapping[str, Passage] | None = None,
        execution: Execution = at_once,
        rng: np.random.Generator | None = None,
        recording: bool = True,
        faults: FaultPlan | None = None,
        codec: FlatCodec | None = None,
    ) -> None:
        tester = Answering(environment) if not hasattr(environment, "next_wake") else cast(Component, environment)
        self._clock = clock
        self._seats = {part.name: Seat(part, k) for k, part in enumerate((*components, tester))}
        self._environment = self._seats[tester.name]
        self._lanes = {link.channel: Lane(link, k) for k, link in enumerate(links)}
        self._passages = dict(passages or {})
        self._execution = execution
        self._streams = Streams(rng or np.random.default_rng(0))
        self._open = True
        self._recording = recording
        if tester.name != ENVIRONMENT or len(self._seats) != len(components) + 1:
            names = ", ".join(part.name for part in (*components, tester))
            rule = f"component names differ, and the tester's is {ENVIRONMENT!r}, but given were: {names}"
            raise HostFailure(f"{self.label} host", rule, slug="host-names")
        for channel in self._passages:
            if channel not in self._lanes:
                remedy = one_of(channel, list(self._lanes))
                raise HostFailure("passages", f"no link is called {channel!r}", remedy, slug="unknown-channel")
        self._striker: Striker | None = None
        if faults:
            self._striker = Striker(faults, codec, self._seats, self._lanes, clock, self)
        self._clear()

    def _clear(self) -> None:
        super()._clear()
        if self._striker is not None:
            self._striker.begin()

    def reset(self) -> None:
        """Return everything to where it began: no message, no event, random streams at their start."""
        self._must_be_open()
        self._clear()
        for seat in self._seats.values():
            seat.component.reset()
            seat.clear()
        for lane in self._lanes.values():
            lane.clear()
        self._streams.restart()
        self._clock.restart()

    def close(self) -> None:
        """Let go of the components. Closing again does nothing; the trace stays readable."""
        self._open = False
        self._heap.clear()
        for seat in self._seats.values():
            seat.clear()

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
        return self._seats[component].acted

    def inject(self, channel: str, message: object, at: int | None = None) -> None:
        """Send `message` in the place of the environment, or of a component that is not on this host.

        Args:
            channel: a link whose sender is not on this host.
            message: the payload.
            at: when [ns]; now if not given.

        Raises:
            BadRequest: the channel is unknown, belongs to a component of this host, or the time is past.
        """
        self._must_be_open()
        lane = self._lanes.get(channel)
        if lane is None:
            raise BadRequest("inject", f"no link is called {channel!r}", one_of(channel, list(self._lanes)),
                             slug="unknown-channel")  # fmt: skip
        if lane.link.sender != ENVIRONMENT and lane.link.sender in self._seats:
            rule = f"only the tester's channels can be injected, but {lane.link.sender} itself sends here"
            raise BadRequest(f"channel {channel!r}", rule, "leave the component out", slug="foreign-channel")
        now = self._clock.now()
        if at is not None and at < now:
            rule = f"time never runs backwards, but {at} ns was given at {now} ns"
            raise BadRequest(f"inject on {channel!r}", rule, "inject before the run", slug="time-backwards")
        self._push(now if at is None else at, ARRIVE, lane.index, lambda: self._send(None, lane, message))

    def run(self, until: int) -> None:
        """Run until the time `until` [ns], or until nothing is left that could happen.

        Raises:
            HostFailure: a component raised, sent on a channel that is not its own, or never comes to rest.
        """
        self._must_be_open()
        for seat in self._seats.values():
            self._push(self._clock.now(), WAKE, seat.index, lambda seat=seat: self._work(seat, rung=True))  # type: ignore[misc]
        while self._heap and self._heap[0][0] <= until:
            due, _, _, _, act = heapq.heappop(self._heap)
            self._watch(self._clock.advance(due))
            act()
        if self._heap:
            self._clock.advance(until)
            return
        stuck = [
            f"{seat.name} waits to send on {seat.waits}"
            for seat in self._seats.values()
            if seat.waits and not seat.dead
        ]
        if stuck:
            self.note("deadlock: " + ", ".join(stuck))
        self._clock.rest(until)

    def _must_be_open(self) -> None:
        if not self._open:
            raise HostFailure(f"{self.label} host", "is closed", "make a new one", slug="host-closed")

    def _work(self, seat: Seat, *, rung: bool = False) -> None:
        """Let a component go on until it waits for time, for room, or for something to do.

        A wake that is due at this very instant begins only when its own event `rung`: messages come first.
        """
        if seat.is_out:
            return
        fruitless = 0
        self._acting = seat.name
        while seat.step is None and not seat.waits and not seat.outbox:
            if seat.work is None and not self._take_up(seat, rung):
                return
            rung = False
            assert seat.work is not None
            try:
                seat.step = next(seat.work, None)
                cost = self._cost(seat, seat.step)
            except HostFailure:
                raise
            except Exception as error:
                self._broke(seat, error)
                return
            if seat.step is None:
                seat.work = None
                fruitless += 1
                self._count(fruitless, seat.name)
            elif cost == 0 and self._is_next(seat):
                self._watch(self._clock.now())
                self._finish(seat)
            else:
                self.ends(seat, self._clock.now() + cost)

    def _take_up(self, seat: Seat, rung: bool) -> bool:
        """Give an idle component the message or wake that has been due longest; say whether there was one."""
        now = self._clock.now()
        try:
            wake = seat.component.next_wake()
        except Exception as error:
            self._broke(seat, error)
            return False
        first = seat.inbox[0] if seat.inbox else None
        is_due = wake is not None and (wake < now or (rung and wake == now))
        if is_due and (first is None or cast(int, wake) < first.arrived):
            return self._begin(seat, seat.component.wake, now)
        if first is not None:
            seat.inbox.popleft()
            self._record("receive", seat, first)
            self._make_room(first)
            return self._begin(seat, seat.component.handle, first.channel, first.payload, now)
        if wake is not None and wake != seat.wake:
            seat.wake = wake
            self._push(wake, WAKE, seat.index, lambda: self._ring(seat, wake))
        return False

    def _begin(self, seat: Seat, act: Callable[..., Iterator[Step]], *arguments: object) -> bool:
        try:
            seat.work = iter(act(*arguments))
        except Exception as error:
            self._broke(seat, error)
            return False
        return True

    def _ring(self, seat: Seat, wake: int) -> None:
        if seat.wake == wake:
            seat.wake = None
            self._work(seat, rung=True)

    def _cost(self, seat: Seat, step: Step | None) -> int:
        if step is None or (seat is self._environment and not step.transition):
            return 0
        for _channel, _payload in step.sends:
            pass  # a step that is none is found here, while its component can be blamed
        cost = 0
        if self._execution is not at_once:
            drawn = self._execution(seat.name, step.transition, self._streams[f"component {seat.name}"])
            cost = not_negative(drawn, f"execution time of {step.transition}")
        return cost if self._striker is None else self._striker.cost(seat, cost)

    def _is_next(self, seat: Seat) -> bool:
        """Whether a transition of the component's that ends now is what happens next anyway."""
        return not self._heap or self._heap[0][:3] > (self._clock.now(), END, seat.index)

    def _end(self, seat: Seat, turn: int) -> None:
        if seat.turn == turn:
            self._finish(seat)
            self._work(seat)

    def _finish(self, seat: Seat) -> None:
        """Record the transition in progress, and let its messages leave."""
        step, seat.step = seat.step, None
        assert step is not None
        seat.acted = self._clock.now()
        if step.transition:
            self._record("take", seat, transition=step.transition)
        if step.sends:
            seat.outbox.extend(step.sends)
            self._drain(seat)

    # What its faults need (`striking.Floor`).

    def strike(self, time: int, seat: Seat, act: Callable[[], None]) -> None:
        """Let `act` happen to the seat at `time` [ns], before all else that happens then."""
        self._push(time, STRIKE, seat.index, act)

    def ends(self, seat: Seat, time: int) -> None:
        """Let the transition in progress end at `time` [ns]."""
        seat.turn, seat.ends = seat.turn + 1, time
        self._push(time, END, seat.index, lambda turn=seat.turn: self._end(seat, turn))  # type: ignore[misc]

    def go_on(self, seat: Seat) -> None:
        """Send what waits to be sent, and go on working; a wake that was due meanwhile comes first."""
        self._drain(seat)
        self._work(seat, rung=True)

    def _broke(self, seat: Seat, error: Exception) -> None:
        """Blame a component that raised; under a plan of faults it has died of it, as a process would."""
        if self._striker is not None and seat is not self._environment:
            self._striker.kill(seat, f"{type(error).__name__}: {error}")
            return
        rule = f"must keep to the port's contract, but raised {type(error).__name__}: {error}"
        after = next((e.transition for e in reversed(self._events) if e.transition and e.component == seat.name), "")
        remedy = f"it happened at {self._clock.now()} ns" + (f", after {after}" if after else ", before any transition")
        raise HostFailure(f"component {seat.name!r}", rule, remedy, slug="component-raised") from error
