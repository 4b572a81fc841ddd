"""Runs cases one after the other on foreign nodes, and judges each at once."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from parcours.errors import HostFailure
from parcours.run.binding.in_transit import ENDS, RawMessage
from parcours.run.binding.slots import apart, whole
from parcours.run.faults import FaultPlan, read_plan
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.scheduling import real_time
from parcours.run.noise import NoiseMeter
from parcours.run.trace import TraceEvent
from parcours.study.components.results import sent_in
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.abstract import AbstractDrive
from parcours_navigation.foreign.cases import AbstractScene, find_scenes
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.judging import FAULTY, AbstractJudge, JudgedCase, SystemJudge, excused
from parcours_navigation.foreign.recorded import Tape, recording_place
from parcours_navigation.foreign.results import Result
from parcours_navigation.foreign.setup_steps import act
from parcours_navigation.foreign.tester_messages import Maker
from parcours_navigation.foreign.timing import Shares, SpanExercise, driven, is_exercised, spans, steps, timed
from parcours_navigation.foreign.world import CaseKey, ForeignWorld

_SWITCH = 0.0005
"""How long one thread of the tester goes on before another that waits may [s]."""

_ONCE = 200_000_000
"""How long after the first sensor messages those are sent that are sent once [ns]."""

_GIVES_UP = 5_000_000_000
"""How long beyond its duration a case is given up [ns]."""


_DRY = 5_000_000_000
"""How long a dry run lasts at most [ns]."""


class _Subscriber:
    """A session's listener: keeps what comes before anybody listens, and then passes all of it on."""

    def __init__(self) -> None:
        self._early: list[TraceEvent] = []
        self._listeners: list[Callable[[TraceEvent], None]] = []

    def __call__(self, event: TraceEvent) -> None:
        if not self._listeners:
            self._early.append(event)
        for listener in self._listeners:
            listener(event)

    def add(self, *listeners: Callable[[TraceEvent], None]) -> None:
        self._listeners.extend(listeners)
        for event in self._early:
            for listener in listeners:
                listener(event)
        self._early.clear()


class SystemDrive:
    """Lets the nodes of a session, whose listener is the judge, drive a simulated robot among obstacles."""

    def __init__(self, session: Session, judge: SystemJudge, maker: Maker, limit: int | None = None) -> None:
        system = session.host.binding.system
        assert system is not None
        self._session, self._judge, self._maker = session, judge, maker
        self._limit = round(system.duration * 1e9) + _GIVES_UP if limit is None else limit
        self._periods = {channel: round(period * 1e9) for channel, period in system.sense}
        self._next = dict.fromkeys(self._periods, 0)
        self._each = {channel: index for index, channel in enumerate(system.each)}
        self._once = list(system.once)
        session.relay.unserved = lambda message: maker.answer(session.relay, message)

    def run(self) -> None:
        """Run the case to its end. Raises HostFailure if a message of the tester cannot be made."""
        session, world = self._session, self._judge.world
        began = session.case_began
        # Time is real: the world catches up with the clock, senses what is due, and waits for commands till the next.
        while True:
            now = session.now() - began
            world.advance(now)
            if world.is_over or now > self._limit or self._judge.watch.unreadable:
                break
            self._sense(now)
            due = min([*self._next.values(), now + 50_000_000])
            session.poll(began + due)
            self._judge.watch.quiet(session.horizon)
        session.relay.note(ENDS)

    def _sense(self, now: int) -> None:
        coming = [channel for channel, due in self._next.items() if due <= now]
        for channel in coming:
            due = self._next[channel] + self._periods[channel]
            self._next[channel] = due if due > now else now + self._periods[channel]
        if self._once and now >= _ONCE:
            coming += self._once
            self._once = []
        if not coming:
            return
        values, items = self._judge.world.values(now, time.time()), self._judge.world.items()
        for channel in coming:
            index = self._each.get(channel)
            if index is None or index < len(items):
                seen = values if index is None else {**values, **items[index]}
                self._session.relay.inject(channel, self._maker.message(channel, seen, items))


