"""Moves any world between two observations, compiled: robot, others, contact, goals, and what is sensed.

one tick:  body drives ─► ground stops it where it touches ─► others move ─► gaps, contacts ─► goal reached?
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import wrap
from parcours.kernels import Record, heap_kernel, kernel
from parcours.streams import uniform
from parcours_navigation.arena.contact import ROBOT_CLOSED, contact_share, least_distance, who_closed
from parcours_navigation.arena.obstacles import reported_at
from parcours_navigation.arena.world import NEVER, TICK, WORLD, begin, bring, note_contact
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.ground.clearance import clearance, first_touch, least_on_way
from parcours_navigation.ground.footprint import (
    footprint_disc_least,
    footprint_disc_touch,
    footprint_least,
    footprint_touch,
)
from parcours_navigation.others.agent import AGENT
from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.robots.body import BODY, command_body
from parcours_navigation.robots.driving import drive_body, world_velocity
from parcours_navigation.sensing.detecting import DETECTION, detect, normal
from parcours_navigation.sensing.scan import scan
from parcours_navigation.stage.memory import AT_ROBOT, AT_STAGE, AT_WORLD, ROW, STAGE, TIME, Floats
from parcours_navigation.stage.moving import ARRIVED, ENDED, GO_ON, NEXT_GOAL, NOT_FINITE, mark, obstacles_of
from parcours_navigation.stage.tracking import speeds

NO_POINTS = np.zeros((0, 4))  # of no trajectory
_AGENT, _BODY, _DETECTION = (one.itemsize // 8 for one in (AGENT, BODY, DETECTION))


@heap_kernel
def _agents(memory: Floats, stage: Record) -> Record:
    return memory[stage.at_agents : stage.at_agents + stage.n_agents * _AGENT].view(AGENT)


@heap_kernel
def _ways(memory: Floats, stage: Record) -> Floats:
    return memory[stage.at_ways : stage.at_ways + 3 * stage.n_ways].reshape((stage.n_ways, 3))


@heap_kernel
def _body(memory: Floats, stage: Record) -> Record:
    return memory[stage.at_body : stage.at_body + _BODY].view(BODY)[0]


@heap_kernel
def _ground(memory: Floats, stage: Record) -> Floats:
    return memory[stage.at_ground : stage.at_ground + stage.n_ground]


@heap_kernel
def _corners(memory: Floats, stage: Record) -> Floats:
    return memory[stage.at_corners : stage.at_corners + 2 * stage.n_corners].reshape((stage.n_corners, 2))


@kernel
def _mirror(world: Record, body: Record) -> None:
    """Let the world's robot be where the body is."""
    robot = world.robot
    robot.x, robot.y, robot.heading, robot.v, robot.w = body.x, body.y, body.heading, body.v, body.w


@kernel
def _gap_to_ground(memory: Floats, stage: Record, world: Record) -> float:
    robot, packed = world.robot, _ground(memory, stage)
    if stage.n_corners:
        return float(footprint_least(
            packed, _corners(memory, stage), robot.x, robot.y, robot.heading, robot.x, robot.y, robot.heading, np.inf
        ))  # fmt: skip
    return float(clearance(packed, robot.x, robot.y) - robot.radius)


@kernel
def _drive(memory: Floats, stage: Record, world: Record, body: Record) -> None:
    """Let the body drive for a tick; the ground stops it where it touches, and lets it leave."""
    x, y, heading = body.x, body.y, body.heading
    drive_body(body, TICK * 1e-9)
    if not stage.n_ground:
        return
    packed, radius = _ground(memory, stage), world.robot.radius
    enough = max(world.min_clearance, _APART)
    share = 2.0
    if stage.n_corners:
        corners = _corners(memory, stage)
        gap = footprint_least(packed, corners, x, y, heading, body.x, body.y, body.heading, enough)
        if gap <= 0.0:
            share = footprint_touch(packed, corners, x, y, heading, body.x, body.y, body.heading)
    else:
        gap = least_on_way(packed, x, y, body.x, body.y, radius, enough)
        if gap <= 0.0:
            share = first_touch(packed, x, y, body.x, body.y, radius)
    if share <= 1.0:
        gap = 0.0
    if gap < world.min_clearance:
        world.min_clearance, world.t_min_clearance = gap, world.now + TICK
    if share > 1.0:
        if gap > _APART:
            stage.touching = 0
        return
    if not stage.touching:
        stage.touching = 1
        note_contact(world, world.now + int(share * TICK), ROBOT_CLOSED)
    dx, dy, turn = body.x - x, body.y - y, wrap(body.heading - heading)
    way = np.sqrt(dx * dx + dy * dy) + radius * abs(turn)
    share = max(share - _BACK / way, 0.0) if way > 0.0 else 0.0
    body.x, body.y = x + share * dx, y + share * dy
    if stage.n_corners:
        body.heading = wrap(heading + share * turn)
    body.v = body.vy = body.left = body.right = 0.0
    if stage.n_corners:
        body.w = 0.0
    if body.drifts == 0:
        body.believed_x, body.believed_y, body.believed_heading = body.x, body.y, body.heading


