"""Values of a component case -> the messages that its environment supplies, each real, drawn from a stream of its own.

Trajectories come from a Trajectory Generator of the tester's own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from parcours.abtc import Event
from parcours.elementary import sin_cos, wrap
from parcours.errors import HostFailure
from parcours.kernels import Record
from parcours.suite import Case
from parcours_ramp.components.components import GOAL
from parcours_ramp.planner import messages
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.path_modification import CROSSOVER, OPERATORS, applies
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.route import HOLONOMIC, HYBRID, ROUTE, TRANSITION
from parcours_ramp.planner.switching import switch_path
from parcours_ramp.planner.trajectory_generator import generate

FIRST = 2  # The number of the first conversation of a planner whose own first was the control cycle that prepared it

_BEFORE = 0.3  # How far before the path a switch leaves the present motion [m]
_N_OBSTACLES = 2  # Two, so that p16 has something left to ask for (Table II)


class Supply:
    """The messages for one event of a case.

    Args:
        case: values motion [m/s], path [knots], trajectory [m], population [members], odometry [m].
        event: what is drawn for it does not depend on when others draw.
        serial: number of the conversation that it belongs to.
    """

    def __init__(self, case: Case, parameters: Parameters, begin: Record, event: Event, serial: int = FIRST) -> None:
        self._sensing, self._planning = messages.Tag("sensing", serial), messages.Tag("planning", serial)
        self._case, self._parameters, self._begin = case, parameters, begin
        self._stream = np.random.default_rng([case.seed, case.number, event.position])

    def message(self, channel: str) -> object:
        """Return the message for a channel. Raises HostFailure if none is known."""
        makers: dict[str, Callable[[], object]] = {
            "odometry": self._obstacles,
            "obstacles": self._obstacles,
            "trajectory_request": self._trajectory_request,
            "trajectory_response": lambda: messages.TrajectoryResponse(self._sensing, self._predictions()),
            "evaluation_request": self._evaluation_request,
            "evaluation_response": lambda: self._evaluations(int(self._case["population"])),
            "modification_request": self._modification_request,
            "best_trajectory": self._trajectory,
        }
        if channel not in makers:
            raise HostFailure(f"tester of {self._case.id}", f"no message is known for channel {channel!r}",
                              slug="no-supply")  # fmt: skip
        return makers[channel]()

    def update(self) -> tuple[str, object]:
        """Return a report of the robot somewhat beside where it began, and late; one time in three it stands."""
        pose, draw = self._begin.copy(), self._stream.uniform
        pose.x, pose.y, pose.w = pose.x + draw(-0.02, 0.03), pose.y + draw(-0.02, 0.03), draw(-0.05, 0.05)
        pose.heading += draw(-0.1, 0.1)
        if self._stream.random() < 1.0 / 3.0:
            pose.v = pose.w = 0.0
        return "update", messages.StateReport(20_000_000, pose, int(draw(0.0, 5e6)))

    def beside(self, pose: Record) -> Record:
        """Return a POSE near one: off the plan, perhaps so far that it looks elsewhere, or turned once more."""
        draw = self._stream.uniform
        pose.x, pose.y = pose.x + draw(-0.03, 0.03), pose.y + draw(-0.03, 0.03)
        pose.heading += draw(-0.2, 0.2) if self._stream.random() < 0.75 else draw(0.3, 0.6)
        pose.heading += 2.0 * np.pi * self._stream.integers(-1, 2)
        return pose

    def limit(self) -> float:
        """Return a limit of speed [m/s]: none, one that slows the robot, or almost a stop."""
        return float(self._stream.choice([np.inf, 0.12, 0.02]))

    def planning_answers(self, serial: int) -> tuple[tuple[str, object], ...]:
        """Return the answers that end a planning cycle: modified paths, one or two, of each its way and fitness."""
        tag, paths = messages.Tag("planning", serial), messages.many(messages.PATH, int(self._stream.integers(1, 3)))
        answers: list[tuple[str, object]] = [("modification_response", messages.ModificationResponse(tag, paths))]
        for k in range(len(paths)):
            paths[k] = self._path()
            paths[k].x[paths[k].n - 1], paths[k].y[paths[k].n - 1] = GOAL
            ways = messages.many(messages.TRAJECTORY, 1)
            ways[0] = self._trajectory()
            answers.append(("trajectory_response", messages.TrajectoryResponse(tag, ways)))
            answers.append(("evaluation_response", self._evaluations(1)._replace(tag=tag)))
        return tuple(answers)

    def last_evaluation(self) -> messages.EvaluationResponse:
        """Return the answer that ends a sensing cycle: of the motion under way alone."""
        return self._evaluations(1)

    def control_answers(self, serial: int) -> tuple[tuple[str, object], ...]:
        """Return the answers that end a control cycle: the motion under way, the members' ways, the population."""
        tag, n = messages.Tag("control", serial), int(self._case["population"])
        ways = messages.many(messages.TRAJECTORY, n)
        for k in range(n):
            ways[k] = self._trajectory()
        return (
            ("evaluation_response", self._evaluations(1)._replace(tag=tag)),
            ("trajectory_response", messages.TrajectoryResponse(tag, ways)),
            ("evaluation_response", self._evaluations(n)._replace(tag=tag)),
        )

    def _evaluations(self, n: int) -> messages.EvaluationResponse:
        feasible = (self._stream.random(n) < 0.7).astype(np.int64)
        fitness = np.where(feasible == 1, self._stream.uniform(0.02, 0.3, n), self._stream.uniform(1e-5, 1e-3, n))
        met = self._stream.uniform(0.1, 3.0, n)
        return messages.EvaluationResponse(self._sensing, feasible, fitness, np.where(feasible == 1, 9999.0, met))

    def _obstacles(self) -> messages.Obstacles:
        """Return one obstacle ahead that drives towards the robot, straight or in a bend, and one that stands.

        That one is ahead, beside, behind, or close to the shoulder, and looks at the robot half of the time.
        """
        states, draw = messages.many(messages.OBSTACLE_STATE, _N_OBSTACLES), self._stream.uniform
        for k, state in enumerate(states):
            pose, bearing = state.pose, draw(-0.7 * np.pi, 0.7 * np.pi) if k else draw(-0.25 * np.pi, 0.25 * np.pi)
            if k and self._stream.random() < 1.0 / 3.0:
                bearing = self._stream.choice([-1.0, 1.0]) * draw(0.5 * np.pi, 0.55 * np.pi)
            angle = float(self._begin.heading) + bearing
            s, c = sin_cos(angle)
            pose.x, pose.y = self._case["odometry"] * c, self._case["odometry"] * s
            pose.heading = angle - np.pi + (draw(-2.0, 2.0) if k and self._stream.random() < 0.5 else 0.0)
            state.radius = 0.1
            if not k:
                pose.v, pose.w = self._case["motion"], draw(-0.5 * np.pi, 0.5 * np.pi)
                if self._stream.random() < 1.0 / 3.0:
                    pose.w = 0.0
        return messages.Obstacles(
            -int(draw(0.0, 5e7)), states
        )  # sensed before the case: no control cycle is due before

    def _path(self, turned: float = 0.0) -> Record:
        """Return a PATH of the case's knots and length, from the robot on, turned [rad], bending gently at random."""
        path, n = messages.many(messages.PATH, 1)[0], int(self._case["path"])
        path.n = n
        leg, heading = self._case["trajectory"] / (n - 1), float(self._begin.heading) + turned
        for k in range(1, n):
            s, c = sin_cos(heading)
            path.x[k], path.y[k] = path.x[k - 1] + leg * c, path.y[k - 1] + leg * s
            heading += self._stream.uniform(-0.6, 0.6)
        return path

    def _trajectory(self) -> Record:
        trajectory = messages.one(messages.TRAJECTORY)
        generate(self._path(), self._begin, HYBRID, self._parameters.record(), messages.one(ROUTE), trajectory)
        return trajectory

    def _predictions(self, n: int = 1, ago: float = 0.0) -> Record:
        """Return predictions of the first n obstacles, as they were sensed some time ago [s]."""
        predictions, states = messages.many(messages.PREDICTION, n), self._obstacles().states
        for k in range(n):
            predict(states[k], -round(1e9 * ago), predictions[k])
        return predictions

    def _trajectory_request(self) -> messages.TrajectoryRequest:
        """Ask for the robot's ways as the planning and control cycles do, of each kind: Table II leaves them out.

        All lead the same way, anywhere. A switch leaves a motion before the path begins; what stops and rotates starts
        at rest, or moves and looks aside, as the last hybrid way does.
        """
        kinds, turned = (
            np.array([HYBRID, HOLONOMIC, TRANSITION, HYBRID, HOLONOMIC]),
            self._stream.uniform(-np.pi, np.pi),
        )
        n, path, begin = len(kinds), self._path(turned), self._begin.copy()
        paths, starts = messages.many(messages.PATH, n), messages.many(messages.POSE, n)
        begin.heading = wrap(begin.heading + turned)
        for k in range(n):
            starts[k] = begin
            if k == 1:
                starts[k].v = 0.0
            elif kinds[k] == TRANSITION:
                s, c = sin_cos(begin.heading)
                starts[k].x, starts[k].y = begin.x - _BEFORE * c, begin.y - _BEFORE * s
            elif k > 1:
                starts[k].heading = wrap(begin.heading + self._stream.uniform(-0.6, 0.6))
            switch_path(path, starts[k], kinds[k], paths[k])
        return messages.TrajectoryRequest(self._sensing, paths, starts, kinds)

    def _evaluation_request(self) -> messages.EvaluationRequest:
        """Ask how fit ways are beside all obstacles, sensed a while ago, for a robot off its plan, perhaps halted.

        One time in four only when the motion under way meets them is asked, from some sample on.
        """
        trajectories, draw = messages.many(messages.TRAJECTORY, int(self._case["population"])), self._stream.uniform
        for k in range(len(trajectories)):
            trajectories[k] = self._trajectory()
        predictions = self._predictions(_N_OBSTACLES, ago=draw(0.0, 0.1))
        drift, turned = (draw(-0.03, 0.03), draw(-0.03, 0.03)), draw(-0.2, 0.2)
        if self._stream.random() < 1.0 / 3.0:
            turned = draw(-np.pi, np.pi)
        heading, halted = wrap(float(self._begin.heading) + turned), bool(self._stream.random() < 0.25)
        window = None
        if self._stream.random() < 0.25:
            first, ahead = int(self._stream.integers(0, 6)), round(self._parameters.guard_horizon / messages.SAMPLE) + 1
            leaves = bool(self._stream.random() < 0.5)
            trajectories.feasible, trajectories.fitness = 1, draw(0.02, 0.3)  # it has been looked at before
            trajectories, window = trajectories[:1], (0, first, first + ahead, self._parameters.guard_margin, leaves)
        return messages.EvaluationRequest(self._sensing, trajectories, predictions, drift, heading, halted, window)

    def _modification_request(self) -> messages.ModificationRequest:
        """Ask for an operator that changes a path of that many knots, begun somewhere, near an obstacle somewhere."""
        modification, path = messages.one(messages.MODIFICATION), self._path()
        path.x[: path.n] += self._stream.uniform(0.0, self._parameters.arena)
        path.y[: path.n] += self._stream.uniform(0.0, self._parameters.arena)
        modification.first = path
        applicable = [k for k in range(len(OPERATORS)) if applies(k, int(path.n))]
        modification.operator = self._stream.choice(applicable)
        if modification.operator == CROSSOVER:
            modification.second = self._path()
        modification.direction, modification.distance = self._stream.uniform(-np.pi, np.pi), self._case["odometry"]
        return messages.ModificationRequest(self._planning, modification)
