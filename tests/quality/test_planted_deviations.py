"""Deviations planted in RAMP's components: found where they happen, with what was expected and what led there."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.trace import Trace
from parcours.verdict.conformance import Allowance, Conformance, Expectation, check
from parcours.verdict.conformance.tracking import Observes
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.model import component_model
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.messages import PlannerStep, Tag, TrajectoryResponse
from parcours_ramp.system import component_form
from parcours_ramp.system.study import system_study

TIMELESS = dataclasses.replace(system_study("guarded"), latencies=none())

RAMP = Allowance(unmodelled=frozenset({"trajectory_request", "evaluation_request"}), conversations=True)
"""What RAMP does beside Table II: its planner asks in planning and control cycles, too."""

MS = 1_000_000
WATCHED = 300 * MS
TIMEOUTS = {
    "update": 40 * MS,
    "modification_request": 60 * MS,
    "trajectory_response": 5 * MS,
    "evaluation_response": 5 * MS,
    "modification_response": 5 * MS,
}

Spoil = Callable[[Iterator[PlannerStep]], Iterator[PlannerStep]]
"""What a faulty component does in place of the steps of one message or wake."""


def after(name: str, *more: PlannerStep) -> Spoil:
    return lambda steps: (out for step in steps for out in ((step, *more) if step.transition == name else (step,)))


def before(name: str, *more: PlannerStep) -> Spoil:
    return lambda steps: (out for step in steps for out in ((*more, step) if step.transition == name else (step,)))


def without(name: str) -> Spoil:
    return lambda steps: (step for step in steps if step.transition != name)


def instead(name: str, change: Callable[[PlannerStep], PlannerStep]) -> Spoil:
    return lambda steps: (change(step) if step.transition == name else step for step in steps)


def renamed(name: str, to: str) -> Spoil:
    return instead(name, lambda step: PlannerStep(to, step.sends))


def swapped(first: str, second: str) -> Spoil:
    def spoil(steps: Iterator[PlannerStep]) -> Iterator[PlannerStep]:
        held: PlannerStep | None = None
        for step in steps:
            if step.transition == first:
                held = step
            else:
                yield step
                if step.transition == second and held is not None:
                    yield held

    return spoil


def until(name: str) -> Spoil:
    def spoil(steps: Iterator[PlannerStep]) -> Iterator[PlannerStep]:
        for step in steps:
            yield step
            if step.transition == name:
                return

    return spoil


def silent(steps: Iterator[PlannerStep]) -> Iterator[PlannerStep]:
    for step in steps:
        yield PlannerStep("", tuple(send for send in step.sends if send[0] == "cmd_vel"))


def deferred(name: str, to: str) -> Spoil:
    """The messages of one transition leave with a later one."""

    def spoil(steps: Iterator[PlannerStep]) -> Iterator[PlannerStep]:
        kept: tuple[tuple[str, object], ...] = ()
        for step in steps:
            if step.transition == name:
                kept = step.sends
                yield PlannerStep(name)
            elif step.transition == to:
                yield PlannerStep(to, (*step.sends, *kept))
            else:
                yield step

    return spoil


def faulty(healthy: type, spoil: Spoil) -> type:
    """Return the component's class with its steps spoilt."""

    class Faulty(healthy):  # type: ignore[misc]
        def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
            return spoil(super().handle(channel, message, now))

        def wake(self, now: int) -> Iterator[PlannerStep]:
            return spoil(super().wake(now))

    return Faulty


def twice(step: PlannerStep) -> PlannerStep:
    return PlannerStep(step.transition, step.sends * 2)


def twice_but_stale(step: PlannerStep) -> PlannerStep:
    """Answer twice; the second answer names a conversation that nobody holds, so that the planner survives it."""
    [(channel, answer)] = step.sends
    assert isinstance(answer, TrajectoryResponse)
    return PlannerStep(step.transition, ((channel, answer), (channel, answer._replace(tag=Tag("sensing", -1)))))


def mute(step: PlannerStep) -> PlannerStep:
    return PlannerStep(step.transition)


def on(channel: str) -> Callable[[PlannerStep], PlannerStep]:
    return lambda step: PlannerStep(step.transition, tuple((channel, payload) for _, payload in step.sends))