_APART = 1e-3
"""A contact with the ground ends where the gap is wider than this [m]."""

_BACK = 1e-6
"""The ground holds the robot back by so much before it touches, so that it can go along [m]."""


@kernel
def _meet(memory: Floats, stage: Record, world: Record, obstacle: Record, body: Record, was: Record) -> None:
    """Note what one tick did to the gap between the body and an obstacle.

    Args:
        was: x, y, heading of the body and x, y of the obstacle before the tick, shape (5,).
    """
    x0, y0 = was[3] - was[0], was[4] - was[1]
    x1, y1 = obstacle.x - body.x, obstacle.y - body.y
    dx, dy = x1 - x0, y1 - y0
    reach = world.robot.radius + obstacle.radius
    gap, share = least_distance(x0, y0, x1, y1) - reach, 2.0
    if stage.n_corners and gap < max(world.min_clearance, 0.0):
        corners = _corners(memory, stage)
        gap = footprint_disc_least(
            corners, was[0], was[1], was[2], body.x, body.y, body.heading, was[3], was[4], obstacle.x, obstacle.y,
            obstacle.radius, np.inf,
        )  # fmt: skip
        if gap <= 0.0 and not obstacle.touching:
            share = footprint_disc_touch(
                corners, was[0], was[1], was[2], body.x, body.y, body.heading, was[3], was[4], obstacle.x, obstacle.y,
                obstacle.radius,
            )  # fmt: skip
    elif gap <= 0.0:
        share = contact_share(x0, y0, x1, y1, reach)
    share = min(share, 1.0)
    if gap < world.min_clearance:
        world.min_clearance, world.t_min_clearance = gap, world.now
    if gap > 0.0:
        obstacle.touching = 0
        return
    if obstacle.touching:
        return
    obstacle.touching = 1
    tick = TICK * 1e-9
    closer = who_closed(
        x0 + share * dx, y0 + share * dy, (body.x - was[0]) / tick, (body.y - was[1]) / tick,
        (obstacle.x - was[3]) / tick, (obstacle.y - was[4]) / tick,
    )  # fmt: skip
    if world.solid:
        obstacle.stop = min(obstacle.stop, world.now)
        obstacle.v = obstacle.w = 0.0
    note_contact(world, world.now - TICK + int(share * TICK), closer)


@heap_kernel
def _tick(memory: Floats, stage: Record, world: Record, obstacles: Record) -> None:
    """Advance a world that is not plain by one tick."""
    body = _body(memory, stage)
    was = np.empty(5)
    was[0], was[1], was[2] = body.x, body.y, body.heading
    vx, vy = world_velocity(body)
    _drive(memory, stage, world, body)
    _mirror(world, body)
    world.now += TICK
    step_x, step_y = body.x - was[0], body.y - was[1]
    world.travelled += np.sqrt(step_x * step_x + step_y * step_y)
    n_closed = stage.n - stage.n_agents
    for i in range(n_closed):
        obstacle = obstacles[i]
        bring(obstacle, world.now - TICK)
        was[3], was[4] = obstacle.x, obstacle.y
        bring(obstacle, world.now)
        _meet(memory, stage, world, obstacle, body, was)
    if stage.n_agents:
        places = np.empty((stage.n_agents, 2))
        for i in range(stage.n_agents):
            places[i, 0], places[i, 1] = obstacles[n_closed + i].x, obstacles[n_closed + i].y
        step_agents(
            _agents(memory, stage), _ways(memory, stage), obstacles, _ground(memory, stage), was[0], was[1],
            vx, vy, world.robot.radius, world.now, TICK * 1e-9,
        )  # fmt: skip
        for i in range(stage.n_agents):
            was[3], was[4] = places[i, 0], places[i, 1]
            _meet(memory, stage, world, obstacles[n_closed + i], body, was)
    _look_for_goal(memory, stage, world)


