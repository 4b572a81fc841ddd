"""The component study: 67 abstract cases filled with data, executed in their serialised order, judged and timed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.abtc import AbstractCase, Event, abstract_cases, serialise
from parcours.run.clocks import Clock, WallClock
from parcours.run.gated import Execution, disorder, enforce, instance_name
from parcours.run.here import execute
from parcours.run.hosts.driven import DrivenInstances
from parcours.run.hosts.resident import Codec, Fabric
from parcours.run.noise import Noise, NoiseMeter
from parcours.run.trace import Trace, transitions
from parcours.studies.ramp_components.components import view
from parcours.studies.ramp_components.model import component_inputs, component_model
from parcours.studies.ramp_components.oracles import ORACLES
from parcours.studies.ramp_components.resident import RampCodec
from parcours.studies.ramp_components.tester import ComponentTester
from parcours.suite import Case, Plan, combine
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, Bound, duration, judge

CASES_OF_PAPER = {"ITP1": 8, "ITP2": 8, "ITP3": 8, "ITP4": 12, "ITP5": 9, "ITP6": 15}
"""Executable cases per interaction test path (Table VIII), for function and for time each."""

LIMITS = {
    "ITP1": (0.005, 0.050),
    "ITP2": (0.005, 0.050),
    "ITP3": (0.005, 0.050),
    "ITP4": (0.005, 0.050),
    "ITP5": (0.010, 0.100),
    "ITP6": (0.010, 0.100),
}
"""Least and greatest injected upper limit of each interaction test path [s] (Table VIII)."""


@functools.cache
def interaction_cases() -> dict[str, AbstractCase]:
    """Return the 67 abstract cases by id."""
    return {case.id: case for case in abstract_cases(component_model())}


def component_plan(seed: int = 0, rows: int = 3) -> Plan:
    """Return the plan of 67 * rows cases; three rows satisfy Each Choice for every abstract case."""
    ids = tuple(interaction_cases())
    return combine("ramp_components", ids, component_inputs(), seed=seed, n_cases=len(ids) * rows)


def interaction_of(case: Case) -> str:
    """Return the interaction test path of a case, e.g. ITP1."""
    return interaction_cases()[case.abstract].interaction.name


def paper_sample(plan: Plan) -> list[Case]:
    """Return 60 cases in the numbers of Table VIII, evenly spread over the abstract cases of each interaction path."""
    sample: list[Case] = []
    for itp, wanted in CASES_OF_PAPER.items():
        ids = [id for id, case in interaction_cases().items() if case.interaction.name == itp]
        for k in range(wanted):
            which = k % len(ids) if wanted >= len(ids) else k * len(ids) // wanted
            sample.append(plan.case(plan.number(ids[which], k // len(ids))))
    return sample


@functools.lru_cache(maxsize=128)
def _events(abstract: str) -> tuple[Event, ...]:
    return serialise(interaction_cases()[abstract])


Execute = Callable[[Case], Execution]
"""Runs a case on some host."""


def here(clock: Callable[[], Clock] | None = None) -> Execute:
    """Return what executes cases in this process, in simulated time, or on the clocks it is given."""

    def run(case: Case) -> Execution:
        tester = ComponentTester(case)
        return execute(
            _events(case.abstract), tester.component, tester.supply, prompt=tester.move, prepare=tester.prepare,
            view=view, clock=clock() if clock else None, case=case.id,
        )  # fmt: skip

    return run


def on(fabric: Fabric, codec: Codec | None = None, *, strict: bool = True) -> Execute:
    """Return what executes cases on the nodes of a fabric.

    Args:
        fabric: started, with a node for each component that the cases visit.
        codec: of the fabric's messages; MessagePack's if not given.
        strict: keep the serialised order itself; else any order that the case leaves open.
    """

    def run(case: Case) -> Execution:
        tester = ComponentTester(case)
        instances = DrivenInstances(fabric, codec or RampCodec(), tester)
        return enforce(_events(case.abstract), instances, tester.supply, case=case.id, strict=strict)

    return run


@dataclass(frozen=True, slots=True)
class Functional:
    """One case executed, and what the oracle says of it."""

    case: Case
    execution: Execution
    judgement: Judgement


def run_functional(case: Case, execute: Execute | None = None) -> Functional:
    """Execute one case in its serialised order, in simulated time if not told otherwise, and judge it by Table VIII.

    A case whose order could not be enforced is inconclusive, whatever came of it.
    """
    execution = (execute or here())(case)
    return Functional(case, execution, judge_trace(case, execution.trace))


def judge_trace(case: Case, trace: Trace) -> Judgement:
    """Judge a case by its trace alone: did it deviate, was its order kept, does Table VIII's expectation hold."""
    deviation = next((event.text for event in trace.events if event.kind == "deviation"), "")
    if deviation:
        return Judgement(Verdict.FAIL, deviation)
    events = _events(case.abstract)
    for instance in dict.fromkeys(map(instance_name, events)):
        wanted = tuple(event.transition for event in events if instance_name(event) == instance)
        if (taken := transitions(trace, instance)) != wanted:
            rule = f"{instance} must take {' '.join(wanted)}, but the trace says {' '.join(taken) or 'nothing'}"
            return Judgement(Verdict.FAIL, rule)
    if found := disorder(events, trace):
        return Judgement(Verdict.INCONCLUSIVE, f"order not enforced: {found}")
    return ORACLES[interaction_of(case)](trace)


