"""A binding and what is wanted -> cases run one after the other on the nodes of others, each judged at once."""

from __future__ import annotations

import contextlib
import itertools
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from parcours.abtc import require_cases
from parcours.errors import BadRequest, HostFailure
from parcours.run.binding.passing import Message
from parcours.run.binding.relay import Relay
from parcours.run.binding.slots import SlotPlan, apart, whole
from parcours.run.hosts.ros1.foreign import ForeignHost
from parcours.run.hosts.ros1.foreign_session import Session
from parcours.run.hosts.scheduling import real_time
from parcours.run.noise import NoiseMeter
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.abstract import AbstractDrive
from parcours_navigation.foreign.cases import AbstractScene, abstract_scenes, find_scene
from parcours_navigation.foreign.judging import FAULTY, AbstractJudge, Judged, SystemJudge
from parcours_navigation.foreign.recorded import Tape, recording_place
from parcours_navigation.foreign.results import Result, Wanted
from parcours_navigation.foreign.setup_steps import act
from parcours_navigation.foreign.system import SystemDrive
from parcours_navigation.foreign.tester_messages import Maker
from parcours_navigation.foreign.timing import Exercise, durations, spans, timed
from parcours_navigation.foreign.world import ForeignWorld, Scene

_SWITCH = 0.0005
"""So long one thread of the tester goes on before another that waits may [s]."""


class _Subscriber:
    """A session's listener: keeps what comes before anybody listens, and then tells all of it."""

    def __init__(self) -> None:
        self._early: list[TraceEvent] = []
        self._told: list[Callable[[TraceEvent], None]] = []

    def __call__(self, event: TraceEvent) -> None:
        if not self._told:
            self._early.append(event)
        for tell in self._told:
            tell(event)

    def tell(self, *those: Callable[[TraceEvent], None]) -> None:
        self._told.extend(those)
        for event in self._early:
            for tell in those:
                tell(event)
        self._early.clear()


class _Early:
    """What is done with messages that come before a case begins: topics are noted, requests wait for it."""

    def __init__(self, relay: Relay) -> None:
        self.calls: list[Message] = []
        self._relay = relay
        relay.arrived = self._arrived

    def _arrived(self, message: Message) -> None:
        if message.call is not None:
            self.calls.append(message)
        else:
            self._relay.collect(message)


