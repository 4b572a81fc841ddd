"""Runs a component in a process: it acts by its own timers, or takes the turns it is granted.

This is the same component that runs in simulated time; only its clock and its messages are real.
"""

from __future__ import annotations

import gc
import os
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import replace
from typing import cast

from parcours.errors import BadRequest
from parcours.run.clocks import WallClock
from parcours.run.hosts import frames
from parcours.run.hosts.frames import (
    Broke,
    Command,
    Deliver,
    Dropped,
    Grant,
    Idle,
    Look,
    OfferedTurn,
    Quit,
    Ready,
    Received,
    Report,
    Rest,
    RunFreely,
    Scalar,
    TransitionTaken,
    Turned,
    ViewShown,
    Wire,
)
from parcours.run.hosts.node_program import Line, Node, NodeProgram
from parcours.run.instance import Begin, Instance, TurnOutcome
from parcours.run.port import Component, LinkKind, Send, Step, StepReport, reported

_AT_ONCE = 1000
"""After this number of commands a component gets to work, even if more are there."""


def live(node: Node, node_program: NodeProgram, line: Line) -> None:
    """Serve the tester until it says Quit, or is no more."""
    gc.freeze()
    gc.disable()  # a collection in the middle of a turn would be taken for the component's own slowness
    _Life(node, node_program, line).serve()


