"""Component cases -> RAMP's components as the authors prepare theirs for a test, and what a tester may do to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from parcours.kernels import Record
from parcours.run.port import Component, Step
from parcours.suite import Case
from parcours_ramp.planner.component_factory import component
from parcours_ramp.planner.control import REPORT_PERIOD, Control
from parcours_ramp.planner.messages import POSE, one
from parcours_ramp.planner.parameters import Parameters, guarded
from parcours_ramp.planner.planner import Planner
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation
from parcours_ramp.planner.trajectory_generator import TrajectoryGenerator

GOAL = (2.0, 2.0)

_LONG_AFTER = 60_000_000_000  # No case lasts so long [ns]
_COMMANDS = 8  # of a control before all is done


def parameters_of(case: Case) -> Parameters:
    """Return RAMP's parameters, guarded by default, with the case's population."""
    return replace(guarded(), population=int(case["population"]))


def robot_of(case: Case, parameters: Parameters) -> Record:
    """Return the robot's POSE at the start of a case."""
    begin = one(POSE)
    begin.heading, begin.v = 0.7853981633974483, min(case["motion"], parameters.v_max)
    return begin


def component_of(name: str, case: Case, parameters: Parameters) -> Component:
    """Return a fresh component for a case. Raises BadRequest if RAMP has none of that name."""
    made = component(name, parameters, case.seed, case.number, robot_of(case, parameters), GOAL)
    return _prepared(made, parameters) if isinstance(made, Planner) else made


def _prepared(planner: Planner, parameters: Parameters) -> Planner:
    """Return a planner after its first control cycle, as the authors prepare theirs for a test."""
    services: dict[str, TrajectoryGenerator | TrajectoryEvaluation] = {
        "trajectory_request": TrajectoryGenerator(parameters),
        "evaluation_request": TrajectoryEvaluation(parameters),
    }
    asked = [send for step in planner.control(0) for send in step.sends if send[0] in services]
    while asked:
        channel, request = asked.pop(0)
        answers = [send for step in services[channel].handle(channel, request, 0) for send in step.sends]
        for answer_channel, answer in answers:
            steps = planner.handle(answer_channel, answer, 0)
            asked += [send for step in steps for send in step.sends if send[0] in services]
    planner.state.t_next = _LONG_AFTER  # a sensing cycle asks less just before a control cycle: the case says when
    return planner


LATER = "tick, second interval over"

PROMPTS: Mapping[str, Callable[[Any, int], Iterator[Step]]] = {
    "poll": lambda component, now: component.handle(None, None, now),
    "plan": lambda planner, now: planner.plan(),
    "control": lambda planner, now: planner.control(now),
    "tick": lambda control, now: control.tick(0),
    "tick, interval over": lambda control, now: control.tick(REPORT_PERIOD),
    LATER: lambda control, now: control.tick(2 * REPORT_PERIOD),
    "execute": lambda control, now: control.execute(control.next_command),
    "execute, all done": lambda control, now: _to_the_end(control),
}  # What moves an idle component where the model lets no message do so: (component, time [ns]) -> steps


def _to_the_end(control: Control) -> Iterator[Step]:
    """Let some commands pass, each at its time, and then the end."""
    for _ in range(_COMMANDS):
        yield from control.execute(control.next_command)
    yield from control.execute(control.next_command + _LONG_AFTER)


PROMPT_OF: Mapping[str, str] = {
    "p11": "plan",
    "p12": "control",
    "p43": "execute",
    "p44": "execute",
    "p46": "execute, all done",
    "p47": "tick",
    "p48": "tick, interval over",
}  # Transition -> its prompt; of others, poll


def view(component: Component) -> tuple[str, object] | None:
    """Return the trajectory that a Control follows, as a message of `best_trajectory`; of other components None."""
    return ("best_trajectory", component.trajectory.copy()) if isinstance(component, Control) else None
