"""Control and Planner once more, in plain Python, as one oracle of the component cases."""

from __future__ import annotations

from dataclasses import dataclass

from parcours.run.trace import Trace
from parcours.study.parameters import Settings
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict
from parcours_ramp.components.components import GOAL, parameters_of, robot_of
from parcours_ramp.components.control_reference import judge_control
from parcours_ramp.components.motion_reference import pose_of
from parcours_ramp.components.planner_reference import judge_planner


@dataclass(frozen=True)
class SecondPrograms:
    """What Control and Planner send, against what second programs make of what these were told."""

    of_data: bool = True

    def __call__(self, case: Case, trace: Trace, settings: Settings) -> Judgement:
        """Judge a trace in simulated time: on other clocks it is not known when a component read its own."""
        if trace.clock != "simulated":
            return Judgement(Verdict.PASS, "")
        parameters = parameters_of(case)
        begin = pose_of(robot_of(case, parameters))
        try:
            wrong = judge_control(trace, parameters, timed=False) or judge_planner(trace, parameters, begin, GOAL)
        except Exception as error:  # a component may say anything
            return Judgement(Verdict.ERROR, f"no second program can follow it: {type(error).__name__}: {error}")
        return Judgement(Verdict.FAIL, wrong) if wrong else Judgement(Verdict.PASS, "")
