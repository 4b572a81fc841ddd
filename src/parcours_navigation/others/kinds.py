"""How others may move: the values of each kind of motion, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from parcours.elementary import PI
from parcours.errors import BadRequest, require_known
from parcours_navigation.others.people import MOST
from parcours_navigation.others.ranges import (
    Box,
    Point,
    require_box,
    require_ordered,
    require_points,
    require_ranges,
    require_whole,
    require_within,
)
from parcours_navigation.others.tracks import Tracks

Ends = Literal["stand", "go-on"]


@dataclass(frozen=True, slots=True)
class ConstantVelocity:
    """Straight on at one speed."""

    heading: float | None = None  # [rad]; None: drawn for each
    at_walls: Ends = "go-on"  # at walls and bounds: be thrown back, or stand for good
    bounds: Box | None = None  # centres are held within them [m]; None: nowhere

    def __post_init__(self) -> None:
        require_known(self.at_walls, ("stand", "go-on"), "others, at_walls", slug="others-key")
        if self.heading is not None:
            require_within("heading", self.heading, -100.0, 100.0, "rad")
        if self.bounds is not None:
            require_box("bounds", self.bounds)


@dataclass(frozen=True, slots=True)
class Waypoints:
    """From waypoint to waypoint in straight lines; several agents are spread evenly along the way."""

    points: tuple[Point, ...]  # [m]
    loop: bool = True  # after the last one comes the first; else they stand there
    pause: float = 0.0  # they stay so long at each [s]

    def __post_init__(self) -> None:
        if not self.points:
            raise BadRequest("others, points", "there must be a waypoint, but there is not", slug="others-range")
        require_points("points", self.points)
        require_within("pause", self.pause, 0.0, 3600.0, "s")


@dataclass(frozen=True, slots=True)
class RandomWalk:
    """Heading and speed change at drawn times; bounds and walls are turned away from."""

    slowest: float = 0.5  # speeds are drawn from this share of `speed` to all of it
    between: tuple[float, float] = (1.0, 4.0)  # time from change to change [s]
    turn: float = PI / 2  # a change of heading is at most this, either way [rad]
    turn_rate: float = 2.0  # [rad/s]
    bounds: Box | None = None  # [m]; None: the area they are drawn in

    def __post_init__(self) -> None:
        require_ranges(
            self, {"slowest": (0.0, 1.0, ""), "turn": (0.0, 3.15, "rad"), "turn_rate": (0.01, 100.0, "rad/s")}
        )
        require_ordered("between", self.between, 3600.0, "s")
        if self.between[1] < 0.01:
            raise BadRequest("others, between", "changes must be at least 0.01 s apart", slug="others-range")
        if self.bounds is not None:
            require_box("bounds", self.bounds)


@dataclass(frozen=True, slots=True)
class Recorded:
    """Along recorded tracks, one agent each; nothing stops them."""

    tracks: Tracks
    ends: Ends = "stand"  # before its first and after its last row an agent stands, or goes on as it moves there
    later: float = 0.0  # all times are shifted by this [s]

    def __post_init__(self) -> None:
        require_known(self.ends, ("stand", "go-on"), "others, ends", slug="others-key")
        require_within("later", self.later, 0.0, 1e6, "s")


@dataclass(frozen=True, slots=True)
class SocialForcePeople:
    """People by social force; sources of the values in `social_force` and docs/others.md."""

    goals: tuple[Point, ...] = ()  # visited in turn [m]; without any, `drawn_goals` are drawn for each group
    loop: bool = True  # after the last one comes the first; else they stand there
    drawn_goals: int = 3
    pause: float = 0.0  # they stay so long at each [s]
    arrive: float = 0.5  # as near as this counts as reached [m]
    hurry: float = 1.3  # nobody is faster than this times the wanted speed
    reach: float = 5.0  # who is farther away is not looked at [m]
    nearest: int = 16  # how many of the others are looked at
    relax: float = 0.54  # tau [s]
    strength: float = 4.5  # A [m/s2]
    range: float = 0.35  # gamma [m]
    ahead: float = 2.0  # lambda [s/m]
    slowing: float = 3.0  # n'
    turning: float = 2.0  # n
    side: float = 0.005  # epsilon; above 0: pass on the right
    wall_strength: float = 3.0  # a [m/s2]
    wall_range: float = 0.1  # b [m]
    stiffness: float = 1500.0  # k / m, of bodies in contact [1/s2]
    cohesion: float = 3.0  # beta 2 [m/s2]

    def __post_init__(self) -> None:
        _check_people(self)
        require_ranges(
            self,
            {
                "relax": (0.1, 10.0, "s"), "strength": (0.0, 100.0, "m/s2"), "range": (0.01, 10.0, "m"),
                "ahead": (0.0, 100.0, "s/m"), "slowing": (0.0, 100.0, ""), "turning": (0.0, 100.0, ""),
                "side": (-1.0, 1.0, ""), "wall_strength": (0.0, 100.0, "m/s2"), "wall_range": (0.01, 10.0, "m"),
                "stiffness": (0.0, 3000.0, "1/s2"), "cohesion": (0.0, 100.0, "m/s2"),
            },
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class OrcaPeople:
    """People by optimal reciprocal collision avoidance; each does half the avoiding of another such person."""

    goals: tuple[Point, ...] = ()  # visited in turn [m]; without any, `drawn_goals` are drawn for each group
    loop: bool = True  # after the last one comes the first; else they stand there
    drawn_goals: int = 3
    pause: float = 0.0  # they stay so long at each [s]
    arrive: float = 0.5  # as near as this counts as reached [m]
    hurry: float = 1.3  # nobody is faster than this times the wanted speed
    reach: float = 10.0  # who is farther away is not looked at [m]
    nearest: int = 10  # how many of the others are looked at
    horizon: float = 3.0  # tau: velocities are free of collision with others for so long [s]
    wall_horizon: float = 1.0  # ... with walls [s]
    margin: float = 0.02  # the radius is enlarged by it towards others [m]
    # the wanted velocity is turned by 0.5 to 1.5 times this, drawn, to break symmetry [rad]; below 0: to the right
    tilt: float = -0.03
    acceleration: float = math.inf  # greatest change of velocity [m/s2]; the paper's bodies change it at once

    def __post_init__(self) -> None:
        _check_people(self)
        require_ranges(
            self,
            {
                "horizon": (0.05, 60.0, "s"), "wall_horizon": (0.05, 60.0, "s"), "margin": (0.0, 10.0, "m"),
                "tilt": (-0.5, 0.5, "rad"), "acceleration": (0.01, math.inf, "m/s2"),
            },
        )  # fmt: skip


def _check_people(motion: SocialForcePeople | OrcaPeople) -> None:
    require_points("goals", motion.goals)
    ranges = {
        "drawn_goals": (1, 20, ""), "pause": (0.0, 3600.0, "s"), "arrive": (0.01, 100.0, "m"), "hurry": (1.0, 3.0, ""),
        "reach": (0.1, 100.0, "m"), "nearest": (0, MOST, ""),
    }  # fmt: skip
    require_ranges(motion, ranges)
    for name in ("drawn_goals", "nearest"):
        require_whole(name, getattr(motion, name))


Motion = ConstantVelocity | Waypoints | RandomWalk | Recorded | SocialForcePeople | OrcaPeople

MOTIONS: dict[str, type[Any]] = {
    "constant-velocity": ConstantVelocity,
    "waypoints": Waypoints,
    "random-walk": RandomWalk,
    "recorded": Recorded,
    "social-force": SocialForcePeople,
    "orca": OrcaPeople,
}
"""What `motion:` of a world file may be."""
