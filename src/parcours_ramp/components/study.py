"""The component study: 67 abstract cases filled with data, executed in their serialised order, judged and timed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from parcours.abtc import AbstractCase, abstract_cases
from parcours.paths import internal_paths
from parcours.run.clocks import Clock, WallClock
from parcours.run.hosts.node_program import Codec, Transport
from parcours.run.in_process import View
from parcours.run.port import links
from parcours.run.recording import PayloadCodec as RecordingCodec
from parcours.run.trace import Trace
from parcours.study.components import executing
from parcours.study.components.executing import CaseTiming, Execute, Functional, TimingGroup
from parcours.study.components.results import interaction_of as interaction_named
from parcours.study.components.study import ComponentStudy
from parcours.study.components.tester import Tester
from parcours.study.hosting import Nodes
from parcours.study.parameters import Parameter, Settings
from parcours.suite import Case, Plan
from parcours.verdict.judgement import Judgement
from parcours.verdict.timing import Bound
from parcours_ramp.components.components import view
from parcours_ramp.components.model import OUTSIDE, component_files, component_inputs, component_model
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.oracles import ORACLES
from parcours_ramp.components.reference_programs import SecondPrograms
from parcours_ramp.components.references import references
from parcours_ramp.components.relations import relations
from parcours_ramp.components.sample_payloads import specimens
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.planner import DECIDING
from parcours_ramp.planner.viewing import message_of

CASES_OF_PAPER = {"ITP1": 8, "ITP2": 8, "ITP3": 8, "ITP4": 12, "ITP5": 9, "ITP6": 15}
"""Executable cases per interaction test path (Table VIII), for function and for time each."""

LIMITS = {
    itp: (0.010, 0.100) if itp in ("ITP5", "ITP6") else (0.005, 0.050) for itp in CASES_OF_PAPER
}  # Least and greatest injected upper limit of each interaction test path [s] (Table VIII)

REPEATS = 60
"""This number of repeats shows with 95 % confidence that 95 % of all stay within a limit, if none of them misses it."""

PERCENT = 95.0  # Share of all repeats that must stay within the limit [%]
duration_of = executing.whole_case  # How long a repeat took [ns]

__all__ = ["CaseTiming", "Execute", "Functional", "RampComponents", "duration_of"]


class RampComponents(ComponentStudy):
    """RAMP's components: the paper's tester, oracles and limits in the place of defaults."""

    trusted = True
    compiles = True

    @functools.cached_property
    def abstracts(self) -> Mapping[str, AbstractCase]:
        """The 67 abstract cases, as the paper has them: guards are not asked. Another criterion gives others."""
        return {case.id: case for case in abstract_cases(self.model, paths=internal_paths(self.model, self.paths))}

    @functools.cached_property
    def infeasible(self) -> Mapping[str, str]:
        """None is left out."""
        return {}

    @property
    def recorded(self) -> RecordingCodec:
        """RAMP's own payloads."""
        return RampCodec()

    def nodes(self) -> Nodes:
        """Return the six components as nodes, with the channels of the system, too."""
        return replace(component_nodes(), model=self.model)

    def tester(self, case: Case, settings: Settings, *, timed: bool = False) -> Tester:
        """Return the tester of a case."""
        return ComponentTester(case, visits=self.visits(case, settings, timed=timed))

    def view(self) -> View:
        """Return what shows the trajectory that a Control follows."""
        return view

    def fields(self, channel: str, payload: object) -> Mapping[str, object] | None:
        """Return a payload of RAMP as the model's message."""
        return message_of(channel, payload)

    def oracle(self, case: Case, trace: Trace, settings: Settings) -> Judgement:
        """Judge by Table VIII, then by references."""
        expected = ORACLES[interaction_of(case)](trace)
        if not expected.passed:
            return expected
        referred = super().oracle(case, trace, settings)
        return expected if referred.passed else referred

    def timing(self, seed: int, settings: Settings) -> list[TimingGroup]:
        """Return the paper's sample: 60 cases against limits from the greatest down."""
        return timing_groups(paper_sample(self.plan(seed)), float(settings.get("percent", PERCENT)))


def component_nodes() -> Nodes:
    """Return RAMP's components as nodes, for component cases or for system cases."""
    from parcours_ramp.system.component_form import system_links

    model = component_model()
    inner, names = links(model), tuple(component.name for component in model.components)
    also = tuple(link for link in system_links() if link.channel not in {one.channel for one in inner})
    room = "parcours_ramp.components"
    return Nodes(
        model, (*inner, *also), names, f"{room}.node_program:ComponentNodeProgram", RampCodec(),
        f"{room}.ros1:node_program", f"{room}.ros1:codec", (f"{room}.warm",), shown=message_of, specimens=specimens,
    )  # fmt: skip


