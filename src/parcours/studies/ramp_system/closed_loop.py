"""One system case, compiled: world, sensing, the whole of RAMP and control in one event loop over integer nanoseconds.

The planner has one thread: a planning cycle, a sleep to the next 1/20 s, then every callback that was pending when it
woke, in order of arrival. Whatever the thread computes takes effect at once and blocks the thread for a drawn time.
Under the guarded schedule the imminent-collision check runs beside the thread, on every obstacle message.

Simultaneous events are taken in this order: world, robot report, obstacle message, guard, planner thread, messages to
control, command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.arena.obstacles import motion_at, place_at
from parcours.arena.world import NEVER, advance, begin
from parcours.kernels import Record, kernel
from parcours.planners.ramp.control import COMMAND_PERIOD, REPORT_PERIOD, command, follow, signal
from parcours.planners.ramp.control_cycle import control_cycle, is_at_rest
from parcours.planners.ramp.guard import (
    GUARD_PERIOD,
    evaluate_moving_on,
    is_imminent,
    is_known_to_pass,
    speed_limit,
    take_report,
)
from parcours.planners.ramp.latency import draw
from parcours.planners.ramp.parameters import GUARDED, ORIGINAL
from parcours.planners.ramp.planner_state import begin_population
from parcours.planners.ramp.planning_cycle import compensate, planning_cycle
from parcours.planners.ramp.prediction import predict
from parcours.planners.ramp.sensing_cycle import changes_of, evaluate_population, sensing_cycle
from parcours.streams import start
from parcours.studies.ramp_system.facts import TRANSITIONS
from parcours.studies.ramp_system.mailbox import FAR, clear, post, take
from parcours.verdict.measures.kernel import measure
from parcours.verdict.measures.one_case import SAFE_DISTANCE

Floats = NDArray[np.float64]

SENSING_PERIOD = 50_000_000
"""Time between two obstacle messages [ns] (20 Hz)."""

_INDEX = {name: i for i, name in enumerate(TRANSITIONS)}
_P11, _P12, _P13, _, _P15, _P16, _P17, _P18, _P19 = (_INDEX[f"p1{k}"] for k in range(1, 10))
_P21, _P31, _P41, _P42, _P43, _P44, _P45, _P46 = (
    _INDEX[n] for n in ("p21", "p31", "p41", "p42", "p43", "p44", "p45", "p46")
)
_P47, _P48, _P49, _P51, _P61 = (_INDEX[n] for n in ("p47", "p48", "p49", "p51", "p61"))


@kernel
def _sense(obstacles: Record, stamp: int, seen: Record) -> None:
    """Fill the obstacle message: where every obstacle was at `stamp` [ns] and how it moved."""
    for k in range(len(obstacles)):
        pose, obstacle = seen[k].pose, obstacles[k]
        if obstacle.now == stamp:  # the world has brought it there
            pose.x, pose.y, pose.heading = obstacle.x, obstacle.y, obstacle.heading
            pose.v, pose.w = obstacle.v, obstacle.w
        else:
            pose.x, pose.y = place_at(obstacle, stamp)
            pose.heading, pose.v, pose.w = motion_at(obstacle, stamp)
        seen[k].radius = obstacle.radius


@kernel
def _measure(robot: Record, pose: Record) -> None:
    """Set the POSE to where the ROBOT is and how it moves."""
    pose.x, pose.y, pose.heading, pose.v, pose.w = robot.x, robot.y, robot.heading, robot.v, robot.w


@kernel
def _count_service(counts: Record, first: int, times: int) -> None:
    """Count request, computation, response and return of a service whose idle transition is `first`."""
    for k in range(1, 5):
        counts[first + k] += times


@kernel
def _send_halt(work: Record, due: int) -> None:
    """Send the imminent-collision flag to control."""
    post(work.halts, due, float(work.planner.halted))


@kernel
def _control(work: Record, predictions: Record, now: int, parameters: Record, latencies: Record, facts: Record) -> None:
    """Run a control cycle of the planner's thread and publish what it decided."""
    planner = work.planner
    was_halted = planner.halted
    generated = control_cycle(planner, predictions, now, parameters)
    facts.transitions[_P12] += 1
    facts.transitions[_P13] += 1
    _count_service(facts.transitions, _P21, 1 if generated else 0)
    _count_service(facts.transitions, _P31, 2)
    facts.n_control_cycles += 1
    work.best_due = now + latencies.transport
    if was_halted != planner.halted or (parameters.schedule == ORIGINAL and not planner.halted):
        _send_halt(work, now + latencies.transport + latencies.added_stop)
    work.wakes = now + draw(work.clock, latencies.control, latencies.control_spread) + latencies.added_planning


