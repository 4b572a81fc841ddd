"""The time window of each event under bounds between events, or the bounds that contradict each other.

This is a simple temporal network (Dechter, Meiri & Pearl, Temporal constraint networks, Artificial Intelligence 49,
1991): shortest paths by Bellman-Ford, a contradiction is a cycle of negative length. Bounds are pairs (number,
strict or not) of exact fractions, as in the zones of timed automata, so that x < 5 and x <= 5 are not confused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """One bound: `later` comes at most `most` seconds after `earlier`, or less than that if it is strict.

    A negative `most` says that `later` comes before, by at least so much. `why` names what says so.
    """

    earlier: int
    later: int
    most: Fraction
    strict: bool = False
    why: str = ""


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """When an event can happen [s]: `latest` is None without a limit; an open end is not reached itself."""

    earliest: Fraction
    latest: Fraction | None
    opens: bool = False
    closes: bool = False

    def __str__(self) -> str:
        left, right = "(" if self.opens else "[", ")" if self.closes or self.latest is None else "]"
        latest = "inf" if self.latest is None else f"{float(self.latest):g}"
        return f"{left}{float(self.earliest):g}, {latest}{right} s"


@dataclass(frozen=True, slots=True)
class Windows:
    """When events can happen.

    Attributes:
        windows: when each can, counted from the start.
        gaps: how long after the event before it each can, where the bounds say that it comes after; not for the first.
        times: times for all of them together [s], early ones, that keep every bound.
    """

    windows: tuple[TimeWindow, ...]
    gaps: tuple[TimeWindow, ...]
    times: tuple[Fraction, ...]


# A bound "later - earlier <= most" is an arc of length `most` from earlier to later; node 0 is the start at 0 s.
#
#           at most 5                "at least 2" is an arc backwards, of length -2
#     (1) ------------> (2)          the shortest way 0 -> e is the latest time of e; minus the shortest way e -> 0 the
#         <------------              earliest; a cycle of negative length is a contradiction, e.g. at most 1 and at
#          at least 2: -2            least 2: 1 - 2 < 0
def windows_of(n_events: int, limits: Sequence[TimeLimit]) -> Windows | tuple[TimeLimit, ...]:
    """Return when each event can happen, or a cycle of bounds that cannot hold together."""
    every = [*limits, *(TimeLimit(event, 0, Fraction(0), why="time starts at 0 s") for event in range(1, n_events))]
    # One integer orders like the pair: seconds in units of `scale`, times `wide`, less one for each strict bound.
    scale, wide = lcm(*(limit.most.denominator for limit in every), 1), n_events + 2
    arcs = [
        (limit.earlier, limit.later, int(limit.most * scale) * wide - limit.strict, place)
        for place, limit in sorted(enumerate(every), key=lambda pair: (pair[1].earlier, pair[1].later))
    ]
    cycle = _shortest([0] * n_events, arcs)[1]
    if cycle:
        return tuple(every[place] for place in cycle)
    from_start, backwards = _from(0, n_events, arcs), [(b, a, weight, place) for a, b, weight, place in arcs]
    to_start = _from(0, n_events, backwards)

    def window(least: int | None, most: int | None) -> TimeWindow:
        earliest, opens = _parts(-(least or 0), wide, up=False)
        latest, closes = (None, 0) if most is None else _parts(most, wide, up=True)
        shown = None if latest is None else Fraction(latest, scale)
        return TimeWindow(Fraction(earliest, scale), shown, bool(opens), bool(closes))

    reach = [from_start, *(_from(event, n_events, arcs) for event in range(1, n_events))]
    return Windows(
        tuple(window(below, above) for below, above in zip(to_start, from_start, strict=True)),
        tuple(window(reach[event][event - 1], reach[event - 1][event]) for event in range(1, n_events)),
        _early([-(each or 0) for each in to_start], every, scale, wide),
    )


Arc = tuple[int, int, int, int]


def _from(event: int, n_events: int, arcs: Sequence[Arc]) -> list[int | None]:
    """Return the least distance of each event from one."""
    begin: list[int | None] = [None] * n_events
    begin[event] = 0
    return _shortest(begin, arcs)[0]


def _shortest(begin: list[int | None] | list[int], arcs: Sequence[Arc]) -> tuple[list[int | None], list[int]]:
    """Return the least distance of each node from those that begin at 0, and the arcs of a negative cycle."""
    distance: list[int | None] = list(begin)
    came: list[Arc | None] = [None] * len(distance)
    for turn in range(len(distance) + 1):
        changed = -1
        # Events stand in order, so going over them there and back again settles most networks in a few turns.
        for arc in arcs if turn % 2 == 0 else reversed(arcs):
            start = distance[arc[0]]
            if start is None:
                continue
            end = distance[arc[1]]
            if end is None or start + arc[2] < end:
                distance[arc[1]], came[arc[1]], changed = start + arc[2], arc, arc[1]
        if changed < 0:
            return distance, []
    for _ in distance:
        changed = _back(came, changed)[0]
    cycle, node = [], changed
    while True:
        node, place = _back(came, node)
        cycle.append(place)
        if node == changed:
            return distance, cycle[::-1]


def _back(came: Sequence[Arc | None], node: int) -> tuple[int, int]:
    arc = came[node]
    assert arc is not None, "a node that still improves after this many rounds lies on a cycle"
    return arc[0], arc[3]


def _parts(length: int, wide: int, *, up: bool) -> tuple[int, int]:
    """Return the seconds in units of the scale, and how many strict bounds lie on the way."""
    whole = -(-length // wide) if up else length // wide
    return whole, abs(whole * wide - length)


def _early(lower: Sequence[int], limits: Sequence[TimeLimit], scale: int, wide: int) -> tuple[Fraction, ...]:
    """Return the earliest times, moved a little where the earliest itself is excluded."""
    parts = [_parts(length, wide, up=False) for length in lower]
    at = [Fraction(whole, scale) for whole, _ in parts]
    room = [each.most - at[each.later] + at[each.earlier] for each in limits]
    least = min((slack for slack in room if slack > 0), default=Fraction(1)) / (2 * wide)
    little = Fraction(1)
    while little > least:
        little /= 10
    return tuple(time + little * strict for time, (_, strict) in zip(at, parts, strict=True))
