"""A plan and the number of a case -> its world at the beginning, its task, and what its planner is shown all along."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from inspect import signature
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import atan2
from parcours.errors import BadRequest, require_known
from parcours.kernels import Record, kernel
from parcours.streams import Stream, between, start, starts
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.robot import ROBOT
from parcours_navigation.ground.clearance import clearance, least_on_way
from parcours_navigation.ground.connected import is_connected
from parcours_navigation.ground.footprint import footprint_least
from parcours_navigation.ground.generators.fields import BARN_WORLDS, barn, barn_world, cylinders, warehouse
from parcours_navigation.ground.generators.indoor import corridor, doorway, office
from parcours_navigation.ground.generators.site import Site
from parcours_navigation.ground.ground import Ground, ground_of, lay_ground
from parcours_navigation.ground.maps import read_map
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.others.drawing import drawn
from parcours_navigation.others.entries import Others, read_others, settled
from parcours_navigation.others.kinds import MOTIONS
from parcours_navigation.protocol import Map, Task
from parcours_navigation.sensing.detecting import DETECTION
from parcours_navigation.stage.memory import EVERYWHERE, Scene, Staged
from parcours_navigation.worlds.plan import Detection, StopMoveStop, WorldPlan

Floats = NDArray[np.float64]

_OBSTACLES, _SENSORS = np.uint64(0x73746F70), np.uint64(0x73656E73)
"""Purposes of the streams that draw obstacles and what sensors add (ASCII for `stop` and `sens`)."""

_GROUND = 0x67726E64
"""Purpose of the streams from which generated grounds get their seeds (ASCII for `grnd`)."""

_T = TypeVar("_T")
_Named = list[tuple[str, _T]]

_TRIES = 10_000
_LATTICE = 1_000_000  # points on which a way off a map is looked for
_RANGES = ("speed", "turn", "waits", "moves", "heading")  # of obstacles; a number stands for a range of that alone
_WHOLE = ("number", "group", "drawn_goals", "nearest")


@dataclass(frozen=True, slots=True, eq=False)
class Land:
    """The ground of a case, packed, and where its robot starts and goes."""

    ground: Ground
    packed: Floats
    start: tuple[float, float, float]
    goals: tuple[tuple[float, float], ...]
    area: tuple[float, ...] | None  # where others begin who say nothing else: x_low, y_low, x_high, y_high [m]

    def edges(self) -> Floats:
        """Return walls and the edges of what is solid, x0, y0, x1, y1 [m], shape (n, 4)."""
        return np.concatenate([self.ground.solid_edges(), self.ground.segments])


def land_of(plan: WorldPlan, folder: Path, seed: int, number: int) -> Land:
    """Return the ground of a case. Raises BadRequest where start or goal are missing, or nothing can be generated."""
    own, given, generated = plan.ground, plan.task, None
    if own.generated:
        generated = _generated(own.generated, seed, number, plan.robot.radius)
    made = _fixed(own.bounds, own.walls, own.polygons, own.discs, own.map, folder) if generated is None else None
    found = generated.ground if generated is not None else made[0]  # type: ignore[index]
    if generated is not None and (own.walls or own.polygons or own.discs or own.map):
        raise BadRequest("ground, generated", "a ground is generated, or given by its parts, but not both",
                         "keep one", slug="world-range")  # fmt: skip
    goals = given.goals or ((given.goal,) if given.goal is not None else ())
    if not goals and generated is not None:
        goals = (generated.goal[:2],)
    where = given.start
    if where is None and generated is not None:
        x, y = generated.start[:2]
        where = (x, y, atan2(goals[0][1] - y, goals[0][0] - x))
    if where is None or not goals:
        what = "a start" if where is None else "a goal"
        raise BadRequest("task", f"there must be {what}, but there is none", "give start: [x, y, heading] and goal",
                         slug="world-range")  # fmt: skip
    packed = found.pack() if made is None else made[1]
    area = found.bounds if generated is None else generated.area
    around = None if area is None else tuple(map(float, area))
    return Land(found, packed, where, tuple(goals), around)


GENERATORS: dict[str, Callable[..., Site]] = {
    "barn": barn, "barn-300": barn_world, "corridor": corridor, "cylinders": cylinders, "doorway": doorway,
    "office": office, "warehouse": warehouse,
}  # fmt: skip
"""What `kind` of `ground: {generated: ...}` may be; `barn-300` are the 300 worlds, one per case, and again,
unless its `number` says which."""


def _generated(given: dict[str, Any], seed: int, number: int, radius: float) -> Site:
    """Return the ground that a generator draws for a case; with `same: true` one ground serves all cases."""
    kind = str(given.get("kind", ""))
    require_known(kind, tuple(GENERATORS), "ground, generated, kind", slug="ground-kind")
    arguments = {key: value for key, value in given.items() if key not in ("kind", "same")}
    known = [one for one in signature(GENERATORS[kind]).parameters if one != "seed"]
    for name, value in arguments.items():
        require_known(name, known, f"ground, generated, {kind}", slug="ground-kind")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadRequest(f"ground, generated, {name}", f"it must be a number, but is {value!r}",
                             "give one, or name an input under `data`", slug="ground-range")  # fmt: skip
    whole = {name: round(value) for name, value in arguments.items() if isinstance(value, float) and value.is_integer()}
    arguments = {"radius": radius, **arguments, **whole}
    if given.get("same"):
        number = 0
    if kind == "barn-300":
        own = arguments.pop("number", number % BARN_WORLDS)
    else:
        own = int(starts(seed, np.array([number]), _GROUND)[0])
    try:
        return _site(kind, own, tuple(arguments.items()))
    except BadGround as error:
        remedy = error.remedy or "give a number in that range"
        raise BadRequest(f"ground, generated, {error.where}", error.rule, remedy, slug=error.slug) from None


@functools.lru_cache(maxsize=512)
def _site(kind: str, seed: int, arguments: tuple[tuple[str, Any], ...]) -> Site:
    return GENERATORS[kind](seed, **dict(arguments))


@functools.lru_cache(maxsize=64)
def _fixed(
    bounds: tuple[float, ...] | None, walls: tuple[tuple[float, ...], ...], polygons: tuple[tuple[object, ...], ...],
    discs: tuple[tuple[float, ...], ...], map_: str, folder: Path,
) -> tuple[Ground, Floats]:  # fmt: skip
    """Return the ground of these parts, and packed."""
    cells = read_map(folder / map_) if map_ else None
    if cells is not None:
        cells = ground_of(cells).cells
    made = lay_ground(walls, discs, polygons, bounds, cells)  # type: ignore[arg-type]
    return made, made.pack()


def others_of(
    plan: WorldPlan, area: tuple[float, ...] | None, folder: Path
) -> tuple[_Named[StopMoveStop], _Named[Others]]:
    """Return who moves, with what messages call them: in closed form, and as agents; who begins nowhere begins in the
    area. Raises BadRequest.
    """
    closed: _Named[StopMoveStop] = []
    agents: _Named[Others] = []
    for k, given in enumerate(plan.others, 1):
        entry = {
            name: int(one) if name in _WHOLE and isinstance(one, float) and one.is_integer() else one
            for name, one in given.items()
        }
        if area is not None and "places" not in entry and entry.get("motion") not in ("waypoints", "recorded"):
            entry.setdefault("area", list(area))
        if entry.get("number") == 0:
            continue
        named = str(entry.get("motion", ""))
        require_known(named, (*MOTIONS, "stop-move-stop"), f"others {k}, motion", slug="others-key")
        if named == "stop-move-stop":
            closed.append((f"others {k}", _stop_move_stop(entry, f"others {k}")))
        else:
            agents.append((f"others {k}", read_others(entry, f"others {k}", folder)))
    return closed, agents


def _stop_move_stop(entry: dict[str, Any], where: str) -> StopMoveStop:
    known = [one.name for one in fields(StopMoveStop)]
    for name in entry:
        require_known(name, known, f"{where}, key", slug="others-key")
    given = {name: settled(value) for name, value in entry.items()}
    given |= {name: (one, one) for name, one in given.items() if name in _RANGES and isinstance(one, int | float)}
    try:
        return StopMoveStop(**given)  # type: ignore[arg-type]
    except BadRequest as error:
        raise BadRequest(error.where.replace("others", where, 1), error.rule, error.remedy, slug=error.slug) from None


def stage(plan: WorldPlan, folder: Path, seed: int, number: int, period: float) -> Staged:
    """Return a case of a plan, in which a planner is asked once a `period` [s].

    Raises BadRequest if the robot starts in contact, or bodies find no place.
    """
    land, body, task = land_of(plan, folder, seed, number), plan.robot, plan.task
    x, y, heading = land.start
    corners = np.array(body.footprint, np.float64).reshape(-1, 2)
    _require_free(land, plan, corners)
    _require_closed(plan, folder, land.start[:2])
    if abs(task.start_speed) > body.limits.speed:
        rule = f"it must be within the robot's top speed, {body.limits.speed:g} m/s, but is {task.start_speed:g}"
        raise BadRequest("task, start_speed", rule, "lower it", slug="world-range")
    closed, entries = others_of(plan, land.area, folder)
    obstacles = _closed(closed, land, body.radius, seed, number)
    taken = [(x, y, body.radius), *((float(one["x0"]), float(one["y0"]), float(one["radius"])) for one in obstacles)]
    crowd = drawn([one for _, one in entries], seed, number, taken=taken, names=[name for name, _ in entries],
                  is_free=lambda a, b, r: clearance(land.packed, a, b) > r,
                  is_way_free=lambda a, b, c, d, r: least_on_way(land.packed, a, b, c, d, r, 0.0) > 0.0)  # fmt: skip
    agents = crowd.agents.copy()
    agents["obstacle"] += len(obstacles)
    limits, sensing = body.limits, plan.sensing
    robot = np.zeros(1, ROBOT)
    robot[0] = (x, y, heading, task.start_speed, 0.0, task.start_speed, 0.0, limits.speed, limits.yaw_rate,
                limits.acceleration, limits.yaw_acceleration, body.radius)  # fmt: skip
    last = np.full(len(land.goals), np.nan)
    last[-1] = np.nan if task.heading is None else task.heading
    plain = (
        body.kind == "unicycle" and not body.footprint and body.delay == 0.0 and body.odometry.is_exact
        and not len(land.packed) and not len(agents) and sensing.others.is_perfect and sensing.scan is None
        and len(land.goals) == 1 and task.heading is None and not task.ends_on_contact
        and task.ends_at_rest is None and task.ends_outside is None
    )  # fmt: skip
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(seed), np.uint64(number), _SENSORS)
    scene = Scene(
        obstacles=np.concatenate([obstacles, np.asarray(crowd.obstacles).astype(OBSTACLE)]), robot=robot,
        goals=np.column_stack([np.array(land.goals, float).reshape(-1, 2), last]), tolerance=task.tolerance,
        body=np.array([body.record(x, y, heading, task.start_speed, seed=seed, case=number)]), agents=agents,
        ways=crowd.ways, ground=land.packed, corners=corners,
        sensor=_sensor(sensing.others, period), scan=_scan(plan), turn_tolerance=task.heading_tolerance,
        solid=plan.solid, ends_on_contact=task.ends_on_contact,
        longest_rest=round((task.ends_at_rest or 0.0) * 1e9), within=task.ends_outside or EVERYWHERE,
        plain=plain, stream=int(stream[0]),
    )  # fmt: skip
    tasks = [
        Task(goal, task.tolerance, body.radius, limits, period, _extent(land), 0, body.robot,
             task.heading if k == len(land.goals) - 1 else None, task.heading_tolerance)
        for k, goal in enumerate(land.goals)
    ]  # fmt: skip
    shown = _map(land, plan.sensing.map, plan) if plan.sensing.map is not None else None
    path = np.array(task.path, float) if task.path else None
    return Staged(number, scene, tasks[0], task.time_limit, task.start_speed, tuple(tasks[1:]), shown, path)


def _extent(land: Land) -> float:
    """Return the side of a square from the origin that holds start, goals and bounds [m]."""
    places = [land.start[:2], *land.goals]
    extent = land.ground.extent()
    corner = extent[2:].max() if extent is not None else 0.0
    return float(max(corner, *(max(place) for place in places), 1e-3))


def _map(land: Land, resolution: float, plan: WorldPlan) -> Map:
    """Return the map of the ground, which also covers the start and the goals."""
    extent = land.ground.extent()
    places = [land.start[:2], *land.goals, *([] if extent is None else [tuple(extent[:2]), tuple(extent[2:])])]
    # Walls at round coordinates would lie between cells, and in none of them.
    rim = (0.0 if land.ground.bounds is not None else 1.0) + 1.37 * resolution
    area = (*(np.min(places, axis=0) - rim).tolist(), *(np.max(places, axis=0) + rim).tolist())
    if plan.ground.generated:
        return land.ground.rasterise(resolution, np.array(area))
    return _rasterised(land.ground, resolution, area)


@functools.lru_cache(maxsize=8)
def _rasterised(found: Ground, resolution: float, area: tuple[float, ...]) -> Map:
    return found.rasterise(resolution, np.array(area))


def _require_free(land: Land, plan: WorldPlan, corners: Floats) -> None:
    """Raise BadRequest if the robot starts in contact with the ground, or a goal lies in it."""
    x, y, heading = land.start
    if len(corners):
        gap = footprint_least(land.packed, corners, x, y, heading, x, y, heading, np.inf)
    else:
        gap = clearance(land.packed, x, y) - plan.robot.radius
    if gap <= 0.0:
        rule = f"the robot must start clear of the ground, but at ({x:g}, {y:g}) m its gap is {gap:.3f} m"
        remedy = "move the start, or make the robot smaller"
        if plan.ground.generated and plan.task.start is not None:
            remedy = "leave start and goal out: a generated ground brings its own"
        raise BadRequest("task, start", rule, remedy, slug="start-occupied")
    for k, (gx, gy) in enumerate(land.goals):
        if clearance(land.packed, gx, gy) <= 0.0:
            rule = f"a goal must lie on free ground, but ({gx:g}, {gy:g}) m does not"
            raise BadRequest("task, goals" if k else "task, goal", rule, "move it", slug="goal-occupied")


def _require_closed(plan: WorldPlan, folder: Path, begin: tuple[float, float]) -> None:
    """Raise BadRequest if the robot can drive off a map: nothing is known of what lies beyond."""
    own = plan.ground
    if own.map and own.bounds is None and _leaves(own.walls, own.polygons, own.discs, own.map, folder, begin,
                                                  plan.robot.radius):  # fmt: skip
        rule = f"a map must be closed, but from ({begin[0]:g}, {begin[1]:g}) m the robot can leave it"
        remedy = "close the walls in the map, or give bounds: [x_low, y_low, x_high, y_high] beside it"
        raise BadRequest("ground, map", rule, remedy, slug="map-open")


@functools.lru_cache(maxsize=64)
def _leaves(
    walls: tuple[tuple[float, ...], ...], polygons: tuple[tuple[object, ...], ...],
    discs: tuple[tuple[float, ...], ...], map_: str, folder: Path, begin: tuple[float, float], radius: float,
) -> bool:  # fmt: skip
    """Return whether a disc certainly gets from a place on a map to beyond it; without a wall it does."""
    ground, packed = _fixed(None, walls, polygons, discs, map_, folder)
    extent = ground.extent()
    if extent is None:
        return True
    low, high = np.minimum(extent[:2], begin) - 4.0 * radius, np.maximum(extent[2:], begin) + 4.0 * radius
    spacing = max(0.25 * radius, math.sqrt(float(np.prod(high - low)) / _LATTICE))
    beyond = (float(high[0]) - radius, float(high[1]) - radius)
    return is_connected(packed, np.array([*low, *high]), begin, beyond, radius, tolerance=radius, spacing=spacing)


def _sensor(detection: Detection, period: float) -> Record:
    sensor = np.zeros(1, DETECTION)
    sensor[0] = (
        min(detection.reach, 1e9), 0.5 * detection.field_of_view, detection.occlusion, detection.position_noise,
        detection.velocity_noise, detection.dropped, detection.false, math.ceil(detection.late / period - 1e-9),
        detection.is_perfect,
    )  # fmt: skip
    return sensor


def _scan(plan: WorldPlan) -> tuple[int, float, float, float, float, float]:
    laser = plan.sensing.scan
    if laser is None:
        return 0, 0.0, 0.0, 0.0, 0.0, 0.0
    step = laser.field_of_view / laser.beams
    first = 0.5 * (step - laser.field_of_view) if laser.first_beam is None else laser.first_beam
    return laser.beams, first, step, laser.reach, laser.noise, laser.dropped


def _closed(entries: _Named[StopMoveStop], land: Land, robot_radius: float, seed: int, number: int) -> Record:
    """Return the obstacles of closed form, clear of each other, the robot and the ground; array of OBSTACLE."""
    total = sum(one.number for _, one in entries)
    obstacles = np.zeros(total, OBSTACLE)
    stream, k = np.zeros(1, np.uint64), 0
    x, y, _ = land.start
    for place, (name, one) in enumerate(entries):
        start(stream, np.uint64(seed), np.uint64(number), _OBSTACLES + np.uint64(place << 40))
        for i in range(one.number):
            if one.places:
                obstacles[k]["x0"], obstacles[k]["y0"], obstacles[k]["radius"] = *one.places[i], one.radius
                if math.hypot(one.places[i][0] - x, one.places[i][1] - y) < one.radius + robot_radius:
                    rule = f"the robot must start clear of obstacles, but one stands at {one.places[i]} m"
                    raise BadRequest(name, rule, "move it, or the start", slug="start-occupied")
            elif not _draw(one.area or (), one.radius, x, y, robot_radius, obstacles, k, land.packed, stream):
                rule = f"{one.number} discs with a radius of {one.radius:g} m must find room, but {k} did in the area"
                remedy = "give fewer or smaller ones, or more room"
                raise BadRequest(name, rule, remedy, slug="others-do-not-fit")
            values = [between(stream, *span) for span in (one.speed, one.turn, one.waits, one.moves)]
            obstacles[k]["speed"], obstacles[k]["turn"] = values[:2]
            obstacles[k]["start"] = round(values[2] * 1e9)
            obstacles[k]["stop"] = round((values[2] + values[3]) * 1e9)
            obstacles[k]["announced"] = round(one.announced * 1e9)
            obstacles[k]["heading0"] = between(stream, *one.heading)
            k += 1
    return obstacles


@kernel
def _draw(
    area: tuple[float, ...], radius: float, x: float, y: float, robot_radius: float, obstacles: Record,
    k: int, packed: Floats, stream: Stream,
) -> bool:  # fmt: skip
    """Put obstacle k somewhere in the area, clear of those before it, of the robot and of the ground."""
    for _ in range(_TRIES):
        ox, oy = between(stream, area[0], area[2]), between(stream, area[1], area[3])
        reach = radius + robot_radius + 0.05
        free = (ox - x) ** 2 + (oy - y) ** 2 > reach * reach and clearance(packed, ox, oy) > radius
        for i in range(k):
            dx, dy = obstacles[i].x0 - ox, obstacles[i].y0 - oy
            reach = radius + obstacles[i].radius
            free = free and dx * dx + dy * dy > reach * reach
        if free:
            obstacles[k].x0, obstacles[k].y0, obstacles[k].radius = ox, oy, radius
            return True
    return False
