"""Planner: the component that keeps the population and runs the planning, sensing and control cycles (component 1).

It talks with the services in conversations, one at a time, as the published planner does with blocking calls: what
arrives meanwhile waits. What the paper's model does not name (the answers inside a planning or control cycle) are steps
without a transition. The one wait that a control cycle may cut short is for Path Modification, which leaves nothing
half done.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from parcours.kernels import Record, kernel
from parcours.streams import start
from parcours_ramp.planner import messages
from parcours_ramp.planner.control_cycle import adapt, commit, entry_kind, is_at_rest
from parcours_ramp.planner.guard import (
    GUARD_PERIOD,
    evaluate_moving_on,
    is_imminent,
    note_moving_on,
    speed_limit,
    take_report,
    window,
)
from parcours_ramp.planner.parameters import ORIGINAL, Parameters
from parcours_ramp.planner.planner_state import PLANNER, begin_population
from parcours_ramp.planner.planning_cycle import (
    choose_modification,
    compensate,
    is_known,
    offer_candidate,
    set_candidate,
)
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.sensing_cycle import evaluate_population, evaluates_population, note_nearest
from parcours_ramp.planner.switching import switch_path, take_up
from parcours_ramp.planner.trajectory import copy_trajectory

PLANNER_STREAM = np.uint64(1)  # Purpose of the random stream of this component

_GUARDED = "guarded"
"""The channel of an obstacle list that waits behind a control cycle, and that the guard has seen already."""

Message = messages.TrajectoryResponse | messages.EvaluationResponse | messages.ModificationResponse


class Planner:
    """The component.

    Args:
        begin: POSE the robot begins in; it may move already.
        goal: (x, y) [m].
    """

    name = "Planner"

    def __init__(self, parameters: Parameters, seed: int, case: int, begin: Record, goal: tuple[float, float]) -> None:
        self._parameters = parameters.record()
        self._is_original = bool(self._parameters.schedule == ORIGINAL)
        self._origin = (np.uint64(seed), np.uint64(case), PLANNER_STREAM)
        self._begin, self._goal = begin.copy(), goal
        self._period = int(1e9 / parameters.planning_rate)
        self.reset()

    def reset(self) -> None:
        """Start again: a fresh population, no obstacles known, nothing under way."""
        planner = messages.one(PLANNER)
        planner.goal_x, planner.goal_y = self._goal
        start(planner.stream, *self._origin)
        begin_population(planner, self._begin, self._parameters)
        planner.followed = planner.members[0].id
        evaluate_population(planner, messages.many(messages.PREDICTION, 0), self._parameters)
        self._planner = planner
        # Views of its parts, since to reach them takes longer than most kernels run.
        self._members = [planner.members[i] for i in range(messages.MAX_POPULATION)]
        self._switch = planner.switch
        self._candidate_trajectory, self._candidate_path = planner.candidate.trajectory, planner.candidate.path
        self._moving_on, self._request, self._latest = planner.moving_on, planner.request, planner.latest
        self._predictions = messages.many(messages.PREDICTION, 0)
        self._serial = 0
        self._conversation: messages.Tag | None = None
        self._waiting: deque[tuple[str, object]] = deque()
        self._next_planning = 0
        self._next_guard = GUARD_PERIOD
        self._t_halted = -1
        self._limit = np.inf
        self._reported = False
        self._obstacles = messages.Obstacles(0, messages.many(messages.POSE, 0))
        self._to_predict: list[int] = []
        self._to_try: list[Record] = []
        self._asked_population = False
        self._best = 0
        self._asked_members: list[int] = []

    @property
    def state(self) -> Record:
        """Its PLANNER."""
        return self._planner

    def next_wake(self) -> int | None:
        """The next planning cycle or check; control cycles wait for one. Never while a conversation is open."""
        if self._conversation is not None:
            return None
        return min(self._next_planning, self._next_guard) if self._is_original else self._next_planning

    def wake(self, now: int) -> Iterator[messages.PlannerStep]:
        """Run what is due: a control cycle first, then the published check, then a planning cycle."""
        if self._conversation is not None and self._conversation.cycle != "planning":
            return
        if self._planner.t_next <= now:
            yield from self.control(now)
        elif self._is_original and self._next_guard <= now:
            self._next_guard += GUARD_PERIOD
            self._planner.halted = 1 if is_imminent(self._planner, now, self._parameters) else 0
            yield messages.PlannerStep("", (("imminent_collision", bool(self._planner.halted)),))
        elif self._next_planning <= now:
            yield from self.plan()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[messages.PlannerStep]:
        """Take up an obstacle list, a report, or the answer of a service."""
        if channel is None:
            yield messages.reporting("p14", tcp_socket=False)
        elif isinstance(
            message, messages.TrajectoryResponse | messages.EvaluationResponse | messages.ModificationResponse
        ):
            if message.tag == self._conversation:
                yield from self._go_on(message, now)
                while self._conversation is None and self._waiting:
                    yield from self._take(*self._waiting.popleft(), now)
        elif self._conversation is not None:
            self._waiting.append((channel, message))
        else:
            yield from self._take(channel, message, now)

    def _take(self, channel: str, message: object, now: int) -> Iterator[messages.PlannerStep]:
        if isinstance(message, messages.StateReport):
            take_report(self._planner, message.pose, message.stamp, message.lag)
            self._reported = True
            self._hasten_if_at_rest()
        elif isinstance(message, messages.Obstacles):
            if not self._is_original and channel != _GUARDED:
                yield from self._guard(message, now)
                if self._planner.t_next < message.stamp:  # it was due before these obstacles came
                    self._waiting.appendleft((_GUARDED, message))
                    yield from self.control(now)
                    return
            yield from self._begin_sensing(message)

    def _hasten_if_at_rest(self) -> None:
        """Let the next control cycle come at once if the robot has come to rest, halted, since the last one."""
        planner = self._planner
        if self._is_original or not planner.halted or self._t_halted < planner.t_control:
            return
        if is_at_rest(planner):
            planner.t_next = min(int(planner.t_next), self._next_planning)

    def _go_on(self, message: Message, now: int) -> Iterator[messages.PlannerStep]:
        cycle = message.tag.cycle
        if cycle == "sensing":
            yield from self._sense_on(message, now)
        elif cycle == "planning":
            yield from self._plan_on(message)
        else:
            yield from self._control_on(message, now)

    def _open(self, cycle: str) -> messages.Tag:
        self._serial += 1
        self._conversation = messages.Tag(cycle, self._serial)  # type: ignore[arg-type]
        return self._conversation

    def _evaluation(self, trajectories: Record) -> tuple[str, object]:
        planner = self._planner
        drift = (float(planner.drift_x), float(planner.drift_y))
        assert self._conversation is not None
        request = messages.EvaluationRequest(
            self._conversation, trajectories, self._predictions, drift, float(self._latest.heading),
            bool(planner.halted),
        )  # fmt: skip
        return "evaluation_request", request

    def _evaluation_of_moving_on(self, now: int) -> tuple[str, object]:
        moving_on = messages.many(messages.TRAJECTORY, 1)
        copy_trajectory(moving_on[0], self._moving_on, 0)
        channel, request = self._evaluation(moving_on)
        assert isinstance(request, messages.EvaluationRequest)
        return channel, request._replace(window=window(self._planner, now, self._parameters))

    def _population(self) -> Record:
        trajectories = messages.many(messages.TRAJECTORY, int(self._planner.n))
        _copy_members(self._planner, trajectories)
        return trajectories

    def _note_population(self, response: messages.EvaluationResponse) -> None:
        if len(response.feasible) != self._planner.n:  # what is compiled checks no bounds
            raise ValueError(f"{len(response.feasible)} evaluations of {self._planner.n} trajectories")
        _note_members(self._planner, response.feasible, response.fitness, response.t_collision)

    # Sensing cycle, p15 .. p19. p16 and p18 are answers with more left to ask; the last ones lead to p17 and p19.

    def _begin_sensing(self, obstacles: messages.Obstacles) -> Iterator[messages.PlannerStep]:
        self._obstacles = obstacles
        self._to_predict = list(range(len(obstacles.states)))
        self._predictions = messages.many(messages.PREDICTION, len(obstacles.states))
        tag = self._open("sensing")
        yield messages.reporting("p15", *self._prediction_request(tag), tcp_socket=True)

    def _guard(self, obstacles: messages.Obstacles, now: int) -> Iterator[messages.PlannerStep]:
        """Run the guard as the task of its own that it is, before anything else: limit the speed, and perhaps halt."""
        limit = float(speed_limit(self._planner, obstacles.states, self._parameters))
        if limit != self._limit:
            self._limit = limit
            yield messages.PlannerStep("", (("speed_limit", limit),))
        if not self._planner.halted and self._sees_imminent_collision(obstacles, now):
            yield messages.PlannerStep("", (("imminent_collision", True),))
        if self._reported:
            self._reported = False
            self._hasten_if_at_rest()

    def _sees_imminent_collision(self, obstacles: messages.Obstacles, now: int) -> bool:
        """Look at the motion under way with fresh predictions."""
        planner = self._planner
        fresh = messages.many(messages.PREDICTION, len(obstacles.states))
        for k in range(len(fresh)):
            predict(obstacles.states[k], obstacles.stamp, fresh[k])
        planner.knows_obstacles = 1
        compensate(planner, self._parameters)
        evaluate_moving_on(planner, fresh, now, planner.epoch, self._parameters)
        if not is_imminent(planner, now, self._parameters):
            return False
        planner.halted = 1
        self._t_halted = now
        return True

    def _prediction_request(self, tag: messages.Tag) -> tuple[tuple[str, object], ...]:
        if not self._to_predict:
            return ()
        k = self._to_predict[0]
        only = messages.Obstacles(self._obstacles.stamp, self._obstacles.states[k : k + 1])
        return (("trajectory_request", messages.TrajectoryRequest(tag, obstacles=only)),)

    def _sense_on(self, message: Message, now: int) -> Iterator[messages.PlannerStep]:
        planner = self._planner
        if isinstance(message, messages.TrajectoryResponse):
            self._predictions[self._to_predict.pop(0)] = message.trajectories[0]
            if self._to_predict:
                yield messages.reporting("p16", *self._prediction_request(message.tag), is_empty=False)
                return
            note_nearest(planner, self._obstacles.states)
            self._asked_population = evaluates_population(planner, now)
            asked = (
                self._evaluation(self._population()) if self._asked_population else self._evaluation_of_moving_on(now)
            )
            yield messages.reporting("p17", asked)
        elif isinstance(message, messages.EvaluationResponse):
            if not self._asked_population:
                note_moving_on(planner, float(message.t_collision[0]))
            else:
                self._note_population(message)
                self._asked_population = False
                if self._moving_on.n > 0:
                    yield messages.reporting("p18", self._evaluation_of_moving_on(now), is_empty=False)
                    return
            self._conversation = None
            yield messages.reporting("p19", is_empty=True)

    # Planning cycle: p11, then answers that the model does not name.

    def plan(self) -> Iterator[messages.PlannerStep]:
        """Begin a planning cycle."""
        self._next_planning += self._period
        compensate(self._planner, self._parameters)
        choose_modification(self._planner)
        request = messages.ModificationRequest(self._open("planning"), self._request.copy())
        yield messages.reporting("p11", ("modification_request", request))

    def _plan_on(self, message: Message) -> Iterator[messages.PlannerStep]:
        planner = self._planner
        if isinstance(message, messages.ModificationResponse):
            self._to_try = [message.paths[k] for k in range(len(message.paths))]
        elif isinstance(message, messages.TrajectoryResponse):
            copy_trajectory(self._candidate_trajectory, message.trajectories[0], 0)
            take_up(planner, self._candidate_trajectory, planner.switch_kind)
            trajectories = messages.many(messages.TRAJECTORY, 1)
            copy_trajectory(trajectories[0], self._candidate_trajectory, 0)
            yield messages.PlannerStep("", (self._evaluation(trajectories),))
            return
        else:
            _note(self._candidate_trajectory, message, 0)
            if not is_known(planner):
                offer_candidate(planner, messages.many(messages.PREDICTION, 0), self._parameters)
        if not self._to_try:
            self._conversation = None
            return
        set_candidate(planner, self._to_try.pop(0))
        request = self._way_request(message.tag, [(self._candidate_path, int(planner.switch_kind))])
        yield messages.PlannerStep("", (("trajectory_request", request),))

    def _way_request(self, tag: messages.Tag, ways: list[tuple[Record, int]]) -> messages.TrajectoryRequest:
        paths, starts, kinds = (
            messages.many(messages.PATH, len(ways)), messages.many(messages.POSE, len(ways)),
            np.zeros(len(ways), np.int64),
        )  # fmt: skip
        for k, (path, kind) in enumerate(ways):
            switch_path(path, self._switch, kind, paths[k])
            starts[k], kinds[k] = self._switch, kind
        return messages.TrajectoryRequest(tag, paths, starts, kinds)

    # Control cycle: p12 and p13, then the adaptation of the population.

    def control(self, now: int) -> Iterator[messages.PlannerStep]:
        """Run a control cycle at `now` [ns], as far as it needs no answer."""
        self._best = commit(self._planner, now, self._parameters)
        best = messages.one(messages.TRAJECTORY)
        copy_trajectory(best, self._moving_on, 0)
        self._open("control")
        self._asked_members = []
        yield messages.reporting("p12", ("best_trajectory", best), operation="update")
        yield messages.reporting("p13")
        yield messages.PlannerStep("", (self._evaluation_of_moving_on(now),))

    def _control_on(self, message: Message, now: int) -> Iterator[messages.PlannerStep]:
        planner = self._planner
        if isinstance(message, messages.TrajectoryResponse):
            for k, i in enumerate(self._asked_members):
                member = self._members[i]
                copy_trajectory(member.trajectory, message.trajectories[k], 0)
                take_up(planner, member.trajectory, entry_kind(planner, i, self._best))
                member.trajectory.id = member.id
            self._asked_population = True
            yield messages.PlannerStep("", (self._evaluation(self._population()),))
        elif self._asked_population and isinstance(message, messages.EvaluationResponse):
            self._asked_population = False
            self._note_population(message)
            self._conversation = None
        elif isinstance(message, messages.EvaluationResponse):
            note_moving_on(planner, float(message.t_collision[0]))
            yield from self._adapt(message.tag, now)

    def _adapt(self, tag: messages.Tag, now: int) -> Iterator[messages.PlannerStep]:
        """Decide on the halt and ask for the members' new trajectories."""
        planner, parameters = self._planner, self._parameters
        was_halted = bool(planner.halted)
        adapted, kept = adapt(planner, self._best, now, parameters)
        sends: list[tuple[str, object]] = []
        if was_halted != bool(planner.halted) or (parameters.schedule == ORIGINAL and not planner.halted):
            sends.append(("imminent_collision", bool(planner.halted)))
        self._asked_members = [i for i in range(planner.n) if adapted and i != kept]
        if self._asked_members:
            ways = [(self._members[i].path, entry_kind(planner, i, self._best)) for i in self._asked_members]
            sends.append(("trajectory_request", self._way_request(tag, ways)))
        else:
            self._asked_population = True
            sends.append(self._evaluation(self._population()))
        yield messages.PlannerStep("", tuple(sends))


def _note(trajectory: Record, response: messages.EvaluationResponse, k: int) -> None:
    """Write the k-th evaluation of the response into the trajectory."""
    trajectory["feasible"] = response.feasible[k]
    trajectory["fitness"] = response.fitness[k]
    trajectory["t_collision"] = response.t_collision[k]


@kernel
def _copy_members(planner: Record, trajectories: Record) -> None:
    """Copy the population's trajectories."""
    for i in range(planner.n):
        copy_trajectory(trajectories[i], planner.members[i].trajectory, 0)


@kernel
def _note_members(planner: Record, feasible: Record, fitness: Record, t_collision: Record) -> None:
    """Write the evaluations into the population's trajectories."""
    for i in range(planner.n):
        trajectory = planner.members[i].trajectory
        trajectory.feasible, trajectory.fitness, trajectory.t_collision = feasible[i], fitness[i], t_collision[i]