@kernel
def _callback(
    work: Record,
    seen: Record,
    predictions: Record,
    now: int,
    parameters: Record,
    latencies: Record,
    facts: Record,
) -> bool:
    """Run the callback of the planner's thread that was pending longest; return False if none is left."""
    planner = work.planner
    control_time = planner.t_next
    first = min(min(work.report_time, work.obstacle_time), min(control_time, work.guard_time))
    if first > work.spin:
        return False
    if work.report_time == first:
        work.report_time = FAR
        take_report(planner, work.report, first, work.report_lag)
        if (
            parameters.schedule == GUARDED
            and planner.halted
            and work.t_halted >= planner.t_control
            and is_at_rest(planner)
        ):
            planner.t_next = min(planner.t_next, work.spin)
    elif work.obstacle_time == first:
        work.obstacle_time = FAR
        evaluated = sensing_cycle(planner, seen, work.obstacle_stamp, now, predictions, parameters)
        n = len(seen)
        facts.transitions[_P15] += 1
        facts.transitions[_P16] += n - 1
        facts.transitions[_P17] += 1
        facts.transitions[_P18] += 1 if evaluated else 0
        facts.transitions[_P19] += 1
        _count_service(facts.transitions, _P21, n)
        _count_service(facts.transitions, _P31, 2 if evaluated else 1)
        work.wakes = now + draw(work.clock, latencies.sensing, latencies.sensing_spread)
    elif control_time == first:
        _control(work, predictions[: len(seen) * planner.knows_obstacles], now, parameters, latencies, facts)
    else:
        work.guard_time = max(first + GUARD_PERIOD, now - now % GUARD_PERIOD + GUARD_PERIOD)
        planner.halted = 1 if is_imminent(planner, now, parameters) else 0
        _send_halt(work, now + latencies.transport + latencies.added_stop)
    return True


@kernel
def _guard(
    work: Record,
    seen: Record,
    predictions: Record,
    guarded: Record,
    now: int,
    parameters: Record,
    latencies: Record,
) -> None:
    """Run the guard as a task of its own on the obstacles just seen; it can only halt, or limit the speed."""
    planner = work.planner
    take_report(planner, work.report, work.t_report, work.report_lag)
    limit = speed_limit(planner, seen, parameters)
    changes, halts = limit != work.limit, False
    work.limit = limit
    if not planner.halted:
        stamp = work.obstacle_stamp
        changed = planner.changed + changes_of(planner, predictions, seen, stamp)
        planner.knows_obstacles = 1
        compensate(planner, parameters)
        if not is_known_to_pass(planner, now, changed, parameters):
            for k in range(len(seen)):
                predict(seen[k], stamp, guarded[k])
        evaluate_moving_on(planner, guarded, now, changed, parameters)
        halts = is_imminent(planner, now, parameters)
    if not changes and not halts:
        return
    acts = now + draw(work.clock, latencies.guard, latencies.guard_spread) + latencies.transport + latencies.added_stop
    if changes:
        post(work.limits, acts, limit)
    if halts:
        planner.halted = 1
        work.t_halted = now
        _send_halt(work, acts)


@kernel
def _think(
    work: Record,
    seen: Record,
    predictions: Record,
    now: int,
    parameters: Record,
    latencies: Record,
    facts: Record,
) -> None:
    """Let the planner's thread do its next piece of work."""
    planner = work.planner
    if work.in_callbacks == 0:
        known = len(seen) * planner.knows_obstacles
        n = planning_cycle(planner, predictions[:known], parameters, work.modifier, work.one, work.two)
        facts.n_planning_cycles += 1
        facts.transitions[_P11] += 1
        _count_service(facts.transitions, _P51, 1)
        _count_service(facts.transitions, _P21, n)
        _count_service(facts.transitions, _P31, n)
        busy = draw(work.clock, latencies.planning, latencies.planning_spread) + latencies.added_planning
        period = int(1e9 / parameters.planning_rate)
        if busy > period:
            facts.n_late_cycles += 1
        work.wakes = now + max(busy, period)
        work.spin = work.wakes
        work.in_callbacks = 1
        return
    if not _callback(work, seen, predictions, now, parameters, latencies, facts):
        work.in_callbacks = 0


@kernel
def _watch(work: Record, now: int, facts: Record) -> None:
    """Keep what the robot and its controller do between two commands."""
    control, robot = work.control, work.world.robot
    if control.halt and not work.halted_before:
        facts.n_halts += 1
    work.halted_before = control.halt
    if control.halt:
        facts.halted_time += COMMAND_PERIOD
    if robot.v * robot.v > 1e-4:
        work.t_moving = now


