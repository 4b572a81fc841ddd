"""What a world is made of, as values: sensing and task here, the rest in the rooms that know it. All in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from parcours.elementary import PI
from parcours.errors import BadRequest
from parcours_navigation.others.ranges import (
    require_box,
    require_ordered,
    require_ranges,
    require_start,
    require_whole,
    require_within,
)
from parcours_navigation.robots.kinds import Body

Point = tuple[float, float]


def within(where: str, owner: object, **bounds: tuple[float, float]) -> None:
    """Raise BadRequest unless the fields named lie within their bounds, ends included; NaN does not."""
    for name, (low, high) in bounds.items():
        value = getattr(owner, name)
        if not low <= value <= high:
            to = f"from {low:g} to {high:g}" if math.isfinite(high) else f"at least {low:g}"
            raise BadRequest(f"{where}, {name}", f"it must be {to}, but is {value:g}", "give a number in that range",
                             slug="world-range")  # fmt: skip


def _numbers(value: object) -> list[float]:
    if value is None:
        return []
    if isinstance(value, tuple):
        return [number for item in value for number in _numbers(item)]
    return [float(value)]  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Detection:
    """How the others are detected; the defaults are perfect.

    >>> Detection(dropped=2.0)
    Traceback (most recent call last):
    parcours.errors.BadRequest: sensing, dropped: it must be from 0 to 1, but is 2; give a number ... [world-range]
    """

    reach: float = math.inf  # farther centres are not detected [m]
    field_of_view: float = 2.0 * PI  # whole angle, about straight ahead [rad]
    occlusion: bool = False  # what walls or other bodies hide is not detected
    position_noise: float = 0.0  # standard deviation of each coordinate [m]
    velocity_noise: float = 0.0  # ... of the speed [m/s]
    dropped: float = 0.0  # share of detections that are lost
    late: float = 0.0  # they show what was so long ago [s], up to whole periods of observation
    false: float = 0.0  # mean number of detections of nobody, an observation; at most 4 come

    def __post_init__(self) -> None:
        within("sensing", self, reach=(0.0, math.inf), field_of_view=(0.0, 2.0 * PI), position_noise=(0.0, 10.0),
               velocity_noise=(0.0, 10.0), dropped=(0.0, 1.0), late=(0.0, 10.0), false=(0.0, 4.0))  # fmt: skip

    @property
    def is_perfect(self) -> bool:
        """Whether everybody is seen as they are."""
        return self == Detection()


@dataclass(frozen=True, slots=True)
class LaserScan:
    """A planar laser scanner in the middle of the robot."""

    beams: int = 360
    reach: float = 10.0  # [m]
    field_of_view: float = 2.0 * PI  # whole angle, about straight ahead [rad]
    first_beam: float | None = None  # direction of beam 0 from straight ahead [rad]; none: the right end of the field
    noise: float = 0.0  # standard deviation of a range [m]
    dropped: float = 0.0  # share of beams that come back without a range

    def __post_init__(self) -> None:
        within("scan", self, beams=(1, 10_000), reach=(0.01, 1000.0), field_of_view=(0.001, 2.0 * PI),
               noise=(0.0, 10.0), dropped=(0.0, 1.0))  # fmt: skip
        if self.first_beam is not None:
            within("scan", self, first_beam=(-2.0 * PI, 2.0 * PI))


@dataclass(frozen=True, slots=True)
class SensingPlan:
    """What a planner is shown."""

    others: Detection = Detection()
    scan: LaserScan | None = None
    map: float | None = None  # side of a cell of the map that is given [m]; none: there is no map

    def __post_init__(self) -> None:
        if self.map is not None:
            within("sensing", self, map=(0.005, 10.0))

    def gives(self, has_path: bool) -> tuple[str, ...]:
        """Return which of `protocol.SENSES` planners find in their observations."""
        have = {"scan": self.scan is not None, "map": self.map is not None, "path": has_path}
        return tuple(name for name, given in have.items() if given)


@dataclass(frozen=True, slots=True)
class TaskPlan:
    """Where the robot starts, and what it is to do. A generated ground has a start and a goal of its own."""

    start: tuple[float, float, float] | None = None  # x, y, heading [m, m, rad]
    start_speed: float = 0.0  # which is also the first command [m/s]
    goal: Point | None = None  # x, y [m]
    goals: tuple[Point, ...] = ()  # several, to be reached in turn, in the place of `goal`
    tolerance: float = 0.2  # as near as this counts as reached [m]
    heading: float | None = None  # which way to look at the last goal [rad]
    heading_tolerance: float = 0.2  # [rad]
    path: tuple[Point, ...] = ()  # a way that planners are shown
    time_limit: float = 60.0  # [s]
    ends_on_contact: bool = False  # the case ends when the robot touches anything
    ends_at_rest: float | None = None  # ... or has stood for so long [s]
    ends_outside: tuple[float, float, float, float] | None = None  # ... or its place is out of a box [m]

    def __post_init__(self) -> None:
        if self.ends_at_rest is not None:
            within("task", self, ends_at_rest=(0.05, 3600.0))
        if self.ends_outside is not None:
            require_box("ends_outside", self.ends_outside, ("task", "world-range"))
        within("task", self, tolerance=(1e-6, 1000.0), heading_tolerance=(1e-6, PI), time_limit=(0.01, 3600.0),
               start_speed=(-100.0, 100.0))  # fmt: skip
        if self.goal is not None and self.goals:
            raise BadRequest("task, goals", "a task has one goal, or several in turn, but both are given",
                             "keep one of them", slug="world-range")  # fmt: skip
        for name in ("start", "goal", "goals", "path", "heading"):
            if not all(abs(one) <= 1e4 for one in _numbers(getattr(self, name))):
                raise BadRequest(f"task, {name}", "its numbers must be finite and within 1e4 of 0", "give metres",
                                 slug="world-range")  # fmt: skip
        if len(self.goals) > MAX_GOALS:
            rule = f"there may be up to {MAX_GOALS} goals, but {len(self.goals)} are given"
            raise BadRequest("task, goals", rule, "leave some out", slug="world-range")


MAX_GOALS = 100


@dataclass(frozen=True, slots=True)
class StopMoveStop:
    """Discs that stand, move at a constant speed and yaw rate, and stand again, as the paper's do; drawn by seed."""

    area: tuple[float, float, float, float] | None = None  # in which they begin: x_low, y_low, x_high, y_high [m]
    motion: Literal["stop-move-stop"] = "stop-move-stop"
    number: int = 3
    radius: float = 0.1  # [m]
    speed: tuple[float, float] = (0.1, 0.5)  # drawn between these [m/s]
    turn: tuple[float, float] = (-PI / 2, PI / 2)  # [rad/s]
    waits: tuple[float, float] = (0.0, 10.0)  # stands for so long first [s]
    moves: tuple[float, float] = (2.0, 10.0)  # then moves for so long [s]
    heading: tuple[float, float] = (-PI, PI)  # where they set out for [rad]
    places: tuple[Point, ...] = ()  # where they begin instead, one for each [m]
    announced: float = 0.0  # they are already reported to move so long before they do [s]

    def __post_init__(self) -> None:
        require_ranges(self, {"number": (0, 200, ""), "radius": (0.001, 100.0, "m")})
        require_whole("number", self.number)
        require_ordered("speed", self.speed, 100.0, "m/s")
        require_ordered("turn", self.turn, 100.0, "rad/s", low=-100.0)
        require_ordered("waits", self.waits, 3600.0, "s")
        require_ordered("moves", self.moves, 3600.0, "s")
        require_ordered("heading", self.heading, 100.0, "rad", low=-100.0)
        require_within("announced", self.announced, 0.0, 3600.0, "s")
        require_start(self.number, self.places, self.area)