class ForeignStudy:
    """Runs what is ordered.

    Args:
        host: entered.
        order: what to run.

    Raises:
        BadRequest: the plan of faults is wrong.
    """

    def __init__(self, host: ForeignHost, order: ProcessOrder) -> None:
        self._host, self._order = host, order
        self._faults = read_plan(order.faults) if order.faults else FaultPlan(0)
        self._spans = spans(host.binding)
        self._passive = {one.name: [tuple(row) for row in order.passive.get(one.name, ())] for one in self._spans}
        self._n_run = 0

    def run(self) -> Iterator[Result]:
        """Yield the results, each as soon as it is known: of abstract cases, of system cases, of limits.

        Raises:
            HostFailure: the nodes do not even start the first time.
            BadRequest: the binding does not fit what is running.
        """
        order = self._order
        scenes = find_scenes(self._host.binding, order.seed, order.abstract)
        for id in order.abstract:
            yield self._guarded(id, scenes[id])
        for number in order.system:
            yield self._guarded(f"system/{number}", CaseKey(order.seed, number, order.protocol))  # type: ignore[arg-type]
        if order.repeats and self._spans:
            yield from self._timing()

    def _guarded(self, id: str, scene: AbstractScene | CaseKey) -> Result:
        """Return the result of a case; what goes wrong with one after the first is its own error."""
        try:
            result = self._run(id, scene)
        except HostFailure as error:
            if self._n_run == 0 and error.slug != "foreign-instances":
                raise
            verdict = Verdict.INCONCLUSIVE if error.slug == "foreign-instances" else Verdict.ERROR
            kind = "system" if isinstance(scene, CaseKey) else "abstract"
            result = Result(id, kind, JudgedCase(Judgement(verdict, str(error))), 0.0, scene.id)
        self._n_run += 1
        return result

    def _run(self, id: str, scene: AbstractScene | CaseKey) -> Result:
        host, binding, is_system = self._host, self._host.binding, isinstance(scene, CaseKey)
        if isinstance(scene, CaseKey) and binding.system is not None:
            ForeignWorld(binding.system, scene).advance(100_000_000)  # compiled before anybody waits for it
        slot_plan = apart(binding, scene.references) if isinstance(scene, AbstractScene) else whole(binding)
        subscriber = _Subscriber()
        session = Session(host, slot_plan, faults=self._faults, listener=subscriber)
        early: list[RawMessage] = []  # requests that wait for an abstract case; of topics, what comes before is noted
        if not is_system:
            session.relay.arrived = lambda one: early.append(one) if one.call else session.relay.collect(one)
        try:
            session.start()
            act(session, "before_case")
            if self._faults:
                session.relay.note(FAULTY)
            compiled = host.compile()
            judged_slots = [slot for slot in slot_plan.slots if is_system or slot.reference is not None]
            names = [slot.component(component) for slot in judged_slots for component in slot.node.components]
            with _attentive():
                judge: SystemJudge | AbstractJudge
                drive: SystemDrive | AbstractDrive
                if isinstance(scene, CaseKey):
                    judge = SystemJudge(compiled, scene, names, live=True)
                    drive = SystemDrive(session, judge, Maker(compiled))
                else:
                    judge = AbstractJudge(compiled, scene.events, names, live=True)
                    drive = AbstractDrive(session, judge, Maker(compiled, dict(scene.inputs)), scene.events, early)
                tape = self._tape(session, scene, names)
                subscriber.add(judge.observe, *([tape.write] if tape else []))
                drive.run()
            act(session, "after_case")
        finally:
            session.end(keep=is_system)
        judged = judge.judged()
        if tape:
            tape.close(judged.judgement)
        passive = {span.name: driven(session.relay.events, span) for span in self._spans if is_system}
        for name, times in passive.items():
            self._passive[name] += times
        seconds = max(max((event.time for event in session.relay.events), default=0) - session.case_began, 0) * 1e-9
        recording = recording_place(scene.id, self._order.record) if tape else ""
        kind = "system" if is_system else "abstract"
        return Result(
            id, kind, judged, seconds, scene.id, recording, passive=passive, sent=sent_in(session.relay.events)
        )

    def _tape(self, session: Session, scene: AbstractScene | CaseKey, names: Sequence[str]) -> Tape | None:
        order = self._order
        if not order.record:
            return None
        about = {**order.about, "binding": self._host.binding.name, "seed": str(order.seed), "names": " ".join(names),
                 "faults": str(self._faults) if self._faults else ""}  # fmt: skip
        if isinstance(scene, CaseKey):
            about |= {"kind": "system", "number": str(scene.number), "protocol": scene.protocol}
        else:
            about |= {"kind": "abstract"}
        return Tape(
            Path(order.out) / recording_place(scene.id, order.record),
            scene.id,
            session.begin,
            about,
            f"{self._host.graph.label}, foreign",
        )

    def _timing(self) -> Iterator[Result]:
        """Yield the verdict on each limit: spans that the tester can begin are repeated as often as is wanted."""
        repeats, binding = self._order.repeats, self._host.binding
        took: dict[str, list[Shares]] = dict(self._passive)
        began = time.monotonic()
        subscriber = _Subscriber()
        session = Session(self._host, whole(binding), listener=subscriber)
        try:
            session.start()
            with NoiseMeter(trips=2, work=100_000) as meter, real_time():
                exercise = SpanExercise(session, Maker(self._host.compile()), meter)
                subscriber.add(exercise.listen)
                for span in self._spans:
                    # The tester can send what the span begins with.
                    if is_exercised(span, binding) and session.slot_plan.speaking(span.begin):
                        took[span.name] = exercise.run(span, repeats + binding.warm_up)
                    else:
                        meter.sample(repeats)
                noise = meter.noise()
                running = self._host.running.values()
                scheduling = {slot.name: process.rule for slot, process in running if slot.node.realtime}
        finally:
            session.end()
        for span in self._spans:
            names = steps(binding, span) if span.through else ()
            for one, chain in timed(span, took[span.name], binding.warm_up, noise, names):
                judgement = excused(one.judgement, scheduling)
                one = replace(one, judgement=judgement)
                id = f"timing/{span.name}/{one.bound}"
                judged = JudgedCase(judgement, scheduling=tuple(scheduling.items()))
                yield Result(id, "timing", judged, time.monotonic() - began, timing=one, chain=chain)


def dry_run(session: Session, listeners: list[Callable[[TraceEvent], None]]) -> None:
    """Let the nodes of a started session drive for a moment in an empty world.

    Args:
        session: of a binding that describes system tests.
        listeners: are called with its events.
    """
    act(session, "before_case")
    compiled = session.host.compile()
    with _attentive():
        judge = SystemJudge(compiled, CaseKey(1, 0, "empty"), [])
        for event in session.relay.events:
            judge.observe(event)
        listeners.append(judge.observe)
        SystemDrive(session, judge, Maker(compiled), _DRY).run()


@contextlib.contextmanager
def _attentive() -> Iterator[None]:
    """Put this thread and those it starts before ordinary processes, and let none of them wait long for another."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    try:
        with real_time():
            yield
    finally:
        sys.setswitchinterval(before)
