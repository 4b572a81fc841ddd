"""The component study: every abstract case runs to its end in its enforced order, is judged, and is timed."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from parcours.abtc import ask_alone, serialise
from parcours.data import cover
from parcours.errors import BadRequest
from parcours.run.clocks import ClockName, SimulatedClock
from parcours.run.trace import transitions
from parcours.study.components import executing
from parcours.study.components.landing import landing_of
from parcours.study.components.messages import ModelMessages
from parcours.study.components.results import PER_CASE
from parcours.suite import Case, combine
from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import duration, judge
from parcours_ramp.components.model import component_inputs, component_model
from parcours_ramp.components.oracles import ORACLES
from parcours_ramp.components.study import (
    CASES_OF_PAPER,
    LIMITS,
    Functional,
    component_plan,
    component_study,
    here,
    interaction_cases,
    interaction_of,
    limits,
    paper_sample,
    run_functional,
    run_timing,
)
from parcours_ramp.planner.messages import (
    EvaluationResponse,
    ModificationResponse,
    PlannerStep,
    TrajectoryRequest,
    TrajectoryResponse,
)
from parcours_ramp.planner.planner import Planner
from parcours_ramp.planner.route import HOLONOMIC, HYBRID, TRANSITION
from parcours_ramp.planner.viewing import message_of

ROWS = 3


@functools.cache
def results() -> tuple[Functional, ...]:
    return tuple(run_functional(case) for case in component_plan(seed=4).cases())


def test_all_67_abstract_cases_with_three_rows_each_complete_in_order_and_pass() -> None:
    assert len(results()) == 67 * ROWS
    assert [(r.case.id, r.judgement.why) for r in results() if not r.judgement.passed] == []
    assert all(result.execution.completed for result in results())


class SlowClock(SimulatedClock):
    """The clock of a machine so slow that half a second passes between any two looks at it."""

    name: ClockName = "wall"

    def now(self) -> int:
        return self.advance(super().now() + 500_000_000)


def test_no_case_depends_on_how_fast_the_machine_is() -> None:
    slow = [run_functional(case, here(SlowClock)) for case in component_plan(seed=4, rows=1).cases()]
    assert [(r.case.id, r.judgement.why) for r in slow if not r.judgement.passed] == []
    assert min(duration(result.execution.trace) for result in slow) > 1_000_000_000


def test_what_was_taken_is_the_serialised_case_transition_by_transition() -> None:
    for result in results():
        interaction = serialise(interaction_cases()[result.case.abstract])
        demanded = ask_alone(interaction)
        assert transitions(result.execution.trace) == tuple(event.transition for event in demanded)
        assert demanded[: len(interaction)] == interaction


def test_the_trajectory_generator_is_asked_for_every_kind_of_way_of_the_robot_in_every_case_that_visits_it() -> None:
    visited = 0
    for result in results():
        ways = [
            event.payload
            for event in result.execution.trace.events
            if event.kind == "receive"
            and isinstance(event.payload, TrajectoryRequest)
            and event.payload.obstacles is None
        ]
        visited += bool(ways)
        assert bool(ways) == ("TrajectoryGenerator" in interaction_cases()[result.case.abstract].interaction.components)
        for way in ways:
            assert set(way.kinds.tolist()) == {HYBRID, HOLONOMIC, TRANSITION}
            assert all(path.n >= result.case["path"] for path in way.paths)
    assert visited == 3 * 21


def test_every_block_of_path_and_trajectory_lands_whatever_the_interaction() -> None:
    ids = [next(id for id in interaction_cases() if id.startswith(itp)) for itp in CASES_OF_PAPER]
    study = component_study()
    plan = combine(study.name, ids, study.inputs, seed=4)
    found = landing_of(study, plan, {}, lambda what, done, total: None)
    assert not found.unreached and not found.further
    blind = {itp for id, itp in zip(ids, CASES_OF_PAPER, strict=True) if 4 not in found.of[id].felt}
    assert blind == {"ITP4"}, "Control alone does not hear of obstacles"
    for id in ids:
        assert {0, 1, 2, 3} <= set(found.of[id].felt)


def test_timing_cases_are_the_interaction_alone() -> None:
    case = component_plan(seed=4).case(0)
    timed, whole = here(SlowClock, timed=True)(case), here(SlowClock)(case)
    assert transitions(timed.trace) == tuple(
        event.transition for event in serialise(interaction_cases()[case.abstract])
    )
    assert len(transitions(whole.trace)) == len(transitions(timed.trace)) + 5


def test_three_rows_meet_each_choice_for_every_abstract_case() -> None:
    plan, ids = component_plan(seed=4), list(interaction_cases())
    for k in range(len(ids)):
        assert cover(component_inputs(), plan.values(k + len(ids) * np.arange(ROWS))).is_complete


def test_components_answer_under_the_tag_they_were_asked_under() -> None:
    answers = TrajectoryResponse | EvaluationResponse | ModificationResponse
    seen = 0
    for result in results():
        waiting: Counter[tuple[str, object]] = Counter()
        for event in result.execution.trace.events:
            service = event.component.split("#")[0]
            tag = getattr(event.payload, "tag", None)
            if event.kind == "receive" and event.channel.endswith("_request"):
                waiting[service, tag] += 1
            elif event.kind == "send" and isinstance(event.payload, answers) and "#" in event.component:
                waiting[service, tag] -= 1
                seen += 1
        assert all(count >= 0 for count in waiting.values())
    assert seen > 67


def test_the_paper_s_sample_has_its_numbers_of_cases_and_spreads_over_the_abstract_ones() -> None:
    sample = paper_sample(component_plan())
    assert Counter(interaction_of(case) for case in sample) == CASES_OF_PAPER
    assert sum(CASES_OF_PAPER.values()) == 60
    assert len({case.id for case in sample}) == 60
    for itp in ("ITP1", "ITP2", "ITP3", "ITP4"):
        whole = {id for id, case in interaction_cases().items() if case.interaction.name == itp}
        assert {case.abstract for case in sample if interaction_of(case) == itp} == whole


def test_every_interaction_path_has_an_oracle_and_limits() -> None:
    assert set(ORACLES) == set(LIMITS) == set(CASES_OF_PAPER) == {interaction_of(r.case) for r in results()}


def test_injected_limits_run_evenly_from_the_greatest_to_the_least_of_table_viii() -> None:
    for itp, (low, high) in LIMITS.items():
        steps = limits(itp)
        assert len(steps) == CASES_OF_PAPER[itp]
        assert (steps[0], steps[-1]) == pytest.approx((high, low))
        assert np.diff(steps) == pytest.approx(np.diff(steps)[0])


def test_a_case_run_twice_gives_the_same_trace() -> None:
    for result in results()[::23]:
        assert run_functional(result.case).execution.trace == result.execution.trace


def test_durations_are_refused_on_simulated_time_and_measured_on_the_wall() -> None:
    with pytest.raises(BadRequest, match="simulated-duration"):
        duration(results()[0].execution.trace)
    timed = list(run_timing(paper_sample(component_plan()), repeats=2, warm_up=1))
    assert len(timed) == 60
    for timing in timed:
        assert len(timing.durations) == 2
        assert all(0 < taken < 5_000_000_000 for taken in timing.durations)
        assert timing.judgement == judge(timing.durations, timing.bound, timing.noise)
        assert timing.judgement.verdict is not Verdict.PASS  # two repeats show nothing of 95 %


def one_instance(case: Case) -> Functional:
    exercise = component_study().exercise({"instances": PER_CASE})
    return executing.run_functional(exercise, case, executing.in_process(exercise))


def test_all_67_abstract_cases_pass_with_one_instance_of_each_component() -> None:
    for case in component_plan(seed=4, rows=1).cases():
        run = one_instance(case)
        assert run.judgement.passed, (case.id, run.judgement.why)
        names = {event.component for event in run.execution.trace.events if "#" in event.component}
        assert len(names) == len({name.split("#")[0] for name in names})


def test_a_planner_that_accepts_any_answer_is_found_with_one_instance_only(monkeypatch: pytest.MonkeyPatch) -> None:
    handle = Planner.handle

    def accepting(self: Planner, channel: str | None, message: Any, now: int) -> Iterator[PlannerStep]:
        if hasattr(message, "tag") and self._conversation is not None:
            message = message._replace(tag=self._conversation)
        yield from handle(self, channel, message, now)

    monkeypatch.setattr(Planner, "handle", accepting)
    cases = [
        case for case in component_plan(seed=4, rows=1).cases() if interaction_of(case) in ("ITP1", "ITP2", "ITP5")
    ]
    assert all(run_functional(case).judgement.passed for case in cases)
    assert {one_instance(case).judgement.verdict for case in cases} == {Verdict.FAIL}


def test_every_message_is_of_the_class_that_the_model_declares() -> None:
    messages, channels = ModelMessages(component_model()), set()
    for number in range(67):
        for event in run_functional(component_plan().case(number)).execution.trace.events:
            if event.kind == "send" and (message := message_of(event.channel, event.payload)) is not None:
                channels.add(event.channel)
                if event.channel in {channel.name for channel in component_model().channels}:
                    assert messages.checked(event.channel, message) == message
    assert {channel.name for channel in component_model().channels} <= channels
