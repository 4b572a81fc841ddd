"""RAMP's controller and planner -> what the FACTS of a case say of them."""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_navigation.arena.observing import freeze_world
from parcours_ramp.planner.control import COMMAND_PERIOD

SENSING_PERIOD = 50_000_000  # Time between two obstacle messages [ns] (20 Hz)


@kernel
def watch(work: Record, now: int, facts: Record) -> None:
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
def freeze(work: Record, obstacles: Record, facts: Record) -> None:
    """Write down how a case of RAMP stands at its end."""
    planner = work.planner
    freeze_world(work.world, obstacles, facts)
    facts.feasible = planner.moving_on.feasible
    facts.time_left = planner.moving_on.duration
    facts.halted = work.control.halt
    facts.n_switches = planner.n_switches
    facts.t_last_moving = work.t_moving