@kernel
def _look_for_goal(memory: Floats, stage: Record, world: Record) -> None:
    """See whether the next goal is reached; the last one counts."""
    if world.t_goal != NEVER:
        return
    robot = world.robot
    x, y = world.goal_x - robot.x, world.goal_y - robot.y
    if x * x + y * y >= world.goal_tolerance * world.goal_tolerance:
        return
    k = stage.at_goals + 3 * stage.next_goal
    wanted = memory[k + 2]
    if wanted == wanted and abs(wrap(robot.heading - wanted)) > stage.turn_tolerance:
        return
    stage.next_goal += 1
    if stage.next_goal < stage.n_goals:
        world.goal_x, world.goal_y = memory[k + 3], memory[k + 4]
    else:
        world.t_goal = world.now


@heap_kernel
def _observe(memory: Floats, stage: Record, world: Record, obstacles: Record) -> None:
    """Fill what the planner sees."""
    robot = world.robot
    memory[AT_ROBOT], memory[AT_ROBOT + 1], memory[AT_ROBOT + 2] = robot.x, robot.y, robot.heading
    memory[AT_ROBOT + 3], memory[AT_ROBOT + 4] = robot.v, robot.w
    k = stage.at_seen
    body = _body(memory, stage)
    memory[AT_ROBOT], memory[AT_ROBOT + 1], memory[AT_ROBOT + 2] = (
        body.believed_x,
        body.believed_y,
        body.believed_heading,
    )
    truth = np.empty((len(obstacles), 6))
    for i in range(len(obstacles)):
        obstacle = obstacles[i]
        truth[i, 0], truth[i, 1], truth[i, 2], truth[i, 5] = obstacle.x, obstacle.y, obstacle.heading, obstacle.radius
        truth[i, 3], truth[i, 4] = obstacle.v, obstacle.w
        if i < stage.n - stage.n_agents:
            truth[i, 3], truth[i, 4] = reported_at(obstacle, world.now)
    stream = memory[AT_STAGE:AT_WORLD].view(STAGE)["stream"]
    sensor = memory[stage.at_sensor : stage.at_sensor + _DETECTION].view(DETECTION)[0]
    rows = memory[k : stage.at_scan].reshape((-1, 6))
    if sensor.perfect:
        rows[: len(truth)] = truth
        stage.n_seen = len(truth)
    else:
        _late(memory, stage, truth)
        stage.n_seen = detect(
            truth, _ground(memory, stage), robot.x, robot.y, robot.heading, sensor, stream, rows
        )  # fmt: skip
    if stage.n_beams:
        _scan(memory, stage, world, obstacles, stream)
    stage.n_looks += 1


@heap_kernel
def _late(memory: Floats, stage: Record, truth: Record) -> None:
    """Keep what is true now, and put what was true some observations ago in its place."""
    if not stage.n_past or not len(truth):
        return
    size = truth.size
    kept = memory[stage.at_past : stage.at_past + size * (stage.n_past + 1)].reshape((stage.n_past + 1, len(truth), 6))
    kept[stage.n_looks % (stage.n_past + 1)] = truth
    truth[:] = kept[max(stage.n_looks - stage.n_past, 0) % (stage.n_past + 1)]