@functools.cache
def component_study() -> RampComponents:
    """Return the study."""
    percent = Parameter("percent", "real", PERCENT, "of repeats that must keep a limit", "%", low=50.0, high=99.999)
    return RampComponents(
        "ramp_components", component_model(), None, component_inputs(), where="ramp_components", own=(percent,),
        alone=True, files=component_files(), mutants=DECIDING, allowance=OUTSIDE,
        oracles=(*references(component_model()), SecondPrograms()), relations=relations(),
        doc="RAMP's six components: 67 abstract cases, and 60 against limits (Tables III to VIII)",
    )  # fmt: skip


@functools.cache
def _exercise(timed: bool = False) -> executing.Exercise:
    return component_study().exercise({}, timed=timed)


def interaction_cases() -> Mapping[str, AbstractCase]:
    """Return the 67 abstract cases by id."""
    return component_study().abstracts


def component_plan(seed: int = 0, rows: int = 3) -> Plan:
    """Return the plan of 67 * rows cases; three rows satisfy Each Choice for every abstract case."""
    return component_study().plan(seed, len(interaction_cases()) * rows)


def interaction_of(case: Case) -> str:
    """Return the interaction test path of a case, e.g. ITP1."""
    return interaction_named(case.abstract)


def paper_sample(plan: Plan) -> list[Case]:
    """Return 60 cases in the numbers of Table VIII, evenly spread over the abstract cases of each interaction path."""
    sample: list[Case] = []
    for itp, wanted in CASES_OF_PAPER.items():
        ids = [id for id, case in interaction_cases().items() if case.interaction.name == itp]
        for k in range(wanted):
            which = k % len(ids) if wanted >= len(ids) else k * len(ids) // wanted
            sample.append(plan.case(plan.number(ids[which], k // len(ids))))
    return sample


def here(clock: Callable[[], Clock] | None = None, *, timed: bool = False) -> Execute:
    """Return what executes cases, timed their interactions only, here in simulated time, or on the clocks given."""
    return executing.in_process(_exercise(timed), clock)


def on(transport: Transport, codec: Codec | None = None, *, strict: bool = True, timed: bool = False) -> Execute:
    """Return what executes cases on the nodes of a transport.

    Args:
        transport: started, with a node for each component that the cases visit.
        codec: of the transport's messages; MessagePack's if not given.
        strict: keep the serialised order itself; else any order that the case leaves open.
        timed: execute the interaction of a case only.
    """
    return executing.on_transport(_exercise(timed), transport, codec or RampCodec(), strict=strict)


def run_functional(case: Case, execute: Execute | None = None) -> Functional:
    """Execute one case in its serialised order, in simulated time by default, and judge it by Table VIII."""
    return executing.run_functional(_exercise(), case, execute or here())


def judge_trace(case: Case, trace: Trace) -> Judgement:
    """Judge a case by its trace alone: did it deviate, was its order kept, does Table VIII's expectation hold."""
    return executing.judge_trace(_exercise(), case, trace)


def limits(itp: str) -> np.ndarray:
    """Return the injected upper limits of an interaction path's timing cases [s], from the greatest down, evenly."""
    low, high = LIMITS[itp]
    return np.linspace(high, low, CASES_OF_PAPER[itp])


def timing_groups(sample: Sequence[Case], percent: float = PERCENT) -> list[TimingGroup]:
    """Return the cases of a sample with their limits, by interaction path."""
    groups = []
    for itp in CASES_OF_PAPER:
        cases = [case for case in sample if interaction_of(case) == itp]
        bounds = [Bound(round(limit * 1e9), percent, strict=False) for limit in limits(itp)]
        groups.append(TimingGroup(itp, tuple(zip(cases, bounds, strict=True)), duration_of))
    return groups


def run_timing(
    sample: Sequence[Case], execute: Execute | None = None, *, repeats: int = REPEATS, percent: float = PERCENT,
    warm_up: int = 3, listener: Callable[[Case, Trace], None] = lambda case, trace: None,
    progress: Callable[[int], None] = lambda done: None,
) -> Iterator[CaseTiming]:  # fmt: skip
    """Yield the timing results of the paper's sample of cases, interaction path by interaction path.

    Args:
        execute: by default in this process on the wall clock.
        repeats: of each case, beside `warm_up` that are not counted.
        percent: share of all repeats that must stay within the limit [%].
    """
    return executing.run_timing(
        _exercise(timed=True), timing_groups(sample, percent), execute or here(WallClock, timed=True), repeats=repeats,
        warm_up=warm_up, listener=listener, progress=progress,
    )  # fmt: skip
