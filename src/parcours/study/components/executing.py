"""Executes and judges cases of a component study, in this process or on the nodes of a transport, and times them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

from parcours.abtc import Event
from parcours.errors import ParcoursError
from parcours.run.clocks import Clock
from parcours.run.enforcement import PATIENCE, Execution, disorder, enforce, instance_name
from parcours.run.hosts.live_enforcement import DrivenInstances
from parcours.run.hosts.node_program import Codec, Transport
from parcours.run.in_process import View, execute
from parcours.run.noise import Noise, NoiseMeter
from parcours.run.trace import Trace, transitions
from parcours.study.components.references import Relation
from parcours.study.components.tester import Tester
from parcours.suite import Case
from parcours.verdict.contracts import Contracts, Tally, plain
from parcours.verdict.contracts import View as Fields
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, Bound, duration, judge

Execute = Callable[..., Execution]  # runs a case on some host; in this process also with a Relation's changed supply

Oracle = Callable[[Case, Trace], Judgement]  # judges a case whose order was kept and whose transitions were taken


@dataclass(frozen=True, slots=True)
class Exercise:
    """What executing a study's cases needs to know of it, its parameters being set."""

    events: Callable[[Case], Sequence[Event]]  # a case's events, serialised
    tester: Callable[[Case], Tester]  # the tester of a case
    oracle: Oracle  # judges a case whose order was kept and whose transitions were taken
    contradiction: Callable[[Case], str]  # why no choice of the tester's can make a case run; empty if one can
    view: View  # what an instance shows of itself at the end
    contracts: Contracts  # what the model says of data
    fields: Fields = plain  # reads the model's fields from a payload
    relations: Sequence[Relation] = ()  # between two runs of a case, in simulated time


def in_process(
    exercise: Exercise,
    clock: Callable[[], Clock] | None = None,
    watch: Callable[[Event], AbstractContextManager[None]] | None = None,
    checked: Callable[[str, object], object] | None = None,
) -> Execute:
    """Return what executes cases in this process."""

    def run(case: Case, relation: Relation | None = None) -> Execution:
        tester = exercise.tester(case)
        supply = tester.supply if relation is None else relation.supplied(tester.supply)
        return execute(
            exercise.events(case), tester.component, supply, prompt=tester.move, prepare=tester.prepare,
            beside=tester.beside, view=exercise.view, clock=clock() if clock else None, case=case.id,
            watch=watch or (lambda event: nullcontext()), checked=checked,
        )  # fmt: skip

    return run


def on_transport(
    exercise: Exercise, transport: Transport, codec: Codec, *, strict: bool = True, patience: int = PATIENCE
) -> Execute:
    """Return what executes cases on the nodes of a transport."""

    def run(case: Case) -> Execution:
        tester = exercise.tester(case)
        instances = DrivenInstances(transport, codec, tester)
        return enforce(exercise.events(case), instances, tester.supply, case=case.id, strict=strict, patience=patience)

    return run


@dataclass(frozen=True, slots=True)
class Functional:
    """One case executed, and what the oracle says of it."""

    case: Case
    execution: Execution
    judgement: Judgement
    judged: str = ""  # the checks of its data, see `Contracts.mask`


def run_functional(exercise: Exercise, case: Case, execute: Execute) -> Functional:
    """Execute one case in its serialised order and judge it; one that contradicts itself is not executed."""
    execution = execute(case) if not exercise.contradiction(case) else Execution(Trace("simulated", ()), None)
    judgement, tally = _judged(exercise, case, execution.trace)
    if judgement.passed and execution.trace.clock == "simulated":
        judgement = _related(exercise, case, execution.trace, execute) or judgement
    return Functional(case, execution, judgement, exercise.contracts.mask(tally))


def _related(exercise: Exercise, case: Case, trace: Trace, execute: Execute) -> Judgement | None:
    """Run a case again for each relation; return the first judgement that is not pass."""
    for relation in exercise.relations:
        try:
            wrong = relation.judge(trace, execute(case, relation).trace, exercise.fields)
        except ParcoursError:
            raise
        except Exception as error:
            return Judgement(Verdict.ERROR, f"relation {relation.name} raised {type(error).__name__}: {error}")
        if wrong:
            return Judgement(Verdict.FAIL, wrong)
    return None


