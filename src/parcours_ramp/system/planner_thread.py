"""The planner's one thread, and the guard beside it: what is pending -> the next piece of work, done at once.

A planning cycle, a sleep to the next 1/20 s, then every callback that was pending when it woke, in order of arrival.
Whatever the thread computes takes effect at once and blocks the thread for a drawn time. Under the guarded schedule the
imminent-collision check is a task of its own, on every obstacle message.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.control_cycle import control_cycle, is_at_rest
from parcours_ramp.planner.guard import (
    GUARD_PERIOD,
    evaluate_moving_on,
    is_imminent,
    is_known_to_pass,
    note_moving_on,
    speed_limit,
    take_report,
)
from parcours_ramp.planner.late_evaluation import catch_up_with_all
from parcours_ramp.planner.latency import draw
from parcours_ramp.planner.messages import NO_COLLISION
from parcours_ramp.planner.parameters import GUARDED, ORIGINAL
from parcours_ramp.planner.planning_cycle import compensate, planning_cycle
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.sensing_cycle import look_on, sensing_cycle
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.workspace import FAR, post

# Who runs when (time runs to the right; #: busy for a drawn duration; its effects hold from its start):
#
#   planner thread  [plan ###]........[sense ##][control ####][plan ###]........[report][sense ##] ...
#                   ^ 1/20 s, or longer if late ^              ^ woken: pending callbacks first, oldest first
#   sensing         |    o         o         o         o       20 Hz: one obstacle message; a newer one replaces it
#   guard           |    g         g         g         g       guarded: at once, on each message, beside the thread
#                                  \--> halt, speed limit ------> mailbox, transport later, to control
#   control         c    c    c    c    c    c    c    c       20 Hz: a command to the robot; 30 Hz: a report
_INDEX = {name: i for i, name in enumerate(TRANSITIONS)}
_P11, _P12, _P13, _P15, _P16, _P17, _P18, _P19, _P21, _P31, _P51 = (
    _INDEX[name] for name in ("p11", "p12", "p13", "p15", "p16", "p17", "p18", "p19", "p21", "p31", "p51")
)


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
def decide(work: Record, predictions: Record, now: int, parameters: Record, latencies: Record, facts: Record) -> None:
    """Run a control cycle of the planner's thread and publish what it decided."""
    planner = work.planner
    was_halted = planner.halted
    generated = control_cycle(planner, predictions, now, parameters)
    facts.transitions[_P12] += 1
    facts.transitions[_P13] += 1
    _count_service(facts.transitions, _P21, 1 if generated else 0)
    _count_service(facts.transitions, _P31, 2)
    facts.n_control_cycles += 1
    work.best_due = max(now + latencies.transport, work.opens)
    if was_halted != planner.halted or (parameters.schedule == ORIGINAL and not planner.halted):
        _send_halt(work, now + latencies.transport + latencies.added_stop)
    work.wakes = now + draw(work.clock, latencies.control, latencies.control_spread) + latencies.added_planning


@kernel
def _take_report(work: Record, predictions: Record, stamp: int, parameters: Record) -> None:
    """Let the planner take note of the last report, from `stamp` [ns]."""
    planner = work.planner
    if work.report_lag != planner.lag:  # then its trajectories begin later
        catch_up_with_all(planner, predictions, parameters)
    take_report(planner, work.report, stamp, work.report_lag)


@kernel
def _callback(
    work: Record, seen: Record, predictions: Record, now: int, parameters: Record, latencies: Record, facts: Record
) -> bool:
    """Run the callback of the planner's thread that was pending longest; return False if none is left."""
    planner = work.planner
    control_time = planner.t_next
    first = min(min(work.report_time, work.obstacle_time), min(control_time, work.guard_time))
    if first > work.spin:
        return False
    if work.report_time == first:
        work.report_time = FAR
        _take_report(work, predictions, first, parameters)
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
        decide(work, predictions[: len(seen) * planner.knows_obstacles], now, parameters, latencies, facts)
    else:
        work.guard_time = max(first + GUARD_PERIOD, now - now % GUARD_PERIOD + GUARD_PERIOD)
        planner.halted = 1 if is_imminent(planner, now, parameters) else 0
        _send_halt(work, now + latencies.transport + latencies.added_stop)
    return True


@kernel
def guard(
    work: Record, seen: Record, predictions: Record, guarded: Record, now: int, parameters: Record, latencies: Record
) -> None:
    """Run the guard as a task of its own on the obstacles just seen; it can only halt, or limit the speed."""
    planner = work.planner
    _take_report(work, predictions, work.t_report, parameters)
    limit = speed_limit(planner, seen, parameters)
    changes, halts = limit != work.limit, False
    work.limit = limit
    if not planner.halted:
        stamp = work.obstacle_stamp
        look_on(planner, predictions, seen, stamp)
        epoch = planner.next_epoch
        planner.knows_obstacles = 1
        compensate(planner, parameters)
        if is_known_to_pass(planner, now, epoch, parameters):
            note_moving_on(planner, NO_COLLISION)
        else:
            for k in range(len(seen)):
                predict(seen[k], stamp, guarded[k])
            evaluate_moving_on(planner, guarded, now, epoch, parameters)
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
def think(
    work: Record, seen: Record, predictions: Record, now: int, parameters: Record, latencies: Record, facts: Record
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
