"""One case of a study, executed on a mutant: what each judge says of it, and a print of all that was sent.

A mutant is chosen while its components work and at no other time: what the tester supplies, and the oracles, are those
of the original.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from parcours.abtc import Event
from parcours.errors import ParcoursError
from parcours.kernels import Spent, choose, places_run, refused_lines, rounds_left, suspended
from parcours.run.faults import corrupted
from parcours.run.heartbeat import write_place
from parcours.run.port import Component, Send, Step
from parcours.run.trace import Trace
from parcours.study.components import executing
from parcours.study.components.isolation import watched
from parcours.study.mutation.twin import difference_of, fact_of, print_of
from parcours.study.parameters import Settings
from parcours.study.protocol import Showing
from parcours.suite import Case
from parcours.verdict.conformance import check
from parcours.verdict.judgement import Judgement, Verdict

if TYPE_CHECKING:
    from parcours.model.structure import Cefsm
    from parcours.run.recording import PayloadCodec
    from parcours.study.campaign.study import CampaignStudy
    from parcours.study.components.faults import Strike
    from parcours.study.components.study import ComponentStudy
    from parcours.study.protocol import Study

CHECK, CASES, CONFORMANCE, TWIN = "model check", "component cases", "conformance", "golden twin"
ORACLES, MESSAGES = "campaign oracles", "system messages"
STAGES = (CHECK, CASES, CONFORMANCE, ORACLES, MESSAGES, TWIN)
_PLENTY = 2**62
_TRIES = 50  # changes of a message that are tried
_CAMPAIGN = 300  # cases of a campaign by default
_SHOWING = 100  # one case in this many is run again in the form that shows its messages
# A mutant that hangs counts as noticed, and on a busy machine a sound one looks like it. Loops are counted, so the
# clock is for what sleeps or never ends, and is this many times as patient as in a run.
PATIENCE = 6.0
_MARGIN, _FREE = 10, 100_000  # A mutant's loops may go round so much more often than the original's, and so often


@dataclasses.dataclass(frozen=True, slots=True)
class CaseObservation:
    """What became of one case."""

    noticed: Mapping[str, str]  # stage -> why it does not let the case pass; empty if it does
    print: bytes  # of all that was sent and taken, or of the facts
    rounds: int  # how often loops went round
    places: frozenset[int] = frozenset()  # of the functions that ran, among those that hold mutants
    ended: bool = True  # whether all loops ended within what they were allowed
    refused: tuple[tuple[str, int], ...] = ()  # what the compiler complains of, (file, line)


def allowed(original: CaseObservation) -> int:
    """Return how often the loops of a mutant may go round in a case."""
    return _MARGIN * original.rounds + _FREE


class MutationSubject(Protocol):
    """A study whose cases are executed on mutants."""

    @property
    def stages(self) -> tuple[str, ...]:
        """What judges its cases."""

    def cases(self, n: int | None) -> Iterator[Case]:
        """Yield the first n cases; as many as the study has if None."""

    def observe(self, case: Case, number: int = 0, rounds: int = _PLENTY, *, judged: bool = True) -> CaseObservation:
        """Execute a case on a mutant, by default on the original, and judge it."""

    def difference(self, case: Case, number: int, rounds: int) -> str:
        """Return what a mutant does otherwise first in a case: a channel and a field, a transition, a fact."""


def subject_of(study: Study, settings: Settings, seed: int) -> MutationSubject:
    """Return the study as mutants are run in it."""
    from parcours.study.campaign.study import CampaignStudy
    from parcours.study.components.study import ComponentStudy

    if isinstance(study, ComponentStudy):
        return Components(study, settings, seed)
    return (
        CampaignSubject(study, settings, seed) if isinstance(study, CampaignStudy) else AnyStudy(study, settings, seed)
    )


class Components:
    """A component study: its cases in simulated time, and the conformance of their traces."""

    stages: tuple[str, ...] = (CASES, CONFORMANCE)

    def __init__(self, study: ComponentStudy, settings: Settings, seed: int) -> None:
        self._study, self._settings, self._seed = study, settings, seed
        self._refused: list[tuple[str, int]] = []
        self._exercise = study.exercise(settings)
        self._struck: Struck | None = None
        aside = dataclasses.replace(
            self._exercise, tester=lambda case: _Aside(self._exercise.tester(case), self._struck)
        )
        checked = None if study.trusted else study.messages.checked
        self._execute = executing.in_process(aside, watch=self._watch, checked=checked)
        self._watched = watched(PATIENCE * study.patience)

    def cases(self, n: int | None) -> Iterator[Case]:
        """Yield the cases that do not contradict themselves."""
        return (case for case in self._study.suite(self._settings, self._seed, n)
                if not self._exercise.contradiction(case))  # fmt: skip

    def observe(self, case: Case, number: int = 0, rounds: int = _PLENTY, *, judged: bool = True) -> CaseObservation:
        """Execute a case in simulated time, in this process."""
        self._refused.clear()
        choose(number, rounds)
        try:
            trace = self._execute(case).trace
        except Spent as error:  # what a component shows, say, goes round and round
            return CaseObservation({CASES: str(error)}, b"", rounds, places_run(), ended=False)
        except Exception as error:  # the tester's own work
            if not refused_lines(error):
                raise
            return CaseObservation({CASES: str(error)}, b"", 0, refused=tuple(refused_lines(error)))
        finally:
            left, places = rounds_left(), places_run()
            choose(0)
        noticed = {}
        if judged:
            judgement = executing.judge_trace(self._exercise, case, trace)
            noticed = {CASES: _why(judgement), CONFORMANCE: conformance_of(self._study, trace)}
        print, refused = print_of(trace, self._study.recorded), tuple(self._refused)
        return CaseObservation(noticed, print, rounds - left, places, left >= 0, refused)

    def difference(self, case: Case, number: int, rounds: int) -> str:
        """Return the first event that differs, and in which field of its message."""
        original = self.trace(case)
        choose(number, rounds)
        try:
            mutant = self._execute(case).trace
        finally:
            choose(0)
        return difference_of(original, mutant, self._study.recorded, self._study.fields)

    def struck(self, case: Case, strike: Strike) -> CaseObservation | None:
        """Return what becomes of a case under a fault; None if it does not strike there."""
        self._struck = Struck(strike, self._study.recorded, self._seed)
        found = self.observe(case)
        is_struck, self._struck = self._struck.done, None
        return found if is_struck else None

    def trace(self, case: Case) -> Trace:
        """Return the trace of the original."""
        return self._execute(case).trace

    def judge_of(self, model: Cefsm) -> Callable[[Case, Trace], Mapping[str, str]]:
        """Return what judges traces by another model of the same system, as `CaseObservation.noticed` has it."""
        study = dataclasses.replace(self._study, model=model)
        study.__dict__["abstracts"] = self._study.abstracts  # the cases stay as they are
        exercise = dataclasses.replace(study.exercise(self._settings), contradiction=lambda case: "")

        def judge(case: Case, trace: Trace) -> Mapping[str, str]:
            try:
                said = _why(executing.judge_trace(exercise, case, trace))
            except ParcoursError as error:
                said = str(error)
            return {CASES: said, CONFORMANCE: conformance_of(study, trace)}

        return judge

    @contextlib.contextmanager
    def _watch(self, event: Event) -> Iterator[None]:
        with self._watched(event):
            try:
                yield
            except Exception as error:
                self._refused += refused_lines(error)
                raise


def conformance_of(study: ComponentStudy, trace: Trace) -> str:
    """Return why a trace does not conform to the study's model; empty if it does, or if that is open."""
    try:
        found = check(trace, study.model, fields=study.fields, allowance=study.allowance).judgement
    except ParcoursError as error:
        return str(error)
    return found.why if found.verdict is Verdict.FAIL else ""


