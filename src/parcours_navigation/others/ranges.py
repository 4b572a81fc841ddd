"""Checks of numbers, points and boxes given for others; what they raise says what was given, and the range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

from parcours.errors import BadRequest

Point = tuple[float, float]
Box = tuple[float, float, float, float]
"""x_low, y_low, x_high, y_high [m]."""

_FAR = 1e5
_OTHERS = ("others", "others-range")


def require_within(
    what: str, value: object, low: float, high: float, unit: str = "", of: tuple[str, str] = _OTHERS
) -> None:
    """Raise BadRequest unless the value is a number from low to high; `of` is whose it is, and the slug."""
    span = f"{low:g} to {high:g} {unit}".rstrip()
    if isinstance(value, str):  # of a world file: a misspelt input
        rule = f"it must be a number from {span}, but is {value!r}"
        _refuse(what, rule, "give one, or an input that `data` declares", of)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        _refuse(what, f"it must be a number from {span}, but is {value!r}", of=of)
    if not low <= value <= high:
        _refuse(what, f"it must lie in {span}, but is {value:g}", of=of)


def _refuse(
    what: str, rule: str, remedy: str = "give a number in that range", of: tuple[str, str] = _OTHERS
) -> NoReturn:
    where, slug = of
    raise BadRequest(f"{where}, {what}", rule, remedy, slug=slug)


def require_points(what: str, points: object) -> None:
    """Raise BadRequest unless each point is two numbers of at most 1e5 m."""
    if not isinstance(points, tuple):
        _refuse(what, f"it must be a list of points, but is {points!r}", "write [[x, y], ...]")
    for k, point in enumerate(points, 1):
        if not isinstance(point, tuple) or len(point) != 2:
            _refuse(f"{what}, point {k}", f"a point must be two numbers x, y, but is {point!r}", "write [x, y]")
        for name, value in zip("xy", point, strict=True):
            require_within(f"{what}, point {k}, {name}", value, -_FAR, _FAR, "m")


def require_start(number: float, places: tuple[Point, ...], area: Box | None, *, is_needed: bool = True) -> None:
    """Raise BadRequest unless the places or the area say where each of the others begins."""
    require_points("places", places)
    if places and len(places) != number:
        rule = f"there must be a place for each, but {len(places)} are given for {number}"
        _refuse("places", rule, "give as many, or an area")
    if area is not None:
        require_box("area", area)
    elif is_needed and not places:
        rule = "they must begin somewhere, but have neither an area nor places, and the ground has no bounds"
        raise BadRequest("others", rule, "give them an area or places, or give the ground bounds", slug="others-range")


def require_box(what: str, box: object, of: tuple[str, str] = _OTHERS) -> None:
    """Raise BadRequest unless the box is four numbers in order; `of` as in `require_within`."""
    if not isinstance(box, tuple) or len(box) != 4:
        _refuse(what, f"it must be x_low, y_low, x_high, y_high, but is {box!r}", "write four numbers", of)
    for value in box:
        require_within(what, value, -_FAR, _FAR, "m", of)
    if not (box[0] < box[2] and box[1] < box[3]):
        rule = f"its lower corner must be below and left of its upper one, but is {box!r}"
        _refuse(what, rule, "give x_low, y_low, x_high, y_high", of)


def require_ordered(what: str, pair: object, high: float, unit: str, low: float = 0.0) -> None:
    """Raise BadRequest unless the pair is low <= first <= second <= high."""
    if not isinstance(pair, tuple) or len(pair) != 2:
        _refuse(what, f"it must be two numbers, but is {pair!r}", "write [least, greatest]")
    for value in pair:
        require_within(what, value, low, high, unit)
    if pair[0] > pair[1]:
        _refuse(what, f"the first must not be above the second, but is {pair!r}", "exchange them")


def require_ranges(motion: object, ranges: Mapping[str, tuple[float, float, str]]) -> None:
    """Raise BadRequest unless each named attribute lies in its range: least, greatest, unit."""
    for name, (low, high, unit) in ranges.items():
        require_within(name, getattr(motion, name), low, high, unit)


def require_whole(what: str, value: float) -> None:
    """Raise BadRequest unless the number is whole."""
    if value != int(value):
        _refuse(what, f"it must be a whole number, but is {value:g}", "round it")