@dataclass(frozen=True, slots=True)
class PaperObstacles:
    """The three obstacles of the paper, by their model: any of its nine orders of setting out, or the authors' five."""

    motion: Literal["paper"] = "paper"
    protocol: Literal["table-vii", "published"] = "table-vii"
    radius: float = 0.1  # [m]


@dataclass(frozen=True, slots=True)
class GroundPlan:
    """Walls and whatever else stands."""

    bounds: tuple[float, float, float, float] | None = None  # walls all around: x_low, y_low, x_high, y_high [m]
    walls: tuple[tuple[float, float, float, float], ...] = ()  # segments x0, y0, x1, y1 [m]
    polygons: tuple[tuple[Point, ...], ...] = ()  # solid ones [m]
    discs: tuple[tuple[float, float, float], ...] = ()  # x, y, radius [m]
    map: str = ""  # a map of ROS: its YAML, beside the world's file
    generated: dict[str, Any] = field(default_factory=dict)  # a `kind` of generator, and its arguments


@dataclass(frozen=True, slots=True)
class WorldPlan:
    """All that a world is made of."""

    task: TaskPlan
    ground: GroundPlan = GroundPlan()
    robot: Body = field(default_factory=Body)
    others: tuple[dict[str, Any], ...] = ()
    sensing: SensingPlan = SensingPlan()
    solid: bool = False  # whether an obstacle that closes a gap stops there for good; people never enter anybody
