"""The tester of RAMP's components: values of a case -> the messages it supplies, and how it moves idle components on.

What the environment supplies is real: trajectories come from a Trajectory Generator of the tester's own.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from parcours.abtc import Event
from parcours.elementary import sin_cos
from parcours.errors import HostFailure
from parcours.kernels import Record
from parcours.planners.ramp.control import COMMAND_PERIOD, REPORT_PERIOD, Control
from parcours.planners.ramp.messages import (
    MODIFICATION,
    OBSTACLE_STATE,
    PATH,
    POSE,
    PREDICTION,
    TRAJECTORY,
    EvaluationRequest,
    EvaluationResponse,
    ModificationRequest,
    Obstacles,
    Report,
    Tag,
    TrajectoryRequest,
    TrajectoryResponse,
    many,
    one,
)
from parcours.planners.ramp.parameters import Parameters, guarded
from parcours.planners.ramp.path_modification import CHANGE, INSERT, PathModification
from parcours.planners.ramp.planner import Planner
from parcours.planners.ramp.prediction import predict
from parcours.planners.ramp.route import HYBRID, ROUTE
from parcours.planners.ramp.sensing import Sensing
from parcours.planners.ramp.trajectory_evaluation import TrajectoryEvaluation
from parcours.planners.ramp.trajectory_generator import TrajectoryGenerator, generate
from parcours.run.port import Component, Step
from parcours.suite import Case

GOAL = (2.0, 2.0)
_SENSING, _PLANNING = Tag("sensing", 2), Tag("planning", 2)
"""The first conversations of a planner whose own first was the control cycle that prepared it."""

_N_OBSTACLES = 2
"""So many that p16 has something left to ask for (Table II)."""

_LONG_AFTER = 60_000_000_000


class ComponentTester:
    """Everything one component case needs from outside.

    Args:
        case: values motion [m/s], path [knots], trajectory [m], population [members], odometry [m].
        parameters: of RAMP, guarded by default; the population is the case's.
    """

    def __init__(self, case: Case, parameters: Parameters | None = None) -> None:
        base = parameters or guarded()
        self._case = case
        self._parameters = Parameters(
            schedule=base.schedule,
            population=int(case["population"]),
            plan_margin=base.plan_margin,
            guard_margin=base.guard_margin,
        )
        self._stream = np.random.default_rng([case.seed, case.number])
        self._begin = one(POSE)
        self._begin.heading, self._begin.v = 0.7853981633974483, min(case["motion"], self._parameters.v_max)

    def component(self, name: str) -> Component:
        """Return a fresh component of that name."""
        seed, number = self._case.seed, self._case.number
        makers = {
            "Planner": self._planner,
            "TrajectoryGenerator": partial(TrajectoryGenerator, self._parameters),
            "TrajectoryEvaluation": partial(TrajectoryEvaluation, self._parameters),
            "PathModification": partial(PathModification, self._parameters, seed, number),
            "Control": partial(Control, self._parameters),
            "Sensing": Sensing,
        }
        component: Component = makers[name]()  # type: ignore[operator]
        return component

    def _planner(self) -> Planner:
        """Return a planner after its first control cycle, as the authors prepare theirs for a test."""
        planner = Planner(self._parameters, self._case.seed, self._case.number, self._begin, GOAL)
        services: dict[str, TrajectoryGenerator | TrajectoryEvaluation] = {
            "trajectory_request": TrajectoryGenerator(self._parameters),
            "evaluation_request": TrajectoryEvaluation(self._parameters),
        }
        asked = [send for step in planner.control(0) for send in step.sends if send[0] in services]
        while asked:
            channel, request = asked.pop(0)
            answers = [send for step in services[channel].handle(channel, request, 0) for send in step.sends]
            for answer_channel, answer in answers:
                steps = planner.handle(answer_channel, answer, 0)
                asked += [send for step in steps for send in step.sends if send[0] in services]
        return planner

    def prompt(self, event: Event, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component to a transition that the model lets no message start.

        p17 and p19 follow the last answers, which Table II leaves out: the tester gives them.
        """
        if isinstance(component, Planner) and event.transition == "p11":
            return component.plan()
        if isinstance(component, Planner) and event.transition == "p12":
            return component.control(now)
        if isinstance(component, Planner) and event.transition == "p17":
            return component.handle("trajectory_response", self._trajectory_response(), now)
        if isinstance(component, Planner) and event.transition == "p19":
            return component.handle("evaluation_response", self._last_evaluation(), now)
        if isinstance(component, Control) and event.transition in ("p47", "p48"):
            return component.tick(0 if event.transition == "p47" else REPORT_PERIOD)
        if isinstance(component, Control) and event.transition in ("p43", "p44"):
            return component.execute(now + COMMAND_PERIOD)
        if isinstance(component, Control) and event.transition == "p46":
            return component.execute(now + _LONG_AFTER)
        return component.handle(None, None, now)

    def prepare(self, event: Event, component: Component) -> None:
        """Set what the model calls input variables: the robot's pose, and imminent collision before p43 and p44."""
        if not isinstance(component, Control):
            return
        for _ in component.handle("pose", Report(0, self._pose(event.reference)), 0):
            pass
        if event.transition in ("p43", "p44"):
            for _ in component.handle("imminent_collision", event.transition == "p43", 0):
                pass

    def supply(self, event: Event) -> object:
        """Return the message the environment gives to a receiving event."""
        assert event.receives is not None
        makers = {
            "odometry": self._obstacles,
            "obstacles": self._obstacles,
            "trajectory_request": self._trajectory_request,
            "trajectory_response": self._trajectory_response,
            "evaluation_request": self._evaluation_request,
            "evaluation_response": self._evaluation_response,
            "modification_request": self._modification_request,
            "best_trajectory": self._best_trajectory,
        }
        channel = event.receives.channel
        if channel not in makers:
            raise HostFailure(f"tester of {self._case.id}", f"no message is known for channel {channel!r}",
                              slug="no-supply")  # fmt: skip
        return makers[channel]()

    def _pose(self, reference: int) -> Record:
        """Return where the robot is for a reference: it has moved on since the one before."""
        pose = self._begin.copy()
        s, c = sin_cos(pose.heading)
        way = reference * (0.01 + 0.1 * pose.v)
        pose.x, pose.y = way * c, way * s
        return pose

    def _obstacles(self) -> Obstacles:
        states = many(OBSTACLE_STATE, _N_OBSTACLES)
        for k in range(_N_OBSTACLES):
            angle = self._stream.uniform(0.0, 0.5 * np.pi)
            s, c = sin_cos(angle)
            pose = states[k].pose
            pose.x, pose.y = self._case["odometry"] * c, self._case["odometry"] * s
            pose.heading, pose.v = angle - np.pi, self._case["motion"]
            pose.w = self._stream.uniform(-0.5 * np.pi, 0.5 * np.pi)
            states[k].radius = 0.1
        return Obstacles(0, states)

    def _path(self) -> Record:
        """Return a PATH of the case's number of knots and length, from the robot on, bending gently at random."""
        path, n = many(PATH, 1)[0], int(self._case["path"])
        path.n = n
        leg, heading = self._case["trajectory"] / (n - 1), float(self._begin.heading)
        for k in range(1, n):
            s, c = sin_cos(heading)
            path.x[k], path.y[k] = path.x[k - 1] + leg * c, path.y[k - 1] + leg * s
            heading += self._stream.uniform(-0.6, 0.6)
        return path

    def _trajectory(self) -> Record:
        trajectory = one(TRAJECTORY)
        generate(self._path(), self._begin, HYBRID, self._parameters.record(), one(ROUTE), trajectory)
        return trajectory

    def _predictions(self) -> Record:
        predictions = many(PREDICTION, 1)
        predict(self._obstacles().states[0], 0, predictions[0])
        return predictions

    def _trajectory_request(self) -> TrajectoryRequest:
        paths, starts = many(PATH, 1), many(POSE, 1)
        paths[0], starts[0] = self._path(), self._begin
        return TrajectoryRequest(_SENSING, paths, starts, np.array([HYBRID]))

    def _trajectory_response(self) -> TrajectoryResponse:
        return TrajectoryResponse(_SENSING, self._predictions())

    def _evaluation_request(self) -> EvaluationRequest:
        trajectories = many(TRAJECTORY, int(self._case["population"]))
        for k in range(len(trajectories)):
            trajectories[k] = self._trajectory()
        return EvaluationRequest(_SENSING, trajectories, self._predictions(), (0.0, 0.0), 0.0, False)

    def _evaluation_response(self) -> EvaluationResponse:
        n = int(self._case["population"])
        return EvaluationResponse(_SENSING, np.ones(n, np.int64), np.full(n, 0.1), np.full(n, 9999.0))

    def _last_evaluation(self) -> EvaluationResponse:
        return EvaluationResponse(_SENSING, np.ones(1, np.int64), np.full(1, 0.1), np.full(1, 9999.0))

    def _modification_request(self) -> ModificationRequest:
        modification = one(MODIFICATION)
        modification.first = self._path()
        modification.operator = INSERT if modification.first.n < 5 else CHANGE
        return ModificationRequest(_PLANNING, modification)

    def _best_trajectory(self) -> Record:
        return self._trajectory()
