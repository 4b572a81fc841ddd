"""Runs a foreign system once: its processes are started and connected, messages relayed, deaths noticed."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

from parcours.errors import HostFailure
from parcours.run.binding.domains import domains, within
from parcours.run.binding.in_transit import BEGINS, SCHEDULED, STALLED
from parcours.run.binding.relay import Relay
from parcours.run.binding.slots import ProcessSlot, SlotPlan
from parcours.run.faults import FaultPlan
from parcours.run.faults.effects import ProcessSignal, signals
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.process import KeptProcess
from parcours.run.hosts.foreign.readiness import Readiness
from parcours.run.hosts.realtime import DIED
from parcours.run.noise import Noise
from parcours.run.trace import Trace, TraceEvent

_CANARY = str(Path(__file__).with_name("wakeup_latency.py"))
_STEP = 5_000_000
"""How often to look whether nodes are ready [ns]."""

_SETTLED = 100_000_000
"""How long to wait, since a new connection may not yet be known at the other end [ns]."""

_BEAT, _STALL = 10_000_000, 20_000_000
"""How often to look whether the machine lets processes run, and the delay from which on that is noted [ns]."""

_PING = 0.3
"""How often to ask a node that was not started here whether it lives [s]."""


class Session:
    """One run of a system.

    Args:
        host: entered.
        slot_plan: the nodes that are run.
        faults: what happens to messages and components, from the start of the case.
        listener: called with each event soon after it has happened, within the same `poll`.

    Attributes:
        relay: where messages pass.
        deaths: component, as traces call it, -> how it ended.
        begin: when the run began [ns since the epoch].
        is_clock_held: whether /clock stands, so that a node has nothing to do but with what it was given.
        case_began: when the nodes were ready [ns since the run began]; -1 before.
    """

    def __init__(self, host: ForeignHost, slot_plan: SlotPlan, *, faults: FaultPlan | None = None,
                 listener: Callable[[TraceEvent], None] = lambda event: None) -> None:  # fmt: skip
        self.host, self.slot_plan = host, slot_plan
        self.zero, self.begin = time.perf_counter_ns(), time.time_ns()
        self.relay = Relay(host.binding, slot_plan, host, host.kind_of, self.now, faults, listener)
        self.deaths: dict[str, str] = {}
        self.case_began = -1
        self.drained = 0
        self.horizon = 0
        """All that happened by then [ns since the run began] is in the trace, stalls of the machine, too."""
        self._beat, self._beats = 0, b""
        self._canary: subprocess.Popen[bytes] | None = None
        self._line = -1
        self._faults = faults or FaultPlan(0)
        self._lost: dict[str, int] = {}
        self.is_clock_held = False
        self._over = threading.Event()
        self._pinging: threading.Thread | None = None
        components = [component for node in host.binding.nodes for component in node.components]
        self._faults.check([channel.name for channel in host.binding.channels], components)

    def now(self) -> int:
        """The time since the run began [ns]."""
        return time.perf_counter_ns() - self.zero

    # Beginning.

    def start(self) -> None:
        """Start the processes, and wait until all of them are ready.

        Raises:
            HostFailure: one cannot be started, dies, or does not become ready in its time; the message lists what is
                missing.
            BadRequest: the binding does not fit types that only now are known.
        """
        self.host.graph.spin(0)
        self.host.attach(self.slot_plan, self.relay.heard, self.relay.asked)
        self._listen_to_machine()
        if self.host.binding.clock:
            self._tick()
        self.readiness = Readiness(self.host, self.slot_plan, self.relay, self.now)
        self.host.stop([name for name, (_, process) in self.host.running.items() if not process.is_alive])
        while not self.readiness.looks() or self.readiness.startable():
            if fresh := self.readiness.startable():
                self.host.start(fresh)
                self.readiness.begin(fresh)
            self.poll(self.now() + _STEP)
            self._must_live()
        until = self.now() + _SETTLED
        while self.now() < until:
            self.poll(until)
        self._must_live()
        if domains(self.host.binding):
            self.readiness.looks()  # a bridge may have been found last
        if self.host.binding.clock:
            self._must_follow_clock()
        self.host.compile()
        self._watch_others()
        self.case_began = self.relay.case_began = self.now()
        self.relay.note(BEGINS)
        for slot, process in self._processes():
            for component in slot.node.components if slot.node.realtime else ():
                self.relay.note(SCHEDULED + process.rule, slot.component(component))
        for slot in self.slot_plan.slots:
            for component in slot.node.components:
                self._next_signal(slot, component, signals(self._faults, component))

    def _tick(self) -> None:
        """Say what time it is, and go on doing so."""
        if not self.is_clock_held:
            self.host.tell_time()
        self.relay.agenda.at(self.now() + round(self.host.binding.clock * 1e9), self._tick)

    def _listen_to_machine(self) -> None:
        self._line, other = os.pipe()
        os.set_blocking(self._line, False)
        words = [sys.executable, "-I", "-S", _CANARY, str(other), str(_BEAT)]
        try:
            self._canary = subprocess.Popen(words, pass_fds=(other,), start_new_session=True, stdin=subprocess.DEVNULL,
                                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        finally:
            os.close(other)
        self.host.graph.watch(self._line, self._hear_beats)

    def _hear_beats(self) -> None:
        *lines, self._beats = (self._beats + os.read(self._line, 65_536)).split(b"\n")
        for line in lines:
            when, late = (int(word) for word in line.split())
            self._beat = when - self.zero
            if late > _STALL:
                self.relay.note(f"{STALLED}{late}", time=max(self._beat - late, 0))

    def _must_live(self) -> None:
        for slot, process in self._processes():
            if not process.is_alive:
                rule = f"must live until the case begins, but: {process.how()}"
                raise HostFailure(f"node {slot.name}", rule, slug="foreign-start")

    def _must_follow_clock(self) -> None:
        """Nodes that are not started here were not given `use_sim_time`."""
        for slot in (one for one in self.slot_plan.slots if not one.node.is_ours and one.ros_node):
            if self.host.graph.parameter(within(f"{slot.ros_node}/use_sim_time", slot.node.domain)) is False:
                rule = f"{slot.graph_name} must take its time from /clock, but its use_sim_time is false"
                remedy = "start it with --ros-args -p use_sim_time:=true"
                raise HostFailure(f"node {slot.name}", rule, remedy, slug="ros2-sim-time")

    # Going on.

    def poll(self, until: int) -> None:
        """Relay what comes until the time [ns since the run began], or until something has come."""
        self.relay.agenda.do_what_is_due()
        if self.host.has_waiting_calls:
            self.host.ask_again()
            until = min(until, self.now() + _STEP)
        due = self.relay.agenda.next_due
        looked = self.now()
        if not self.host.graph.spin(0):
            self.drained = looked
            self.host.graph.spin(self.zero + (until if due is None else min(until, due)))
        self.horizon = min(self.drained, self._beat)
        self.relay.agenda.do_what_is_due()
        self.relay.report()
        self._see_deaths()

    def _processes(self) -> Iterator[tuple[ProcessSlot, KeptProcess]]:
        for slot in self.slot_plan.slots:
            if slot.name in self.host.running:
                yield slot, self.host.running[slot.name][1]

    def _see_deaths(self) -> None:
        if self.case_began < 0:
            return
        for slot, process in self._processes():
            if not process.is_alive:
                self._bury(slot, process.how(self.zero + self.case_began), process.ended - self.zero)
        for name, when in list(self._lost.items()):
            slot = cast(ProcessSlot, self.slot_plan.slot(name))
            since = f" since {max(when - self.case_began, 0) * 1e-9:.3f} s"
            self._bury(slot, f"{slot.graph_name} does not answer any more{since}", when)

    def _bury(self, slot: ProcessSlot, how: str, when: int) -> None:
        launched = self.host.binding.launched_by(slot.node)
        for one in self.slot_plan.slots if launched else ():
            if one.node in launched:
                self._bury(one, f"{slot.name}, which started it, ended: {how}", when)
        for component in slot.node.components or (() if launched else (slot.node.name,)):
            name = slot.component(component)
            if name not in self.deaths:
                self.deaths[name] = how
                self.relay.note(DIED + how, name, max(when, 0))

    def _watch_others(self) -> None:
        others = [slot for slot in self.slot_plan.slots if not slot.node.is_ours]
        if not others:
            return

        def ping() -> None:
            silent: dict[str, int] = {}
            while not self._over.wait(_PING):
                for slot in others:
                    if self.host.graph.answers(slot.graph_name):
                        silent.pop(slot.name, None)
                    elif slot.name in silent:
                        self._lost.setdefault(slot.name, silent[slot.name])
                    else:
                        silent[slot.name] = self.now()

        self._pinging = threading.Thread(target=ping, daemon=True, name="foreign-ping")
        self._pinging.start()

    def hold(self, slot: ProcessSlot) -> bool:
        """Stop a slot's process, and return whether all of it stands."""
        self.act(slot, "stop")
        return slot.name in self.host.running and self.host.running[slot.name][1].await_stop()

    def effort(self, slot: ProcessSlot) -> int:
        """Return the processor time of a slot's process [ns], negative if the tester has not started it."""
        return self.host.running[slot.name][1].effort() if slot.name in self.host.running else -1

    def rests(self, slot: ProcessSlot, since: int) -> bool:
        """Return whether a slot's process has worked since that `effort`, and waits now; also if it has ended."""
        process = self.host.running[slot.name][1]
        return process.rests(since) or not process.is_alive

    def act(self, slot: ProcessSlot, what: str) -> None:
        """Stop, continue or kill a slot's process, if the tester has started it."""
        if slot.name in self.host.running:
            self.host.running[slot.name][1].act(what)  # type: ignore[arg-type]

    def _next_signal(self, slot: ProcessSlot, component: str, coming: Iterator[ProcessSignal]) -> None:
        one = next(coming, None)
        if one is not None:
            self.relay.agenda.at(self.case_began + one.time, lambda: self._strike(slot, component, one, coming))

    def _strike(self, slot: ProcessSlot, component: str, one: ProcessSignal, coming: Iterator[ProcessSignal]) -> None:
        name = slot.component(component)
        if name not in self.deaths:
            self.act(slot, one.act)
            self.relay.note(f"fault: {one.act}", name)
        self._next_signal(slot, component, coming)

    # Ending.

    def end(self, *, keep: bool = False) -> None:
        """Relay no more, and end the processes; with `keep`, not those that may be used again."""
        self._over.set()
        self.relay.report()
        self.relay.close()
        if self._canary is not None:
            self.host.graph.unwatch(self._line)
            self._canary.kill()
            self._canary.wait()
            os.close(self._line)
            self._canary = None
        self.host.detach()
        stay = {
            slot.name for slot, process in self._processes()
            if keep and process.is_alive and slot.reference is None and slot.node.restart == "when-dead"
        }  # fmt: skip
        for name in stay:
            self.host.running[name][1].act("continue")
        is_apart = any(slot.reference is not None for slot in self.slot_plan.slots)
        going = [slot.name for slot in self.slot_plan.slots if slot.name not in stay]
        self.host.stop(going, self.host.graph.ending if is_apart or self.case_began < 0 else float("inf"))
        if self._pinging is not None:
            self._pinging.join()

    def trace(self, case: str, noise: Noise | None = None) -> Trace:
        """Return what has happened, payloads as raw messages."""
        events = sorted(self.relay.events, key=lambda event: event.time)
        return Trace("wall", tuple(events), f"{self.host.graph.label}, foreign", case, noise)