def judge_trace(exercise: Exercise, case: Case, trace: Trace) -> Judgement:
    """Judge a case by its trace alone: its data, did it deviate, was its order kept, and what does the oracle say.

    A case whose order could not be enforced is inconclusive unless its data break what the model says of them.
    """
    return _judged(exercise, case, trace)[0]


def _judged(exercise: Exercise, case: Case, trace: Trace) -> tuple[Judgement, Tally]:
    violation, tally = exercise.contracts.judge(trace, exercise.fields)
    judgement = _judgement(exercise, case, trace)
    if violation is not None:
        after = f"; then: {judgement.why}" if any(event.kind == "deviation" for event in trace.events) else ""
        judgement = Judgement(Verdict.FAIL, f"{violation}{after}")
    return judgement, tally


def _judgement(exercise: Exercise, case: Case, trace: Trace) -> Judgement:
    if why := exercise.contradiction(case):
        return Judgement(Verdict.INCONCLUSIVE, f"its data and the formulas of `supply` and `inputs` forbid it: {why}")
    deviation = next((event.text for event in trace.events if event.kind == "deviation"), "")
    if deviation:
        return Judgement(Verdict.FAIL, deviation)
    events = exercise.events(case)
    for instance in dict.fromkeys(map(instance_name, events)):
        wanted = tuple(event.transition for event in events if instance_name(event) == instance)
        if (taken := transitions(trace, instance)) != wanted:
            rule = f"{instance} must take {' '.join(wanted)}, but the trace says {' '.join(taken) or 'nothing'}"
            return Judgement(Verdict.FAIL, rule)
    if found := disorder(events, trace):
        return Judgement(Verdict.INCONCLUSIVE, f"order not enforced: {found}")
    return exercise.oracle(case, trace)


@dataclass(frozen=True, slots=True)
class TimingGroup:
    """Cases that are timed together, each against its own bound, with the machine's noise measured between them."""

    name: str  # an interaction path, or a span between two transitions
    cases: tuple[tuple[Case, Bound], ...]  # each with its bound
    span: Callable[[Trace], int]  # the duration of one repeat [ns] from its trace; `NEVER` if it has none


@dataclass(frozen=True, slots=True)
class CaseTiming:
    """One case executed again and again in real time, warm-up left out."""

    case: Case
    group: str  # what was timed
    bound: Bound  # the upper limit, and of how many repeats
    durations: tuple[int, ...]  # [ns], in the order in which they were measured; `NEVER` of a repeat that deviated
    noise: Noise  # of the machine, between the repeats of all cases of the group
    judgement: Judgement


def run_timing(
    exercise: Exercise,
    groups: Sequence[TimingGroup],
    execute: Execute,
    *,
    repeats: int,
    warm_up: int = 3,
    listener: Callable[[Case, Trace], None] = lambda case, trace: None,
    progress: Callable[[int], None] = lambda done: None,
) -> Iterator[CaseTiming]:
    """Yield the timing results of the groups' cases, group by group."""
    done = 0
    for group in groups:
        measured: list[tuple[int, ...]] = []
        trips = len(exercise.events(group.cases[0][0])) // 2
        with NoiseMeter(trips=trips, work=1_000_000) as meter:
            for case, _ in group.cases:
                taken = []
                for repeat in range(warm_up + repeats):
                    execution = execute(case)
                    if repeat >= warm_up:
                        meter.sample()
                        taken.append(group.span(execution.trace))
                        listener(case, execution.trace)
                measured.append(tuple(taken))
                done += 1
                progress(done)
        noise = meter.noise()
        for (case, bound), durations in zip(group.cases, measured, strict=True):
            yield CaseTiming(case, group.name, bound, durations, noise, judge(durations, bound, noise))


def whole_case(trace: Trace) -> int:
    """Return how long a repeat took [ns]; `NEVER` if it deviated."""
    return NEVER if any(event.kind == "deviation" for event in trace.events) else duration(trace)