@kernel
def _execute(work: Record, now: int, parameters: Record, facts: Record) -> None:
    """Let control command the robot."""
    control, robot = work.control, work.world.robot
    was_paused = control.paused
    _measure(robot, work.measured)
    command(control, work.measured, now, parameters)
    robot.command_v, robot.command_w = control.command_v, control.command_w
    counts = facts.transitions
    counts[_P47] += 1
    if control.paused and work.executing:
        work.executing = 0
        counts[_P43] += 1
    elif was_paused and not control.paused and not work.executing:
        work.executing = 1
        counts[_P44] += 1
        counts[_P45] += 1
    elif work.executing and (now - control.begins) * 1e-9 >= control.trajectory.duration:
        work.executing = 0
        counts[_P46] += 1
    elif not work.executing:
        counts[_P41] += 1


@kernel
def _goal_gap(world: Record, obstacles: Record) -> float:
    """Return the clearance [m] that a robot on the goal would have once all obstacles rest."""
    gap = np.inf
    for k in range(len(obstacles)):
        x, y = place_at(obstacles[k], obstacles[k].stop)
        distance = np.sqrt((x - world.goal_x) ** 2 + (y - world.goal_y) ** 2)
        gap = min(gap, distance - obstacles[k].radius - world.robot.radius)
    return gap


@kernel
def _freeze(work: Record, obstacles: Record, now: int, facts: Record) -> None:
    """Write down how the case stands at its end."""
    world, planner, control = work.world, work.planner, work.control
    robot = world.robot
    facts.t_end = now
    facts.x, facts.y, facts.heading = robot.x, robot.y, robot.heading
    facts.to_goal = np.sqrt((world.goal_x - robot.x) ** 2 + (world.goal_y - robot.y) ** 2)
    facts.t_goal = world.t_goal
    facts.feasible = planner.moving_on.feasible
    facts.time_left = planner.moving_on.duration
    facts.halted = control.halt
    facts.t_contact = world.t_contact
    facts.t_robot_contact, facts.t_shared_contact = world.t_robot_contact, world.t_shared_contact
    facts.n_robot_contacts, facts.n_shared_contacts = world.n_robot_contacts, world.n_shared_contacts
    facts.n_obstacle_contacts = world.n_obstacle_contacts
    facts.min_clearance, facts.t_min_clearance = world.min_clearance, world.t_min_clearance
    facts.travelled = world.travelled
    facts.n_switches = planner.n_switches
    facts.t_last_moving = work.t_moving
    facts.goal_gap = _goal_gap(world, obstacles)