def _why(judgement: Judgement) -> str:
    return "" if judgement.passed else f"{judgement.verdict}: {judgement.why}"


def strikes_of(study: ComponentStudy) -> Iterator[tuple[str, Strike]]:
    """Yield the faults that strike messages, with the ids of the mutants that they are."""
    from parcours.study.components.faults import catalogue

    return ((f"{one.channel}:{one.component}:1:{one.kind}", one) for one in catalogue(study) if one.channel)


class Struck:
    """The first message that a component takes up on a channel: lost, given to it twice, or with one field changed."""

    def __init__(self, strike: Strike, codec: PayloadCodec, seed: int) -> None:
        self._strike, self._codec, self._seed = strike, codec, seed
        self.done = False

    def put(self, component: Any) -> None:
        """Let the fault strike a component, if it is the one."""
        if component.name == self._strike.component:
            take_up = component.handle
            component.handle = lambda channel, message, now: self._handled(take_up, channel, message, now)

    def _handled(self, take_up: Any, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if self.done or channel != self._strike.channel:
            yield from take_up(channel, message, now)
            return
        self.done = True
        if self._strike.kind == "corrupt":
            message = self._corrupted(channel, message)
        for _ in range({"drop": 0, "duplicate": 2}.get(self._strike.kind, 1)):
            yield from take_up(channel, message, now)

    def _corrupted(self, channel: str, message: object) -> object:
        """Return the message with one field changed; as it is if that makes no such message however it is changed."""
        for seed in range(self._seed, self._seed + _TRIES):
            with contextlib.suppress(ParcoursError):
                values, _ = corrupted(self._codec.flatten(channel, message), seed)
                return self._codec.restore(channel, values)
        return message


class _Aside:
    """A tester whose own work is done by the original."""

    def __init__(self, tester: Any, struck: Struck | None) -> None:
        self._tester, self._struck = tester, struck

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tester, name)

    def component(self, name: str) -> Component:
        """Return a fresh component, struck by a fault if there is one."""
        made: Component = self._tester.component(name)
        if self._struck is not None:
            self._struck.put(made)
        return made

    def supply(self, event: Event) -> object:
        """Return the message for an event, made by the original."""
        with suspended():
            return self._tester.supply(event)

    def beside(self, event: Event) -> Sequence[Send]:
        """Return the messages beside an event's own, made by the original."""
        with suspended():
            found: Sequence[Send] = self._tester.beside(event)
            return found