class ForeignStudy:
    """Runs what is wanted.

    Args:
        host: entered.
        wanted: what to run.
        folder: for recordings.
        about: what recordings say besides.

    Attributes:
        passive: name of a span that `timing` bounds -> its durations in the system cases so far [ns].
    """

    def __init__(self, host: ForeignHost, wanted: Wanted, folder: Path, about: Mapping[str, str] | None = None) -> None:
        self._host, self._wanted, self._folder, self._about = host, wanted, folder, dict(about or {})
        self._spans = spans(host.binding)
        self.passive: dict[str, list[int]] = {span.name: [] for span in self._spans}
        self._n_run = 0
        if wanted.system and host.binding.system is None:
            rule = "system cases need a section 'system' in the binding, but it has none"
            raise BadRequest("--system", rule, "see docs/bindings.md", slug="foreign-system")

    def scenes(self) -> list[AbstractScene]:
        """Return the abstract cases that are wanted.

        Raises:
            BadRequest: there is none of the id.
            BadModel: the model has no abstract case, and nothing else is wanted.
        """
        binding, wanted = self._host.binding, self._wanted
        if wanted.case:
            return [find_scene(binding, wanted.seed, wanted.case)]
        if wanted.cases != 0 and not wanted.system and not wanted.repeats:
            require_cases(binding.model, binding.model.source)
        every = abstract_scenes(binding, wanted.seed)
        if wanted.cases is not None:
            return list(itertools.islice(every, wanted.cases))
        return list(itertools.takewhile(lambda scene: scene.id.endswith("/0"), every))

    def run(self) -> Iterator[Result]:
        """Yield the results, each as soon as it is known.

        Raises:
            HostFailure: the nodes do not even start the first time.
            BadRequest: the binding does not fit what is running.
        """
        for scene in self.scenes():
            yield self.abstract(scene)
        for number in range(self._wanted.system):
            yield self.system(number)
        yield from self.timing()

    def abstract(self, scene: AbstractScene) -> Result:
        """Run an abstract case. Raises as `run`, if it is the first case."""
        return self._guarded(scene.id, "abstract", lambda: self._abstract(scene))

    def system(self, number: int) -> Result:
        """Run a system case. Raises as `run`, if it is the first case."""
        scene = Scene(self._wanted.seed, number, self._wanted.protocol)  # type: ignore[arg-type]
        return self._guarded(scene.id, "system", lambda: self._system(scene))

    def _guarded(self, id: str, kind: str, run: Callable[[], Result]) -> Result:
        """Return the result of a case; what goes wrong with one after the first is its own error."""
        try:
            result = run()
        except HostFailure as error:
            if self._n_run == 0 and error.slug != "foreign-instances":
                raise
            verdict = Verdict.INCONCLUSIVE if error.slug == "foreign-instances" else Verdict.ERROR
            result = Result(id, kind, Judged(Judgement(verdict, str(error))), 0.0)
        self._n_run += 1
        return result

    def _abstract(self, scene: AbstractScene) -> Result:
        slot_plan = apart(self._host.binding, scene.references)
        subscriber = _Subscriber()
        session = Session(self._host, slot_plan, faults=self._wanted.faults, listener=subscriber)
        early = _Early(session.relay)
        try:
            self._begin(session)
            compiled = self._host.compile()
            names = _names(slot_plan)
            with _attentive():
                judge = AbstractJudge(compiled, scene.events, names, live=True)
                tape = self._tape(session, scene.id, {"kind": "abstract", "names": " ".join(names)})
                subscriber.tell(judge.observe, *([tape.write] if tape else []))
                maker = Maker(compiled, dict(scene.inputs))
                AbstractDrive(session, judge, maker, scene.events, early.calls).run()
            act(session, maker, "after_case")
        finally:
            session.end()
        return self._result(scene.id, "abstract", session, judge.judged(), tape)

    def _system(self, scene: Scene) -> Result:
        system = self._host.binding.system
        assert system is not None
        warm = ForeignWorld(system, scene)  # compiled before anybody waits for it
        warm.advance(100_000_000)
        warm.items(0)
        slot_plan = whole(self._host.binding)
        subscriber = _Subscriber()
        session = Session(self._host, slot_plan, faults=self._wanted.faults, listener=subscriber)
        try:
            self._begin(session)
            compiled = self._host.compile()
            names = _names(slot_plan)
            about = {
                "kind": "system",
                "names": " ".join(names),
                "number": str(scene.number),
                "protocol": scene.protocol,
            }
            with _attentive():
                judge = SystemJudge(compiled, scene, names, live=True)
                tape = self._tape(session, scene.id, about)
                subscriber.tell(judge.observe, *([tape.write] if tape else []))
                SystemDrive(session, judge, Maker(compiled)).run()
            act(session, Maker(compiled), "after_case")
        finally:
            session.end(keep=True)
        for span in self._spans:
            self.passive[span.name] += durations(session.relay.events, span)
        return self._result(scene.id, "system", session, judge.judged(), tape)

    def _begin(self, session: Session) -> None:
        session.start()
        act(session, Maker(self._host.compile()), "before_case")
        if self._wanted.faults:
            session.relay.note(FAULTY)

    def _tape(self, session: Session, id: str, about: dict[str, str]) -> Tape | None:
        if not self._wanted.record:
            return None
        path = self._folder / recording_place(id, self._wanted.record)
        told = {"binding": self._host.binding.name, "seed": str(self._wanted.seed),
                "faults": str(self._wanted.faults) if self._wanted.faults else ""}  # fmt: skip
        return Tape(path, id, session.begin, self._about | told | about)

    def _result(self, id: str, kind: str, session: Session, judged: Judged, tape: Tape | None) -> Result:
        recording = ""
        if tape is not None:
            tape.close(judged.judgement)
            recording = recording_place(id, self._wanted.record)
        ended = max((event.time for event in session.relay.events), default=0)
        return Result(id, kind, judged, max(ended - session.case_began, 0) * 1e-9, recording)

    # Timing.

    def timing(self) -> Iterator[Result]:
        """Yield the verdict on each limit: spans that the tester can begin are repeated as often as is wanted."""
        wanted, binding = self._wanted, self._host.binding
        if not self._spans or not wanted.repeats:
            return
        took = {name: list(times) for name, times in self.passive.items()}
        began = time.monotonic()
        subscriber = _Subscriber()
        session = Session(self._host, whole(binding), listener=subscriber)
        try:
            session.start()
            with NoiseMeter(trips=2, work=100_000) as meter, real_time():
                exercise = Exercise(session, Maker(self._host.compile()), meter)
                subscriber.tell(exercise.listen)
                for span in self._spans:
                    if exercise.can(span):
                        took[span.name] = exercise.run(span, wanted.repeats + binding.warm_up)
                    else:
                        meter.sample(wanted.repeats)
                noise = meter.noise()
        finally:
            session.end()
        for span in self._spans:
            for one in timed(span, took[span.name], binding.warm_up, noise):
                id = f"timing/{span.name}/{one.bound}"
                yield Result(id, "timing", Judged(one.judgement), time.monotonic() - began, timing=one)


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


def _names(slot_plan: SlotPlan) -> Sequence[str]:
    return [slot.component(component) for slot in slot_plan.slots for component in slot.node.components]