def lagging(delay: int) -> Callable[[str, str], int]:
    """The Trajectory Evaluation takes that long [ns] for each answer."""
    return lambda component, transition: delay if transition == "p34" else 0


@dataclass(frozen=True, slots=True)
class Plant:
    """One planted deviation: where, what, and how it must be found."""

    component: str
    spoil: Spoil
    path: str
    """How it ends."""
    name: str
    """The transition or channel at which it is found."""
    words: str
    """What the rule says of it."""
    expected: str
    """What the model lets come instead: transitions, !sent and ?received messages."""
    seen_from_outside: bool = False
    """Whether messages alone give it away."""


PLANTS: dict[str, Plant] = {
    "it works on before it has taken up the request": Plant("TrajectoryGenerator", without("p22"),
        "", "p23", "cannot be taken here", "p21 p22"),
    "it takes one request up twice": Plant("TrajectoryGenerator", after("p25", PlannerStep("p22")),
        "p22 p23 p24 p25", "p22", "needs a message of", "?trajectory_request p21"),
    "it answers twice in one transition": Plant("TrajectoryGenerator", instead("p24", twice_but_stale),
        "p22 p23 p24", "trajectory_response", "no transition taken sends it", "p25", seen_from_outside=True),
    "it forgets to send its answer": Plant("TrajectoryGenerator", instead("p24", mute),
        "p22 p23 p24", "p25", "came before what the last transition must send",
        "!trajectory_response", seen_from_outside=True),
    "it answers before it has worked": Plant("TrajectoryGenerator", swapped("p22", "p24"),
        "", "p23", "cannot be taken here", "p21 p22"),
    "its answer leaves with a later transition": Plant("TrajectoryGenerator", deferred("p24", "p25"),
        "p22 p23 p24", "p25", "came before what the last transition must send", "!trajectory_response"),
    "it never goes back to listening": Plant("TrajectoryEvaluation", without("p35"),
        "p32 p33 p34", "p32", "cannot be taken here", "p35"),
    "it goes back to listening without an answer": Plant("TrajectoryEvaluation", without("p34"),
        "p32 p33", "p35", "cannot be taken here", "p33 p34", seen_from_outside=True),
    "it hangs in the middle of its work": Plant("TrajectoryEvaluation", until("p33"),
        "p32 p33", "evaluation_response", "within 5 ms", "p33 p34", seen_from_outside=True),
    "it answers late": Plant("TrajectoryEvaluation", iter,
        "p32 p33", "evaluation_response", "within 5 ms", "p33 p34", seen_from_outside=True),
    "it takes its transitions in another order": Plant("PathModification", swapped("p53", "p54"),
        "p52 p54", "p53", "cannot be taken here", "p55"),
    "it answers one request with two transitions": Plant(
        "PathModification", after("p54", PlannerStep("p54", (("modification_response", None),))),
        "p52 p53 p54", "p54", "cannot be taken here", "p55", seen_from_outside=True),
    "it reports a transition that it does not have": Plant("PathModification", renamed("p53", "p43"),
        "p52", "p43", "is no transition of", "p53 p54"),
    "it sends before it may": Plant("Sensing", before("p63", PlannerStep("", (("obstacles", None),))),
        "p62", "obstacles", "no transition taken sends it", "p63 p64"),
    "it sends after its end": Plant("Sensing", after("p64", PlannerStep("", (("obstacles", None),))),
        "p62 p63 p64", "obstacles", "no transition taken sends it", "?odometry p61"),
    "it begins anew without a message": Plant("Sensing", after("p64", PlannerStep("p62")),
        "p62 p63 p64", "p62", "needs a message of", "?odometry p61"),
    "it begins in another state than its first": Plant("Control", before("p42", PlannerStep("p46")),
        "", "p46", "cannot be taken here", "p41 p42 p44 p47 p48"),
    "it acts without having been told": Plant("Control", before("p48", PlannerStep("p42")),
        "p42 p47", "p42", "cannot be taken here", "p43 p46 p47 p48"),
    "its clock is never set back": Plant("Control", without("p49"),
        "p42 p47 p48", "p47", "cannot be taken here", "p43 p46 p49"),
    "it reports between two intervals": Plant("Control",
        instead("p47", lambda step: PlannerStep("p47", (("update", None),))),
        "p42 p47", "update", "no transition taken sends it", "p43 p46 p47 p48"),
    "it is silent from the beginning": Plant("Control", silent,
        "", "update", "within 40 ms", "p41 p42 p44 p47 p48", seen_from_outside=True),
    "it asks on another channel": Plant("Planner", instead("p15", on("evaluation_request")),
        "p12 p13 p11 p15", "evaluation_request", "where the transition taken sends another",
        "!trajectory_request", seen_from_outside=True),
    "it asks again without an answer": Plant("Planner", after("p15", PlannerStep("p16")),
        "p12 p13 p11 p15", "p16", "needs a message of",
        "?trajectory_response !evaluation_request !trajectory_request p11 p12 p17"),
    "it takes one transition for another": Plant("Planner", renamed("p17", "p16"),
        "p11 p15 p16 p16 p16", "evaluation_request", "where the transition taken sends another", "!trajectory_request"),
    "it does not end its sensing cycle": Plant("Planner", without("p19"),
        "p16 p16 p17 p18 p11", "p15", "cannot be taken here",
        "?evaluation_response !evaluation_request !trajectory_request p11 p12 p19"),
    "it takes a transition of another conversation": Plant("Planner", renamed("", "p16"),
        "p12 p13", "p16", "cannot be taken here", "?obstacles !evaluation_request !trajectory_request p11 p12 p14"),
    "it publishes one trajectory twice": Plant("Planner", instead("p12", twice),
        "p12", "best_trajectory", "no transition taken sends it",
        "?obstacles !evaluation_request !trajectory_request p13 p14"),
    "it plans before its control cycle is over": Plant("Planner", without("p13"),
        "p12", "p11", "cannot be taken here", "?obstacles !evaluation_request !trajectory_request p13 p14"),
    "it asks twice at once": Plant("Planner", after("p15", PlannerStep("", (("trajectory_request", None),))),
        "p12 p13 p11 p15", "trajectory_request", "holds 1, but one more was sent",
        "?trajectory_response !evaluation_request !trajectory_request p11 p12 p17", seen_from_outside=True),
}  # fmt: skip