class _Life:
    def __init__(self, node: Node, node_program: NodeProgram, line: Line) -> None:
        self._node, self._node_program, self._line = node, node_program, line
        self._capacity = {one.channel: one.capacity for one in node.links
                          if one.kind is LinkKind.TOPIC and one.receiver == node.component}  # fmt: skip
        self._channels = {one.channel for one in node.links}
        self._instances: dict[int, Instance] = {}
        self._pid = os.getpid()
        self._forget()

    def _forget(self) -> None:
        for part in self._instances.values():
            part.close()
        self._clock = WallClock()
        self._instances = {}
        self._unmade: Exception | None = None
        self._component: Component | None = None
        self._inbox: deque[Deliver] = deque()
        self._waiting: Counter[str] = Counter()
        self._delivered: dict[int, Wire] = {}
        self._is_idle = True
        self._n_taken = 0
        gc.collect()

    def serve(self) -> None:
        self._report(Ready())
        # Commands first, as far as they are there: a message that arrived while the component worked counts as there
        # before its timer; then one piece of work. A flood may not keep the component from its timers.
        while True:
            said = self._poll(self._due())
            if isinstance(said, Quit):
                return
            obeyed = 0
            while said is not None:
                if isinstance(said, Quit):
                    return
                self._obey(said)
                obeyed += 1
                said = self._poll(0) if self._component is not None and obeyed < _AT_ONCE else None
            self._live_on()

    # A child that a component forked comes back here with its parent's connection. It must not read what the tester
    # sends to the parent, nor answer in its place:
    #
    #     tester --- Grant ---> node --- fork ---> child      both now hold the same socket
    #            <-- Turned ---                    ends here
    def _report(self, said: Report) -> None:
        self._end_a_child()
        self._line.report(said)

    def _poll(self, until: int | None) -> Command | None:
        self._end_a_child()
        return self._line.poll(until)

    def _end_a_child(self) -> None:
        if os.getpid() != self._pid:
            os._exit(0)

    def _obey(self, said: Command) -> None:
        match said:
            case Deliver(number, message) if self._component is None:
                self._delivered[number] = message
            case Deliver():
                self._queue(said)
            case frames.Begin(case, references, zero):
                self._forget()
                self._clock = WallClock(zero)
                try:
                    self._instances = {one: Instance(self._node_program.instance(case)) for one in references}
                except Exception as error:
                    self._unmade = error
                self._report(Ready())
            case Grant(reference, turns):
                self._take(reference, turns)
            case Look(reference):
                self._report(ViewShown(reference, self._shown(reference)))
            case RunFreely(case, zero):
                self._forget()
                self._clock = WallClock(zero)
                self._is_idle = False
                try:
                    self._component = self._node_program.instance(case)
                except Exception as error:
                    self._break(error)
            case Rest():
                self._forget()
                self._report(Ready())

    def _shown(self, reference: int) -> Wire | None:
        """Return what an instance shows of itself; nothing of one that raises instead."""
        try:
            shown = self._node_program.view(self._instances[reference].component)
            return None if shown is None else self._wire(shown)
        except Exception:
            return None

    # Driven: turns are granted.

    def _take(self, reference: int, turns: tuple[OfferedTurn, ...]) -> None:
        for turn in turns:
            try:
                said = self._turned(reference, turn)
                self._report(said)
            except Exception as error:
                said = Turned(reference, "raised", self._clock.now(), text=f"{type(error).__name__}: {error}")
                self._report(said)
            if said.manner != "taken" or said.transition != turn.transition:
                return

    def _turned(self, reference: int, turn: OfferedTurn) -> Turned:
        """Take a turn; raises whatever the component's making, its messages or the messages to it raise."""
        if self._unmade is not None:
            raise self._unmade
        outcome = self._turn(self._instances[reference], turn)
        asides = tuple((time, self._wire(send)) for time, send in outcome.asides)
        sends = tuple(map(self._wire, outcome.sends))
        settled = tuple(
            (time, Wire(channel, cast(bytes, data)), tuple(map(self._wire, sent)))
            for time, (channel, data), sent in outcome.settled
        )
        return Turned(reference, outcome.manner, outcome.time, outcome.transition, sends, outcome.received, asides,
                      outcome.text, *_told(outcome.reported), settled)  # fmt: skip

    def _turn(self, instance: Instance, turn: OfferedTurn) -> TurnOutcome:
        component, clock = instance.component, self._clock
        settled = tuple(
            instance.settle(self._handing(component, one), (one.channel, one.data), clock) for one in turn.settle
        )
        settled = tuple(one for one in settled if one.message[0] in self._channels)
        if turn.awaits >= 0:
            hand = self._handing(component, self._delivered.pop(turn.awaits))
            outcome = instance.turn(turn.transition, clock, message=hand)
        elif turn.given is not None:
            outcome = instance.turn(turn.transition, clock, prompt=self._handing(component, turn.given))
        else:
            outcome = instance.turn(
                turn.transition, clock, prompt=lambda now: self._node_program.prompt(turn.prompt, component, now)
            )
        return replace(outcome, settled=settled) if settled else outcome

    def _handing(self, component: Component, message: Wire) -> Begin:
        payload = self._node_program.decode(message.channel, message.data)
        return lambda now: component.handle(message.channel, payload, now)

    def _wire(self, send: Send) -> Wire:
        channel, payload = send
        return Wire(channel, self._node_program.encode(channel, payload))

    # Free: the component lives by its own timers and what it is sent.

    def _queue(self, delivery: Deliver) -> None:
        """Queue a message; of a topic whose queue is full, the oldest is dropped."""
        channel = delivery.message.channel
        if self._capacity.get(channel, self._waiting[channel] + 1) <= self._waiting[channel]:
            oldest = next(one for one in self._inbox if one.message.channel == channel)
            self._inbox.remove(oldest)
            self._waiting[channel] -= 1
            self._n_taken += 1
            self._report(Dropped(oldest.number, self._clock.now()))
        self._inbox.append(delivery)
        self._waiting[channel] += 1
        self._is_idle = False

    def _due(self) -> int | None:
        """Return when there is something to do, by the monotonic clock [ns]; None if only the tester knows."""
        if self._component is None:
            return None
        if self._inbox or not self._is_idle:
            return 0
        wake = self._component.next_wake()
        return None if wake is None else wake + self._clock.zero

    def _live_on(self) -> None:
        """Do one thing: what is due by time, else the oldest message."""
        component = self._component
        if component is None:
            return
        try:
            wake, now = component.next_wake(), self._clock.now()
            if wake is not None and wake <= now:
                self._work(component.wake(now))
            elif self._inbox:
                self._take_up(component, self._inbox.popleft())
            elif wake is None and not self._is_idle:
                self._report(Idle(self._n_taken))
                self._is_idle = True
            else:
                self._is_idle = True
        except Exception as error:
            self._break(error)

    def _take_up(self, component: Component, delivery: Deliver) -> None:
        channel = delivery.message.channel
        self._waiting[channel] -= 1
        self._n_taken += 1
        self._is_idle = False
        try:
            payload = self._node_program.decode(channel, delivery.message.data)
        except BadRequest as error:
            self._report(Dropped(delivery.number, self._clock.now(), f"unreadable: {error}"))
            return
        now = self._clock.now()
        self._report(Received(delivery.number, now))
        self._work(component.handle(channel, payload, now))

    def _break(self, error: Exception) -> None:
        self._report(Broke(self._clock.now(), f"{type(error).__name__}: {error}"))
        self._component = None

    def _work(self, steps: Iterator[Step]) -> None:
        for step in steps:
            sends = tuple(map(self._wire, step.sends))
            if step.transition or sends:
                self._report(TransitionTaken(self._clock.now(), step.transition, sends, *_told(reported(step))))
        self._is_idle = False


def _told(said: StepReport | None) -> tuple[dict[str, Scalar] | None, tuple[str, ...] | None]:
    if said is None:
        return None, None
    return {name: value for name, value in said.variables.items() if isinstance(value, Scalar)}, said.operations
