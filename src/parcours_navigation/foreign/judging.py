"""Judges a case by its events, as they happen or from a recording: outcome, life, conformance, order.

Live and offline go through the same code, event by event, so a recording is judged to the same verdict.
"""

from __future__ import annotations

import heapq
import itertools
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from parcours.abtc import Event
from parcours.errors import HostFailure
from parcours.run.binding import Compiled
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.in_transit import BEGINS, ENDS, SCHEDULED
from parcours.run.binding.message_formulas import Reading
from parcours.run.enforcement import disorder
from parcours.run.hosts.realtime import DIED
from parcours.run.recording import Raw
from parcours.run.trace import Trace, TraceEvent, held
from parcours.verdict.conformance import TraceDeviation
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.conforming import Conformers
from parcours_navigation.foreign.world import CaseKey, ForeignWorld
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes

FAULTY = "under faults"
"""The note of a case under a plan of faults: the model does not know them, so it is followed, but not judged by."""

T = TypeVar("T")
_EVER = 1 << 62
_LATEST = 10.0
"""How long after the end of a case what was observed may still be followed [s]."""


@dataclass(frozen=True, slots=True)
class JudgedCase:
    """What became of a case.

    Attributes:
        judgement: of everything together.
        outcome: what the robot did, in words; empty for an abstract case.
        deaths: component -> how it ended.
        deviations: the first of each component that left the model.
        held: how long messages were kept in gates [ns], one each.
        scheduling: component that was to run in real time -> under which rule it ran.
    """

    judgement: Judgement
    outcome: str = ""
    deaths: tuple[tuple[str, str], ...] = ()
    deviations: tuple[TraceDeviation, ...] = ()
    held: tuple[int, ...] = ()
    scheduling: tuple[tuple[str, str], ...] = ()


def excused(judgement: Judgement, scheduling: Mapping[str, str]) -> Judgement:
    """Return a failure that time may have caused as inconclusive, if a node did not get the real time it was to have.

    >>> excused(Judgement(Verdict.FAIL, "too late"), {"Planner": "SCHED_OTHER"}).why
    'too late; but Planner was to run in real time, which is not allowed here: it ran under SCHED_OTHER [no-real-time]'
    """
    late = {name: rule for name, rule in scheduling.items() if not rule.startswith("SCHED_FIFO")}
    if judgement.verdict is not Verdict.FAIL or not late:
        return judgement
    rules = ", ".join(sorted(set(late.values())))
    why = f"{', '.join(late)} was to run in real time, which is not allowed here: it ran under {rules} [no-real-time]"
    return Judgement(Verdict.INCONCLUSIVE, f"{judgement.why}; but {why}")


class Beside(Generic[T]):
    """Does something with each item in a thread of its own, in order: the relay must not wait for a disk or a search.

    What `do` raises is raised by `close`.
    """

    def __init__(self, do: Callable[[T], None], name: str) -> None:
        self._do = do
        self._queue: queue.SimpleQueue[T | None] = queue.SimpleQueue()
        self._failed: list[BaseException] = []
        self._is_late = False
        self._thread = threading.Thread(target=self._work, daemon=True, name=name)
        self._thread.start()
        self.put = self._queue.put

    def _work(self) -> None:
        try:
            while (item := self._queue.get()) is not None and not self._is_late:
                self._do(item)
        except BaseException as error:
            self._failed.append(error)

    def close(self, patience: float | None = None) -> bool:
        """Return whether all is done within the patience [s]; the rest is left undone."""
        self._queue.put(None)
        self._thread.join(patience)
        self._is_late = self._thread.is_alive()
        if self._failed:
            raise self._failed.pop()
        return not self._is_late


