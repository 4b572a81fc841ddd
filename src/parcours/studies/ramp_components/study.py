"""The component study: 67 abstract cases filled with data, executed in their serialised order, judged and timed."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.abtc import AbstractCase, Event, abstract_cases, serialise
from parcours.run.clocks import WallClock
from parcours.run.gated import Execution, execute
from parcours.studies.ramp_components.model import component_inputs, component_model
from parcours.studies.ramp_components.oracles import ORACLES
from parcours.studies.ramp_components.tester import ComponentTester
from parcours.suite import Case, Plan, combine
from parcours.verdict.interaction import duration, within
from parcours.verdict.judgement import Judgement, Verdict

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


@dataclass(frozen=True, slots=True)
class Functional:
    """One case executed in simulated time, and what the oracle says of it."""

    case: Case
    execution: Execution
    judgement: Judgement


def run_functional(case: Case) -> Functional:
    """Execute one case in its serialised order in simulated time and judge it by Table VIII."""
    tester = ComponentTester(case)
    execution = execute(
        _events(case.abstract), tester.component, tester.supply, prompt=tester.prompt, prepare=tester.prepare,
        case=case.id,
    )  # fmt: skip
    if execution.deviation is not None:
        return Functional(case, execution, Judgement(Verdict.FAIL, str(execution.deviation)))
    return Functional(case, execution, ORACLES[interaction_of(case)](execution))


@dataclass(frozen=True, slots=True)
class Timing:
    """One case executed again and again on the wall clock: its limit and durations, warm-up left out."""

    case: Case
    limit: float
    """Injected upper limit [s]."""
    durations: tuple[int, ...]
    """[ns]"""
    judgement: Judgement


def limits(itp: str) -> np.ndarray:
    """Return the injected upper limits of an interaction path's timing cases [s], from the greatest down, evenly."""
    low, high = LIMITS[itp]
    return np.linspace(high, low, CASES_OF_PAPER[itp])


def run_timing(sample: Sequence[Case], *, repeats: int = 20, warm_up: int = 3) -> Iterator[Timing]:
    """Yield the timing results of the paper's sample of cases, each executed `repeats` times on the wall clock."""
    place = dict.fromkeys(CASES_OF_PAPER, 0)
    for case in sample:
        itp = interaction_of(case)
        limit = float(limits(itp)[place[itp]])
        place[itp] += 1
        taken = [_timed(case) for _ in range(warm_up + repeats)][warm_up:]
        yield Timing(case, limit, tuple(taken), within(taken, limit))


def _timed(case: Case) -> int:
    """Execute the case on the wall clock and return how long it took [ns]; what can be made ready before is."""
    tester = ComponentTester(case)
    supplied = {event.position: tester.supply(event) for event in _events(case.abstract) if _is_supplied(event)}
    references = {event.reference: event.component for event in reversed(_events(case.abstract))}
    order = dict.fromkeys(event.reference for event in _events(case.abstract))
    ready = iter([tester.component(references[reference]) for reference in order])
    execution = execute(
        _events(case.abstract), lambda name: next(ready), lambda event: supplied[event.position], prompt=tester.prompt,
        prepare=tester.prepare, clock=WallClock(), case=case.id,
    )  # fmt: skip
    return duration(execution.trace)


def _is_supplied(event: Event) -> bool:
    return event.receives is not None and event.receives.event is None