@dataclass(frozen=True, slots=True)
class Timing:
    """One case executed again and again in real time, warm-up left out.

    Attributes:
        bound: the injected upper limit, and of how many repeats.
        durations: [ns], in the order in which they were measured; `NEVER` of a repeat that deviated.
        noise: of the machine, between the repeats of all cases of this interaction path.
    """

    case: Case
    bound: Bound
    durations: tuple[int, ...]
    noise: Noise
    judgement: Judgement


def limits(itp: str) -> np.ndarray:
    """Return the injected upper limits of an interaction path's timing cases [s], from the greatest down, evenly."""
    low, high = LIMITS[itp]
    return np.linspace(high, low, CASES_OF_PAPER[itp])


REPEATS = 60
"""So many repeats show with 95 % confidence that 95 % of all stay within a limit, if none of them misses it."""


def run_timing(
    sample: Sequence[Case],
    execute: Execute | None = None,
    *,
    repeats: int = REPEATS,
    percent: float = 95.0,
    warm_up: int = 3,
    listener: Callable[[Case, Trace], None] = lambda case, trace: None,
    progress: Callable[[int], None] = lambda done: None,
) -> Iterator[Timing]:
    """Yield the timing results of the paper's sample of cases, interaction path by interaction path.

    Args:
        sample: as `paper_sample` gives it.
        execute: by default in this process on the wall clock.
        repeats: of each case, beside `warm_up` that are forgotten.
        percent: so many of all repeats must stay within the limit [%].
        listener: told of each repeat that counts.
        progress: told how many cases are measured.
    """
    execute = execute or here(WallClock)
    done = 0
    for itp in CASES_OF_PAPER:
        cases = [case for case in sample if interaction_of(case) == itp]
        measured: list[tuple[int, ...]] = []
        trips = len(_events(cases[0].abstract)) // 2
        with NoiseMeter(trips=trips, work=1_000_000) as meter:
            for case in cases:
                taken = []
                for repeat in range(warm_up + repeats):
                    execution = execute(case)
                    if repeat >= warm_up:
                        meter.sample()
                        taken.append(duration_of(execution.trace))
                        listener(case, execution.trace)
                measured.append(tuple(taken))
                done += 1
                progress(done)
        noise = meter.noise()
        for case, limit, durations in zip(cases, limits(itp), measured, strict=True):
            bound = Bound(round(limit * 1e9), percent, strict=False)
            yield Timing(case, bound, durations, noise, judge(durations, bound, noise))


def duration_of(trace: Trace) -> int:
    """Return how long a repeat took [ns]; `NEVER` if it deviated."""
    return NEVER if any(event.kind == "deviation" for event in trace.events) else duration(trace)