class _Watch:
    """What every judge keeps: life, conformance, and messages that cannot be read."""

    def __init__(self, compiled: Compiled, names: Sequence[str], *, live: bool) -> None:
        self.decoder = Decoder(compiled.binding, compiled.types)
        self.conformers = Conformers(compiled, names, Decoder(compiled.binding, compiled.types))
        self._beside: Beside[TraceEvent | int] | None = Beside(self.conformers.take, "conformance") if live else None
        self._take = self._beside.put if self._beside else self.conformers.take
        self.deaths: dict[str, str] = {}
        self.scheduling: dict[str, str] = {}
        self.error: HostFailure | None = None
        self.began = -1
        self.ended = -1
        self.is_faulty = False
        self.is_unfinished = False
        self._is_lost = False
        self._later: list[tuple[int, int, TraceEvent]] = []
        self._order = itertools.count()

    def observe(self, event: TraceEvent) -> None:
        if event.kind == "note":
            if event.text == BEGINS:
                self.began = event.time
            elif event.text == ENDS:
                self.ended = event.time
            elif event.text.startswith(SCHEDULED):
                self.scheduling[event.component] = event.text.removeprefix(SCHEDULED)
            elif event.text.startswith(DIED):
                self.deaths.setdefault(event.component, event.text.removeprefix(DIED))
            self.is_faulty |= event.text == FAULTY
        if self.ended < 0 or event.time < self.ended:
            heapq.heappush(self._later, (event.time, next(self._order), event))

    def quiet(self, now: int) -> None:
        """Everything that happened by now [ns] is known: follow it, in order of time."""
        self._follow(now)
        if not self.deaths and self.ended < 0:
            self._take(now)

    def _follow(self, until: int) -> None:
        while self._later and self._later[0][0] <= until:
            event = heapq.heappop(self._later)[2]
            self._is_lost |= event.kind == "note" and event.text.startswith(DIED)
            if not self._is_lost:  # what a system without one of its parts does, no model says
                self._take(event)

    def close(self) -> None:
        self._follow(self.ended if self.ended >= 0 else _EVER)
        if self.ended >= 0 and not self._is_lost:
            self._take(self.ended)
        if self._beside:
            self.is_unfinished = not self._beside.close(_LATEST)

    @property
    def deviations(self) -> tuple[TraceDeviation, ...]:
        return () if self.is_faulty else self.conformers.deviations

    @property
    def unreadable(self) -> HostFailure | None:
        """The first message that could not be read."""
        return self.error or self.conformers.error

    def fair(self, judgement: Judgement) -> Judgement:
        """Return the verdict without what may be due to time alone; deaths and wrong messages are not."""
        is_wrong = any(not one.doubt and one.event is not None for one in self.deviations)
        return judgement if self.deaths or is_wrong else excused(judgement, self.scheduling)

    def first(self) -> Judgement | None:
        """Return the verdict on everything but what the case is about; None if nothing is wrong."""
        error = self.unreadable
        if error is not None:
            return Judgement(Verdict.ERROR, str(error))
        if self.deaths:
            died = ", ".join(f"{name} ({how})" for name, how in self.deaths.items())
            return Judgement(Verdict.FAIL, f"dead at the end: {died}")
        sure = [one for one in self.deviations if not one.doubt]
        if sure:
            return Judgement(Verdict.FAIL, f"does not conform: {sure[0]}")
        if self.deviations:
            return Judgement(Verdict.INCONCLUSIVE, f"may not conform: {self.deviations[0]}")
        if self.is_unfinished:
            why = "the model allows so much that its states could not be followed in time"
            return Judgement(Verdict.INCONCLUSIVE, why)
        return None


