"""Indoor grounds: a corridor with clutter, two rooms and a doorway, an office.

┌──────────────────────────┐    ┌───────────┬───────────┐    ┌──────┬────────┬─────┐
│    ▒▒        ▒▒▒         │    │           │           │    │   ▒  │  ▒     │   ▒ │
│ S                     G  │    │  S         door    G  │    ├── ───┴── ─────┴─ ───┤
│          ▒▒▒      ▒▒     │    │           │           │    │ S                   │
└──────────────────────────┘    └───────────┴───────────┘    ├─── ──┬── ─────┬── ──┤
          corridor                       doorway             │  ▒   │ ▒      │G  ▒ │
                                                             └──────┴────────┴─────┘
"""

from __future__ import annotations

import itertools

import numpy as np

from parcours_navigation.ground.generators.site import Draw, Site, box, drawn, require
from parcours_navigation.ground.ground import lay_ground

_CORRIDOR, _DOORWAY, _OFFICE = 0x636F727269646F72, 0x646F6F72776179, 0x6F6666696365
"""Purposes of the generators' streams (ASCII for their names)."""


def corridor(
    seed: int, *, length: float = 12.0, width: float = 2.0, clutter: int = 4, depth: float = 0.6, radius: float = 0.25
) -> Site:
    """Return a straight corridor with boxes along its walls.

    Args:
        seed: of its random numbers.
        length: [m].
        width: [m].
        clutter: boxes, each from 0.3 to 1.2 m long, on either side.
        depth: how far a box stands out at most [m]; half of it at least.
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: a parameter is out of its range, or no such corridor lets the disc through.

    >>> site = corridor(7)
    >>> len(site.ground.solids), site.start[0] < site.goal[0]
    (4, True)
    """
    require("corridor", 0.01, 1e3, radius=radius, depth=depth)
    require("corridor", 2.0 * radius, 1e3, width=width)
    require("corridor", 4.0 * radius + 2.0, 1e3, length=length)
    require("corridor", 0, 1000, clutter=clutter)
    room = 2.0 * radius + 0.4  # kept free at both ends

    def draw(by: Draw) -> Site:
        boxes = []
        for _ in range(clutter):
            long, out = by.between(0.3, 1.2), by.between(0.5 * depth, depth)
            x = by.between(room, max(length - room - long, room + 0.01))
            y = 0.0 if by.chance(0.5) else width - out
            boxes.append(box(x, y, min(x + long, length - room), y + out))
        bounds = np.array([0.0, 0.0, length, width])
        start, goal = (radius + 0.2, 0.5 * width, 0.0), (length - radius - 0.2, 0.5 * width)
        return Site(lay_ground(solids=boxes, bounds=bounds), start, goal, bounds)

    return drawn("corridor", seed, _CORRIDOR, radius, draw)


def doorway(
    seed: int, *, length: float = 8.0, width: float = 4.0, door: float = 1.0, wall: float = 0.1, radius: float = 0.25
) -> Site:
    """Return two rooms with a door between them; the door's place, start and goal are drawn.

    Args:
        seed: of its random numbers.
        length: of both rooms together [m].
        width: [m].
        door: how wide it is [m].
        wall: how thick the wall is [m].
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: a parameter is out of its range.

    >>> len(doorway(7).ground.solids)
    2
    """
    require("doorway", 0.01, 1e3, radius=radius, wall=wall)
    require("doorway", 2.4 * radius, 1e3, door=door)
    require("doorway", door + 0.02, 1e3, width=width)
    require("doorway", 8.0 * radius + wall, 1e3, length=length)

    def draw(by: Draw) -> Site:
        left, low = 0.5 * (length - wall), by.between(0.01, width - door - 0.01)
        bounds = np.array([0.0, 0.0, length, width])
        parts = [box(left, 0.0, left + wall, low), box(left, low + door, left + wall, width)]
        off = 1.5 * radius
        start = (by.between(off, left - off), by.between(off, width - off), 0.0)
        goal = (by.between(left + wall + off, length - off), by.between(off, width - off))
        return Site(lay_ground(solids=parts, bounds=bounds), start, goal, bounds)

    return drawn("doorway", seed, _DOORWAY, radius, draw)


def office(
    seed: int, *, rooms: int = 4, length: float = 16.0, room: float = 4.0, corridor: float = 2.0, door: float = 1.0,
    desks: int = 1, radius: float = 0.25,
) -> Site:  # fmt: skip
    """Return rooms of drawn width on both sides of a corridor, each with a door to it and desks; the goal is in one.

    Args:
        seed: of its random numbers.
        rooms: on each side.
        length: of the corridor [m].
        room: how deep the rooms are [m].
        corridor: how wide it is [m].
        door: how wide doors are [m].
        desks: in each room, up to 1.4 m x 0.7 m.
        radius: a disc of this size gets to the goal [m].

    Raises:
        BadGround: a parameter is out of its range, or no such office lets the disc through.

    >>> len(office(7).ground.segments)
    22
    """
    require("office", 0.01, 1e3, radius=radius)
    require("office", 2.4 * radius, 1e3, door=door, corridor=corridor)
    require("office", 1, 100, rooms=rooms)
    require("office", 0, 100, desks=desks)
    require("office", 2.0, 1e3, room=room)
    require("office", rooms * (2.0 * door + 1.0), 1e3, length=length)
    high = 2.0 * room + corridor

    def draw(by: Draw) -> Site:
        walls, tables, places = [], [], []
        for side in range(2):
            front, back = (room, 0.0) if side == 0 else (room + corridor, high)
            even = length / rooms
            cuts = [0.0, *((i + by.between(-0.2, 0.2)) * even for i in range(1, rooms)), length]
            for x0, x1 in itertools.pairwise(cuts):
                gap = by.between(x0 + 0.2, x1 - 0.2 - door)
                walls += [[x0, front, gap, front], [gap + door, front, x1, front]]
                if x1 < length:
                    walls.append([x1, front, x1, back])
                low, top = min(front, back), max(front, back)
                for _ in range(desks):
                    wide, deep = by.between(0.8, 1.4), by.between(0.5, 0.7)
                    x, y = by.between(x0 + 0.05, x1 - wide - 0.05), by.between(low + 0.05, top - deep - 0.05)
                    tables.append(box(x, y, x + wide, y + deep))
                places.append((by.between(x0 + 0.5, x1 - 0.5), by.between(low + 0.5, top - 0.5)))
        bounds = np.array([0.0, 0.0, length, high])
        start = (radius + 0.2, room + 0.5 * corridor, 0.0)
        return Site(lay_ground(walls, solids=tables, bounds=bounds), start, places[by.below(len(places))], bounds)

    return drawn("office", seed, _OFFICE, radius, draw)
