"""One system case, compiled: world, sensing, the whole of RAMP and control in one event loop over integer nanoseconds.

Simultaneous events are taken in this order: world, robot report, obstacle message, guard, planner thread, messages to
control, command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours.streams import start
from parcours_navigation.arena.observing import freeze_later, measure_robot, sense
from parcours_navigation.arena.world import NEVER, advance, begin, bring_all, tick
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.one_case import SAFE_DISTANCE
from parcours_ramp.planner.control import COMMAND_PERIOD, REPORT_PERIOD, command, follow, signal
from parcours_ramp.planner.guard import GUARD_PERIOD
from parcours_ramp.planner.latency import late_start
from parcours_ramp.planner.parameters import GUARDED, ORIGINAL
from parcours_ramp.planner.planner_state import begin_population
from parcours_ramp.planner.sensing_cycle import evaluate_population
from parcours_ramp.system.planner_thread import decide, guard, think
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.workspace import FAR, SENSING_PERIOD, clear, freeze, take, watch

Floats = NDArray[np.float64]

_INDEX = {name: i for i, name in enumerate(TRANSITIONS)}
_P41, _P42, _P43, _P44, _P45, _P46, _P47, _P48, _P49, _P61 = (
    _INDEX[name] for name in ("p41", "p42", "p43", "p44", "p45", "p46", "p47", "p48", "p49", "p61")
)


@kernel
def _execute(work: Record, now: int, parameters: Record, facts: Record) -> None:
    """Let control command the robot."""
    control, robot = work.control, work.world.robot
    was_paused = control.paused
    measure_robot(robot, work.measured)
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
def run_case(
    number: int, obstacles: Record, setting: Record, parameters: Record, latencies: Record, work: Record, seen: Record,
    predictions: Record, guarded: Record, facts: Record, track: Record, places: Floats, radii: Floats,
) -> None:  # fmt: skip
    """Run one case from its number alone and fill its FACTS.

    Args:
        number: case number; seeds its random streams together with `setting.seed`.
        obstacles: array of OBSTACLE with the case's data; shape (n_obstacles,).
        seen: array of OBSTACLE_STATE, working memory; shape (n_obstacles,).
        predictions: array of PREDICTION, working memory; shape (n_obstacles,).
        guarded: array of PREDICTION, working memory of the guard; shape (n_obstacles,).
        track: array of TRACK that receives one entry a command until it is full; shape (n,).
        places: receives where the obstacles were at these entries [m]; shape (n, n_obstacles, 2).
        radii: receives the obstacles' radii [m]; shape (n_obstacles,).
    """
    world, planner, control = work.world, work.planner, work.control
    robot = world.robot
    seed, case = setting.seed, np.uint64(number)
    start(planner.stream, seed, case, np.uint64(1))
    start(work.modifier, seed, case, np.uint64(2))
    work.opens = late_start(work.clock, seed, case) if setting.starts_late else 0
    start(work.clock, seed, case, np.uint64(3))
    robot.x, robot.y, robot.heading = setting.robot_x, setting.robot_y, setting.robot_heading
    robot.v, robot.w = setting.robot_speed, 0.0
    robot.command_v, robot.command_w = setting.robot_speed, 0.0
    robot.v_max, robot.w_max = parameters.v_max, parameters.w_max
    robot.a_max, robot.alpha_max = parameters.a_max, parameters.alpha_max
    robot.radius = parameters.robot_radius
    world.goal_x, world.goal_y, world.goal_tolerance = setting.goal_x, setting.goal_y, setting.goal_tolerance
    world.solid = setting.solid
    begin(world, obstacles)
    planner.goal_x, planner.goal_y = setting.goal_x, setting.goal_y
    measure_robot(robot, work.report)
    work.report_lag = work.t_report = 0
    work.start = work.report
    work.start.v = setting.told_speed
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
    decide(work, predictions[:0], work.wakes, parameters, latencies, facts)
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
            freeze(work, obstacles, facts)
            frozen = True
            if world.t_goal != NEVER:
                break
        if now >= setting.limit + setting.extension:
            break
        tick(world, obstacles, now)
        if now in (next_sensing, next_command):
            bring_all(world, obstacles)
        if frozen and world.t_goal != NEVER:
            facts.t_goal_after = world.t_goal
            facts.moved_after = 1
            break
        if now == next_report:
            next_report += REPORT_PERIOD
            measure_robot(robot, work.report)
            work.report_lag = control.lag
            work.report_time = work.t_report = now
            facts.transitions[_P48] += 1
            facts.transitions[_P49] += 1
        if now == next_sensing:
            next_sensing += SENSING_PERIOD
            sense(obstacles, now - latencies.added_sensing, seen)
            work.obstacle_time = now
            work.obstacle_stamp = now - latencies.added_sensing
            for k in range(1, 4):
                facts.transitions[_P61 + k] += 1
            if parameters.schedule == GUARDED:
                guard(work, seen, predictions, guarded, now, parameters, latencies)
        while now == work.wakes:
            think(work, seen, predictions, now, parameters, latencies, facts)
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
            watch(work, now, facts)
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
    freeze_later(world, facts)
    facts.n_track = n_track
    measure(
        track[:n_judged], places[:n_judged], radii, robot.radius, setting.goal_x, setting.goal_y,
        setting.goal_tolerance, facts.t_goal, SAFE_DISTANCE, radii[:0], facts.measures,
    )  # fmt: skip