class SystemJudge:
    """Follows a system case.

    Args:
        compiled: the binding, with a section on system tests.
        scene: the case.
        names: of the components that are run.
        live: whether the case runs meanwhile.
    """

    def __init__(self, compiled: Compiled, scene: CaseKey, names: Sequence[str], *, live: bool = False) -> None:
        system = compiled.binding.system
        assert system is not None
        self._compiled, self._system = compiled, system
        self.world = ForeignWorld(system, scene)
        self.watch = _Watch(compiled, names, live=live)
        self._driven = -1
        self._facts: NDArray[np.void] | None = None

    def observe(self, event: TraceEvent) -> None:
        """Take note of the next event."""
        self.watch.observe(event)
        now = event.time - self.watch.began
        if self.watch.began < 0 or self._facts is not None:
            return
        if event.kind == "note" and event.text == ENDS:
            self.world.advance(now)
            self._facts = self.world.facts()
            return
        system, raw = self._system, event.payload
        if not isinstance(raw, Raw):
            return
        command, alarm = self._compiled.command, self._compiled.alarm
        if command and event.kind == "receive" and event.channel == system.command.on and event.message != self._driven:
            self._driven = event.message
            v, w = (self._read(event.channel, raw, reading) for reading in command)
            if isinstance(v, int | float) and isinstance(w, int | float):
                self.world.command(float(v), float(w), now)
        if alarm and system.alarm and event.kind == "send" and event.channel == system.alarm[0]:
            value = self._read(event.channel, raw, alarm)
            if value is not None:
                self.world.alarm(bool(value), now)

    def _read(self, channel: str, raw: Raw, reading: Reading) -> object:
        try:
            return reading.value({channel: self.watch.decoder.message(channel, raw.content)})
        except HostFailure as error:
            self.watch.error = self.watch.error or error
            return None

    def judged(self) -> JudgedCase:
        """Return the verdict; the case must have ended."""
        watch = self.watch
        watch.close()
        facts = self.world.facts() if self._facts is None else self._facts
        why, outcome = explain(facts[0]), Outcome(int(outcomes(facts)[0]))
        if self._facts is None:
            judgement = Judgement(Verdict.INCONCLUSIVE, f"the case was cut short; {why}")
        else:
            judgement = watch.fair(watch.first() or Judgement(VERDICT_OF[outcome], why))
        if why not in judgement.why:
            judgement = replace(judgement, why=f"{judgement.why}; {why}")
        name = outcome.name.lower().replace("_", " ")
        return JudgedCase(judgement, name, tuple(watch.deaths.items()), watch.deviations,
                      scheduling=tuple(watch.scheduling.items()))  # fmt: skip


class AbstractJudge:
    """Follows an abstract case.

    Args:
        compiled: the binding.
        events: `serialise(abstract_case)`; those whose component no node runs are the tester's own.
        names: of the components that are run, each with the number of its reference.
        live: whether the case runs meanwhile.
    """

    def __init__(self, compiled: Compiled, events: Sequence[Event], names: Sequence[str], *,
                 live: bool = False) -> None:  # fmt: skip
        self.watch = _Watch(compiled, names, live=live)
        self._events = events
        self._trace: list[TraceEvent] = []
        self._stopped = ""

    def observe(self, event: TraceEvent) -> None:
        """Take note of the next event."""
        self.watch.observe(event)
        # Without the payload, which may be large; `replace` would take longer than all else here.
        bare = TraceEvent(
            event.time, event.kind, event.component, event.transition, event.channel, event.message, event.text
        )
        self._trace.append(bare)
        if event.kind == "deviation":
            self._stopped = event.text

    def judged(self) -> JudgedCase:
        """Return the verdict."""
        watch = self.watch
        watch.close()
        trace = Trace("wall", tuple(sorted(self._trace, key=lambda event: event.time)))
        times = tuple(held(trace).values())
        judgement = watch.fair(watch.first() or self._order(trace, times))
        return JudgedCase(judgement, "", tuple(watch.deaths.items()), watch.deviations, times,
                      tuple(watch.scheduling.items()))  # fmt: skip

    def _order(self, trace: Trace, times: tuple[int, ...]) -> Judgement:
        if self._stopped:
            return Judgement(Verdict.INCONCLUSIVE, f"the order could not be enforced: {self._stopped}")
        taken = [event for event in trace.events if event.kind == "take"]
        if self.watch.ended < 0 or len(taken) != len(self._events):
            return Judgement(Verdict.INCONCLUSIVE, "the case was cut short")
        wrong = disorder(self._events, trace)
        if wrong:
            return Judgement(Verdict.INCONCLUSIVE, f"the order could not be enforced: {wrong}")
        unseen = [event.transition for event in taken if event.text]
        kept = f"; {len(times)} messages held, at most {max(times) * 1e-6:.1f} ms" if times else ""
        assumed = f"; not visible, so assumed: {' '.join(unseen)}" if unseen else ""
        return Judgement(Verdict.PASS, f"{len(taken)} transitions in their order{kept}{assumed}")