@kernel
def run_case(
    number: int,
    obstacles: Record,
    setting: Record,
    parameters: Record,
    latencies: Record,
    work: Record,
    seen: Record,
    predictions: Record,
    guarded: Record,
    facts: Record,
    track: Record,
    places: Floats,
    radii: Floats,
) -> None:
    """Run one case from its number alone and fill its FACTS.

    Args:
        number: case number; seeds its random streams together with `setting.seed`.
        obstacles: array of OBSTACLE with the case's data; shape (n_obstacles,).
        setting: SETTING.
        parameters: PARAMETERS.
        latencies: LATENCIES.
        work: WORKSPACE.
        seen: array of OBSTACLE_STATE, working memory; shape (n_obstacles,).
        predictions: array of PREDICTION, working memory; shape (n_obstacles,).
        guarded: array of PREDICTION, working memory of the guard; shape (n_obstacles,).
        facts: FACTS.
        track: array of TRACK that receives one entry a command until it is full; shape (n,).
        places: receives where the obstacles were at these entries [m]; shape (n, n_obstacles, 2).
        radii: receives the obstacles' radii [m]; shape (n_obstacles,).
    """
    world, planner, control = work.world, work.planner, work.control
    robot = world.robot
    seed, case = setting.seed, np.uint64(number)
    start(planner.stream, seed, case, np.uint64(1))
    start(work.modifier, seed, case, np.uint64(2))
    start(work.clock, seed, case, np.uint64(3))
    robot.x, robot.y, robot.heading = setting.robot_x, setting.robot_y, setting.robot_heading
    robot.v, robot.w = setting.robot_speed, 0.0
    robot.command_v, robot.command_w = setting.robot_speed, 0.0
    robot.v_max, robot.w_max = parameters.v_max, parameters.w_max
    robot.a_max, robot.alpha_max = parameters.a_max, parameters.alpha_max
    robot.radius = parameters.robot_radius
    world.goal_x, world.goal_y, world.goal_tolerance = setting.goal_x, setting.goal_y, setting.goal_tolerance
    begin(world, obstacles)
    planner.goal_x, planner.goal_y = setting.goal_x, setting.goal_y
    _measure(robot, work.report)
    work.report_lag = work.t_report = 0
    work.start = work.report
    begin_population(planner, work.start, parameters)
    planner.followed = planner.members[0].id
    evaluate_population(planner, predictions[:0], parameters)
    control.has = control.halt = control.paused = 0
    control.t_halt = control.begins = control.lag = 0
    control.limit = np.inf
    control.trajectory.duration = 0.0

    for k in range(len(facts.transitions)):
        facts.transitions[k] = 0
    facts.number = number
    facts.n_halts = facts.halted_time = 0
    facts.n_planning_cycles = facts.n_control_cycles = facts.n_late_cycles = 0
    work.halted_before = work.executing = work.t_moving = 0
    facts.t_goal_after = NEVER
    facts.moved_after = 0

    work.obstacle_time = work.report_time = FAR
    work.guard_time = GUARD_PERIOD if parameters.schedule == ORIGINAL else FAR
    work.best_due = FAR
    clear(work.halts)
    clear(work.limits)
    work.limit = np.inf
    work.t_halted = NEVER
    work.in_callbacks = 1
    work.spin = 0
    work.wakes = 0
    _control(work, predictions[:0], work.wakes, parameters, latencies, facts)
    work.wakes = 0
    next_report, next_sensing, next_command = REPORT_PERIOD, SENSING_PERIOD, 0
    frozen = False
    n_track = n_judged = 0
    for k in range(len(obstacles)):
        radii[k] = obstacles[k].radius
    while True:
        now = min(
            min(min(next_sensing, next_report), min(next_command, work.wakes)),
            min(work.best_due, min(work.halts.next, work.limits.next)),
        )
        if not frozen and (now >= setting.limit or world.t_goal != NEVER):
            advance(world, obstacles, min(now, setting.limit))
            _freeze(work, obstacles, world.now, facts)
            frozen = True
            if world.t_goal != NEVER:
                break
        if now >= setting.limit + setting.extension:
            break
        advance(world, obstacles, now)
        if frozen and world.t_goal != NEVER:
            facts.t_goal_after = world.t_goal
            facts.moved_after = 1
            break
        if now == next_report:
            next_report += REPORT_PERIOD
            _measure(robot, work.report)
            work.report_lag = control.lag
            work.report_time = work.t_report = now
            facts.transitions[_P48] += 1
            facts.transitions[_P49] += 1
        if now == next_sensing:
            next_sensing += SENSING_PERIOD
            _sense(obstacles, now - latencies.added_sensing, seen)
            work.obstacle_time = now
            work.obstacle_stamp = now - latencies.added_sensing
            for k in range(1, 4):
                facts.transitions[_P61 + k] += 1
            if parameters.schedule == GUARDED:
                _guard(work, seen, predictions, guarded, now, parameters, latencies)
        while now == work.wakes:
            _think(work, seen, predictions, now, parameters, latencies, facts)
        if now == work.best_due:
            work.best_due = FAR
            if work.executing:
                facts.transitions[_P46] += 1
            work.executing = 1
            follow(control, planner.moving_on, now, parameters)
            facts.transitions[_P42] += 1
        while now == work.halts.next:
            signal(control, take(work.halts) == 1.0, now, parameters)
            if control.paused:
                robot.command_v = robot.command_w = 0.0
        while now == work.limits.next:
            control.limit = take(work.limits)
        if now == next_command:
            next_command += COMMAND_PERIOD
            _execute(work, now, parameters, facts)
            _watch(work, now, facts)
            if frozen and work.t_moving > facts.t_end + 1_000_000_000:
                facts.moved_after = 1
            if n_track < len(track):
                entry = track[n_track]
                entry.time = now
                entry.x, entry.y, entry.heading, entry.v, entry.w = robot.x, robot.y, robot.heading, robot.v, robot.w
                entry.halted = control.halt
                for k in range(len(obstacles)):
                    places[n_track, k, 0], places[n_track, k, 1] = obstacles[k].x, obstacles[k].y
                n_track += 1
                n_judged += 0 if frozen else 1
    facts.n_track = n_track
    measure(
        track[:n_judged],
        places[:n_judged],
        radii,
        robot.radius,
        setting.goal_x,
        setting.goal_y,
        setting.goal_tolerance,
        facts.t_goal,
        SAFE_DISTANCE,
        facts.measures,
    )
