"""Others drawn for one case: seed and case number into arrays of AGENT, of ways, and of OBSTACLE."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import PI, atan2
from parcours.errors import BadRequest
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.others import agent as kinds_of_agent
from parcours_navigation.others.agent import AGENT, GO_ON, STAND
from parcours_navigation.others.draws import Draws
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import (
    ConstantVelocity,
    OrcaPeople,
    RandomWalk,
    Recorded,
    SocialForcePeople,
    Waypoints,
)
from parcours_navigation.others.ranges import Box, Point
from parcours_navigation.protocol import Floats

PURPOSE = 0x6F7468657273
"""Purpose of the streams that draw others (ASCII for `others`)."""

GAP = 0.05
"""Bodies begin at least so far apart [m]."""

_TRIES, _GROUP_TRIES = 60, 60
_KINDS: dict[type, int] = {
    ConstantVelocity: kinds_of_agent.CONSTANT,
    Waypoints: kinds_of_agent.WAYPOINTS,
    RandomWalk: kinds_of_agent.WALK,
    Recorded: kinds_of_agent.TRACK,
    SocialForcePeople: kinds_of_agent.FORCE,
    OrcaPeople: kinds_of_agent.ORCA,
}

IsFree = Callable[[float, float, float], bool]
"""Whether a disc at x, y with a radius [m] lies clear of all walls."""

IsWayFree = Callable[[float, float, float, float, float], bool]
"""Whether a disc can go straight from x0, y0 to x1, y1 with a radius [m], clear of all walls."""


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """All others of one case, as the kernels take them."""

    agents: NDArray[np.void]  # array of AGENT, shape (n,), a recarray
    ways: Floats  # shape (m, 3)
    obstacles: NDArray[np.void]  # array of OBSTACLE, shape (n,), a recarray


def anywhere(x: float, y: float, radius: float) -> bool:
    """Return True: there are no walls."""
    return True


def drawn(
    others: Sequence[Others],
    seed: int,
    case: int,
    *,
    is_free: IsFree = anywhere,
    is_way_free: IsWayFree | None = None,
    taken: Sequence[tuple[float, float, float]] = (),
    names: Sequence[str] = (),
) -> Crowd:
    """Return all others of one case, clear of each other, of walls and of what is taken.

    Args:
        others: what moves; each entry has a stream of its own, so another entry changes only who stands where.
        seed: the campaign's.
        case: number of the case.
        is_free: says where no wall is.
        is_way_free: says which straight ways no wall crosses. With it, drawn goals follow each other on such ways, and
            people who visit them again and again go back the same way; they know no way round walls.
        taken: discs x, y, radius [m] to keep clear of: the robot at its start, and what stands already.
        names: what messages call each entry.

    Raises:
        BadRequest: they do not fit, or no goal can be drawn.

    >>> people = Others(SocialForcePeople(), number=3, area=(0.0, 0.0, 6.0, 6.0))
    >>> crowd = drawn([people], seed=1, case=0, taken=[(3.0, 3.0, 1.0)])
    >>> len(crowd.agents), crowd.ways.shape
    (3, (9, 3))
    """
    agents: list[Any] = []
    ways: list[Sequence[float]] = []
    discs = [tuple(disc) for disc in taken]
    for k, entry in enumerate(others):
        draws = Draws(seed, case, PURPOSE + (k << 48))
        where = f"others {k + 1} of case {case}" if len(others) > 1 else f"others of case {case}"
        where = names[k] if names else where
        _Entry(k, entry, draws, is_free, is_way_free, where, agents, ways, discs).draw()
    array = np.zeros(len(agents), AGENT)
    obstacles = np.zeros(len(agents), OBSTACLE)
    for name in AGENT.names or ():
        if any(name in values for values, *_ in agents):
            array[name] = [values.get(name, 0) for values, *_ in agents]
    array["obstacle"] = range(len(agents))
    array["group"] = _numbers([group for *_, group in agents])
    for name, k in (("x0", 1), ("y0", 2), ("radius", 3), ("x", 1), ("y", 2)):
        obstacles[name] = [agent[k] for agent in agents]
    return Crowd(array.view(np.recarray), np.array(ways, np.float64).reshape(-1, 3), obstacles.view(np.recarray))


def _numbers(groups: list[object]) -> list[int]:
    """Return a number for each group, from 0 on, and -1 for None."""
    known = {group: k for k, group in enumerate(dict.fromkeys(group for group in groups if group is not None))}
    return [-1 if group is None else known[group] for group in groups]


@dataclass(slots=True)
class _Entry:
    """Draws one entry; what it finds is added to `agents`, `ways` and `discs`."""

    number: int
    others: Others
    draws: Draws
    is_free: IsFree
    is_way_free: IsWayFree | None
    where: str
    agents: list[Any]
    ways: list[Sequence[float]]
    discs: list[tuple[float, ...]]

    def draw(self) -> None:
        others = self.others
        for first in range(0, others.number, others.group):
            size = min(others.group, others.number - first)
            places = self._places(first, size)
            rows, ends = self._shared_ways(places[0])
            for k in range(size):
                self._add(first + k, places[k], rows, ends, size > 1)

    def _add(self, k: int, place: Point, rows: list[Sequence[float]], ends: int, in_group: bool) -> None:
        """Add agent k of the entry."""
        others, motion, draws = self.others, self.others.motion, self.draws
        speed = others.speed + (others.speed_spread * draws.normal() if others.speed_spread > 0.0 else 0.0)
        speed = max(speed, 0.0)
        start = draws.between(*others.start)
        gives = draws.number() < others.yields
        values: dict[str, Any] = {
            "kind": _KINDS[type(motion)], "ends": ends, "speed": speed, "top": speed,
            "start": int(start * 1e9 + 0.5), "seed": int(draws.number() * 2**53) << 11,
            "yields": others.effort if gives else 0.0, "x_low": -np.inf, "y_low": -np.inf, "x_high": np.inf,
            "y_high": np.inf, "heading": draws.between(-PI, PI), "first": len(self.ways), "count": 0,
        }  # fmt: skip
        if isinstance(motion, (SocialForcePeople, OrcaPeople)):
            values |= {name: getattr(motion, name) for name in _fields_of(motion)}
            values["top"] = motion.hurry * speed
            if isinstance(motion, OrcaPeople):  # were all tilts equal, a ring of people could stay a ring
                values["tilt"] = motion.tilt * draws.between(0.5, 1.5)
        elif isinstance(motion, RandomWalk):
            values |= {"slowest": motion.slowest * speed, "fastest": speed, "turn": motion.turn}
            values |= {"least": motion.between[0], "most": motion.between[1], "turn_rate": motion.turn_rate}
            values |= _bounds(motion.bounds or others.area, others.radius)
        elif isinstance(motion, ConstantVelocity):
            values |= _bounds(motion.bounds, others.radius)
            if motion.heading is not None:
                values["heading"] = motion.heading
        elif isinstance(motion, Recorded):
            rows, values["start"] = motion.tracks.rows[k].tolist(), int((start + motion.later) * 1e9 + 0.5)
            values["top"] = motion.tracks.fastest
            place = rows[0][1], rows[0][2]
        elif isinstance(motion, Waypoints):
            place, rows = _along(motion, k / others.number)
        if rows:
            values["count"] = len(rows)
            self.ways += rows
            if not isinstance(motion, Recorded):
                values["heading"] = atan2(rows[0][2] - place[1], rows[0][1] - place[0])
        if others.area is None or others.places or isinstance(motion, (Recorded, Waypoints)):
            self.discs.append((*place, others.radius))
        group = (self.number, k // others.group) if in_group else None
        if others.only is None or k in others.only:
            self.agents.append((values, *place, others.radius, group))

    def _shared_ways(self, place: Point) -> tuple[list[Sequence[float]], int]:
        """Return the goals of a group that begins there, and what comes after the last."""
        motion = self.others.motion
        if isinstance(motion, (SocialForcePeople, OrcaPeople)):
            goals = motion.goals or self._goals(place, motion)
            return [(motion.pause, x, y) for x, y in goals], GO_ON if motion.loop else STAND
        if isinstance(motion, Waypoints):
            return [], GO_ON if motion.loop else STAND
        ends = motion.at_walls if isinstance(motion, ConstantVelocity) else getattr(motion, "ends", "stand")
        return [], GO_ON if ends == "go-on" else STAND

    def _goals(self, place: Point, motion: SocialForcePeople | OrcaPeople) -> tuple[Point, ...]:
        """Return drawn goals."""
        goals: list[Point] = []
        for _ in range(motion.drawn_goals):
            place = self._goal(place)
            goals.append(place)
        back = goals[-2:0:-1] if motion.loop and self.is_way_free is not None else []
        return (*goals, *back)

    def _goal(self, before: Point) -> Point:
        """Return a goal that can be reached from the one before."""
        area, radius = self.others.area, self.others.radius
        assert area is not None
        for _ in range(_TRIES * _GROUP_TRIES):
            x, y = self.draws.point(area)
            if self.is_free(x, y, radius) and (self.is_way_free is None or self.is_way_free(*before, x, y, radius)):
                return x, y
        rule = f"a goal must have room for a radius of {radius:g} m, and a straight way to it, but in {area} none has"
        raise BadRequest(self.where, rule, "give goals, or an area that is free", slug="others-do-not-fit")

    def _places(self, first: int, size: int) -> list[Point]:
        """Return where a group begins, and take those places."""
        others = self.others
        if isinstance(others.motion, (Recorded, Waypoints)) and not others.places:
            return [(0.0, 0.0)] * size
        if others.places:
            return list(others.places[first : first + size])
        for _ in range(_GROUP_TRIES):
            n = len(self.discs)
            places = self._group_places(size)
            if places:
                return places
            del self.discs[n:]
        rule = f"{others.number} discs with a radius of {others.radius:g} m must find room, but {first} did in the area"
        remedy = "give fewer, smaller ones, smaller groups, or a larger area"
        raise BadRequest(self.where, f"{rule} {others.area}", remedy, slug="others-do-not-fit")

    def _group_places(self, size: int) -> list[Point]:
        """Return places for a group, near the first one; none if somebody found no room."""
        others, draws = self.others, self.draws
        area = others.area
        assert area is not None
        places: list[Point] = []
        for _ in range(size):
            box = area
            if places:
                wide = 1.5 * (2.0 * others.radius + GAP) * float(np.sqrt(size))
                x, y = places[0]
                box = (max(area[0], x - wide), max(area[1], y - wide), min(area[2], x + wide), min(area[3], y + wide))
            for _ in range(_TRIES):
                x, y = draws.point(box)
                if self._is_clear(x, y) and self.is_free(x, y, others.radius):
                    places.append((x, y))
                    self.discs.append((x, y, others.radius))
                    break
            else:
                return []
        return places

    def _is_clear(self, x: float, y: float) -> bool:
        reach = self.others.radius + GAP
        return all((x - ox) * (x - ox) + (y - oy) * (y - oy) >= (reach + r) * (reach + r) for ox, oy, r in self.discs)


def _fields_of(motion: SocialForcePeople | OrcaPeople) -> list[str]:
    """Return the fields that AGENT has, too."""
    return [name for name in type(motion).__slots__ if name in (AGENT.names or ())]


def _bounds(box: Box | None, radius: float) -> dict[str, float]:
    """Return the bounds of centres."""
    if box is None:
        return {}
    return {"x_low": box[0] + radius, "y_low": box[1] + radius, "x_high": box[2] - radius, "y_high": box[3] - radius}


def _along(motion: Waypoints, share: float) -> tuple[Point, list[Sequence[float]]]:
    """Return where on the way an agent begins that has gone this share of it, and its waypoints from there on."""
    points = motion.points
    legs = list(zip(points, points[1:] + points[:1] if motion.loop else points[1:], strict=False))
    lengths = [float(np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)) for a, b in legs]
    left = share * sum(lengths)
    for k, ((a, b), length) in enumerate(zip(legs, lengths, strict=True)):
        if left < length or (left == 0.0 and length > 0.0):
            place = (a[0] + (b[0] - a[0]) * left / length, a[1] + (b[1] - a[1]) * left / length)
            order = points[k + 1 :] + points[: k + 1] if motion.loop else points[k + 1 :]
            return place, [(motion.pause, x, y) for x, y in order]
        left -= length
    return points[0], [(motion.pause, x, y) for x, y in points]
