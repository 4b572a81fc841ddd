"""Others as a world file gives them: groups that move alike, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

from parcours.errors import BadRequest, require_known
from parcours_navigation.others.kinds import (
    MOTIONS,
    Motion,
    OrcaPeople,
    RandomWalk,
    Recorded,
    SocialForcePeople,
    Waypoints,
)
from parcours_navigation.others.ranges import (
    Box,
    Point,
    require_ordered,
    require_ranges,
    require_start,
    require_whole,
)
from parcours_navigation.others.tracks import read_tracks

LARGEST = 200
"""Most agents of one entry."""


@dataclass(frozen=True, slots=True)
class Others:
    """Some others that move in the same way."""

    motion: Motion
    number: int = 1
    radius: float = 0.3  # [m]
    speed: float = 1.29  # wanted [m/s]
    speed_spread: float = 0.0  # standard deviation of it; drawn speeds keep within three of them and above 0 [m/s]
    area: Box | None = None  # where they begin and drawn goals lie [m]
    places: tuple[Point, ...] = ()  # where they begin instead, one for each [m]
    group: int = 1  # the size of the groups they walk in; the last one may be smaller
    yields: float = 1.0  # share of the people that give way to the robot
    effort: float = 1.0  # ... and how much of the avoiding these do; 0.5 if the robot does the other half
    start: tuple[float, float] = (0.0, 0.0)  # each stands until a time drawn between these [s]
    only: tuple[int, ...] | None = None  # those of them that are there, by number from 0; all are drawn

    def __post_init__(self) -> None:
        ranges = {
            "number": (1, LARGEST, ""), "radius": (0.001, 100.0, "m"), "speed": (0.0, 100.0, "m/s"),
            "speed_spread": (0.0, 100.0, "m/s"), "group": (1, LARGEST, ""), "yields": (0.0, 1.0, ""),
            "effort": (0.0, 1.0, ""),
        }  # fmt: skip
        require_ranges(self, ranges)
        for name in ("number", "group"):
            require_whole(name, getattr(self, name))
        require_ordered("start", self.start, 1e6, "s")
        needs_start = not isinstance(self.motion, (Recorded, Waypoints))
        require_start(self.number, self.places, self.area, is_needed=needs_start)
        if self.only is not None and not set(self.only) <= set(range(int(self.number))):
            rule = f"it must list numbers of them, 0 to {self.number - 1:g}, but is {self.only!r}"
            raise BadRequest("others, only", rule, "write [0, 2]", slug="others-range")
        if isinstance(self.motion, Recorded) and self.number != len(self.motion.tracks.names):
            rule = f"it must be that of the tracks, {len(self.motion.tracks.names)}, but is {self.number}"
            raise BadRequest("others, number", rule, "leave it out", slug="others-range")
        if isinstance(self.motion, (SocialForcePeople, OrcaPeople)) and not (self.motion.goals or self.area):
            raise BadRequest(
                "others", "they must have goals", "give goals, or an area to draw them in", slug="others-range"
            )
        if isinstance(self.motion, RandomWalk) and not (self.motion.bounds or self.area):
            raise BadRequest(
                "others, bounds", "a random walk needs bounds", "give bounds or an area", slug="others-range"
            )
        if not isinstance(self.motion, Recorded) and self.fastest * 0.01 > 0.5 * self.radius:
            rule = f"in a tick of 0.01 s nobody may move more than half a radius, but {self.fastest:g} m/s is more"
            raise BadRequest("others, speed", rule, "give a lower speed or a larger radius", slug="others-range")

    @property
    def fastest(self) -> float:
        """No agent is ever faster [m/s]."""
        if isinstance(self.motion, Recorded):
            return self.motion.tracks.fastest
        hurry = self.motion.hurry if isinstance(self.motion, (SocialForcePeople, OrcaPeople)) else 1.0
        return hurry * (self.speed + 3.0 * self.speed_spread)


def read_others(entry: Mapping[str, Any], where: str = "others", folder: Path | None = None) -> Others:
    """Return the others that one entry of a world file describes: a motion's name, and values of it and of `Others`.

    Args:
        entry: as read from the file; numbers in SI units, lists where there are several.
        where: what errors call the entry.
        folder: where a file of tracks is looked for.

    Raises:
        BadRequest: a key is unknown, or a value is out of its range.

    >>> others = read_others({"number": 20, "motion": "social-force", "group": 4, "area": [0, 0, 8, 8]})
    >>> others.number, others.motion.relax
    (20, 0.54)
    >>> read_others({"number": 20, "motion": "social-forces"})
    Traceback (most recent call last):
    parcours.errors.BadRequest: others, motion: must be a known name, but 'social-forces' was given; did you mean \
'social-force'? Known: constant-velocity, waypoints, random-walk, recorded, social-force, orca [others-key]
    """
    named = entry.get("motion", "")
    require_known(str(named), tuple(MOTIONS), f"{where}, motion", slug="others-key")
    kind = MOTIONS[named]
    own = {each.name for each in fields(kind)}
    shared = {each.name for each in fields(Others)} - {"motion"}
    given: dict[str, Any] = {name: settled(value) for name, value in entry.items() if name != "motion"}
    for name in given:
        require_known(str(name), sorted(own | shared), f"{where}, key", slug="others-key")
    for each in fields(kind):
        if each.name not in given and each.default is MISSING and each.default_factory is MISSING:
            rule = f"others that move by {named} must have the key {each.name!r}, but these do not"
            raise BadRequest(where, rule, "add it: docs/others.md says what it is", slug="others-key")
    try:
        if kind is Recorded and isinstance(given.get("tracks"), str):
            given["tracks"] = read_tracks((folder or Path()) / given["tracks"])
            given.setdefault("number", len(given["tracks"].names))
        motion = kind(**{name: value for name, value in given.items() if name in own})
        return Others(motion, **{name: value for name, value in given.items() if name not in own})
    except BadRequest as error:
        at = error.where.replace("others", where, 1) if error.where.startswith("others") else error.where
        raise BadRequest(at, error.rule, error.remedy, slug=error.slug) from None
    except TypeError as error:
        remedy = "docs/others.md says what each key takes"
        raise BadRequest(where, f"its values must fit, but: {error}", remedy, slug="others-range") from None


def settled(value: object) -> object:
    """Return lists as tuples, within others, too."""
    return tuple(map(settled, value)) if isinstance(value, (list, tuple)) else value