def run(plant: Plant, monkeypatch: pytest.MonkeyPatch, title: str) -> Trace:
    healthy = getattr(component_form, plant.component)
    monkeypatch.setattr(component_form, plant.component, faulty(healthy, plant.spoil))
    if title == "it answers late":
        host = functools.partial(SimulatedHost, execution=lagging(8 * MS))
        monkeypatch.setattr(component_form, "SimulatedHost", host)
    return component_form.run_components(TIMELESS, 0, WATCHED * 1e-9).trace


def checked(trace: Trace, observes: Observes = "transitions") -> Conformance:
    return check(trace, component_model(), allowance=RAMP, quiescence=TIMEOUTS, observes=observes, until=WATCHED)


def compact(expectation: Expectation) -> str:
    return {"take": "", "send": "!", "receive": "?"}[expectation.what] + expectation.name


@pytest.mark.parametrize("title", PLANTS)
def test_a_planted_deviation_is_found_where_it_happens(title: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plant = PLANTS[title]
    trace = run(plant, monkeypatch, title)
    found = checked(trace)
    deviation = found.deviation
    assert deviation is not None
    assert found.judgement.verdict is Verdict.FAIL
    assert deviation.component == plant.component
    assert plant.words in deviation.rule
    assert " ".join(map(compact, deviation.expected)) == plant.expected
    assert " ".join(deviation.path[-5:]) == plant.path
    if deviation.event is not None:
        assert trace.events[deviation.position] is deviation.event
        assert (deviation.event.transition or deviation.event.channel) == plant.name
    else:
        assert f"nothing came on {plant.name} " in deviation.rule
        assert trace.events[deviation.position - 1].time <= deviation.time < trace.events[deviation.position].time
    assert (checked(trace, "messages").deviation is not None) == plant.seen_from_outside


@pytest.mark.parametrize("observes", ["transitions", "messages"])
def test_the_system_without_a_plant_does_not_deviate(observes: Observes) -> None:
    trace = component_form.run_components(TIMELESS, 0, WATCHED * 1e-9).trace
    assert checked(trace, observes).judgement.passed


def test_a_deviation_is_planted_in_every_component() -> None:
    assert {plant.component for plant in PLANTS.values()} == {each.name for each in component_model().components}
    assert len(PLANTS) >= 20