@heap_kernel
def _scan(memory: Floats, stage: Record, world: Record, obstacles: Record, stream: Record) -> None:
    """Fill the ranges of the scan."""
    ranges = memory[stage.at_scan : stage.at_scan + stage.n_beams]
    discs = np.empty((len(obstacles), 3))
    for i in range(len(obstacles)):
        discs[i, 0], discs[i, 1], discs[i, 2] = obstacles[i].x, obstacles[i].y, obstacles[i].radius
    robot = world.robot
    scan(
        _ground(memory, stage), discs, robot.x, robot.y, robot.heading, stage.scan_first, stage.scan_step,
        stage.scan_reach, ranges,
    )  # fmt: skip
    for k in range(stage.n_beams):
        if stage.scan_dropped > 0.0 and uniform(stream) < stage.scan_dropped:
            ranges[k] = np.inf
        elif stage.scan_noise > 0.0 and ranges[k] < np.inf:
            ranges[k] = min(max(ranges[k] + stage.scan_noise * normal(stream), 0.0), stage.scan_reach)


@kernel
def _mark_any(memory: Floats, stage: Record, world: Record, obstacles: Record) -> None:
    """Write one entry of the track, with the gap to the ground."""
    before = stage.n_track
    mark(memory, stage, world, obstacles)
    if stage.n_ground and stage.n_track > before:
        memory[stage.at_track + before * (ROW + 2 * len(obstacles)) + 7] = _gap_to_ground(memory, stage, world)


@kernel
def ground_gap(memory: Floats) -> float:
    """Return the gap between robot and ground now [m]; inf without a ground."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    if not stage.n_ground:
        return np.inf
    return _gap_to_ground(memory, stage, memory[AT_WORLD:AT_ROBOT].view(WORLD)[0])


@kernel
def _begin(memory: Floats, stage: Record, world: Record, obstacles: Record, body: Record) -> None:
    """Put a case that was laid into its memory at its beginning."""
    _mirror(world, body)
    begin(world, obstacles)
    if stage.n_agents:
        begin_agents(_agents(memory, stage), _ways(memory, stage), obstacles, _ground(memory, stage))
    _mark_any(memory, stage, world, obstacles)


@kernel
def _is_over(stage: Record, world: Record) -> bool:
    """Return whether the robot has stood for too long, or left the box in which the case goes on."""
    if stage.longest_rest and world.now - stage.t_moving >= stage.longest_rest:
        return True
    x, y, box = world.robot.x, world.robot.y, stage.within
    return bool(x < box[0] or y < box[1] or x > box[2] or y > box[3])


@kernel
def move_any(memory: Floats, until: int, v: float, w: float, aside: float, points: Floats, looks: bool) -> int:
    """Command speeds [m/s, rad/s, m/s to the left], advance the world to `until` [ns], and look around if wanted.

    A case that has not begun is put at its beginning instead: one kernel for both, as both are large.

    Where there are points of a trajectory, shape (n, 4), the robot is commanded at every tick to follow them instead.
    Return GO_ON; ARRIVED if the last goal was just reached, NEXT_GOAL if another, ENDED if the case ends for
    another reason; all these before `until`; or NOT_FINITE if a speed is not a finite number.
    """
    if not (np.isfinite(v) and np.isfinite(w) and np.isfinite(aside)):
        return NOT_FINITE
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    obstacles, body = obstacles_of(memory, stage), _body(memory, stage)
    status, begins = GO_ON, stage.n_looks == 0
    if begins:
        _begin(memory, stage, world, obstacles, body)
    else:
        command_body(body, v, aside, w)
    while not begins and world.now < until and status == GO_ON:
        if len(points):
            v, w = speeds(points, world.now * 1e-9, body.believed_x, body.believed_y, body.believed_heading)
            command_body(body, v, 0.0, w)
        reached, goal, touched = world.t_goal, stage.next_goal, world.t_contact
        _tick(memory, stage, world, obstacles)
        if world.now % TRACK_PERIOD == 0:
            _mark_any(memory, stage, world, obstacles)
        if reached == NEVER and world.t_goal != NEVER:
            status = ARRIVED
        elif (stage.ends_on_contact and touched == NEVER and world.t_contact != NEVER) or _is_over(stage, world):
            status = ENDED
        elif stage.next_goal != goal:
            status = NEXT_GOAL
    memory[TIME] = float(world.now)
    if (looks or begins) and status == GO_ON:
        _observe(memory, stage, world, obstacles)
    return status


def begin_any(memory: Floats) -> None:
    """Put a case that was laid into its memory at its beginning."""
    move_any(memory, 0, 0.0, 0.0, 0.0, NO_POINTS, True)