class AnyStudy:
    """A study of any other kind, by its door: its verdicts and facts."""

    def __init__(self, study: Study, settings: Settings, seed: int) -> None:
        self._study, self._settings, self._seed = study, settings, seed
        self.stages: tuple[str, ...] = (ORACLES, MESSAGES) if isinstance(study, Showing) else (ORACLES,)

    def cases(self, n: int | None) -> Iterator[Case]:
        """Yield the first cases; by default a few hundred at most."""
        return islice(self._study.suite(self._settings, self._seed, n), n or _CAMPAIGN)

    def observe(self, case: Case, number: int = 0, rounds: int = _PLENTY, *, judged: bool = True) -> CaseObservation:
        """Execute a case and judge it by the study's own oracles; some show their messages, too."""
        write_place(case.id)
        choose(number, rounds)
        refused: list[tuple[str, int]] = []
        noticed = {}
        try:
            why, facts = self._judged(case)
            noticed[ORACLES] = why
            if judged and MESSAGES in self.stages and case.number % _SHOWING == 0:
                noticed[MESSAGES] = self._shown(case)
        except Exception as error:
            refused = refused_lines(error)
            why, facts = f"error: {type(error).__name__}: {error}", ()
            noticed[MESSAGES if noticed else ORACLES] = why
        left, places = rounds_left(), places_run()
        choose(0)
        digest = hashlib.sha256(repr((why, facts)).encode()).digest()[:16]
        return CaseObservation(noticed, digest, rounds - left, places, left >= 0, tuple(refused))

    def _shown(self, case: Case) -> str:
        assert isinstance(self._study, Showing)
        judged = self._study.show(case, self._settings)
        return _why(Judgement(judged.verdict, judged.why))

    def difference(self, case: Case, number: int, rounds: int) -> str:
        """Return the first fact that differs."""
        with suspended():
            before = self._judged(case)[1]
        choose(number, rounds)
        try:
            after = self._judged(case)[1]
        except Exception as error:
            return f"{type(error).__name__}: {error}"
        finally:
            choose(0)
        return fact_of(before, after)

    def _judged(self, case: Case) -> tuple[str, object]:
        judged = self._study.judge(case, self._settings)
        return _why(Judgement(judged.verdict, judged.why)), judged.facts


class CampaignSubject(AnyStudy):
    """A campaign of numbered cases, simulated in this process."""

    def __init__(self, study: CampaignStudy, settings: Settings, seed: int) -> None:
        super().__init__(study, settings, seed)
        self._campaign, self._simulation = study, study.simulation(settings, seed)

    def _judged(self, case: Case) -> tuple[str, object]:
        from parcours.study.campaign.rules import outcome_of

        [row] = self._simulation.run(np.array([case.number]))
        ruling = outcome_of(self._campaign, row, self._campaign.known(case.values, self._settings))
        return _why(Judgement(ruling.verdict, ruling.why)), row.tobytes()
