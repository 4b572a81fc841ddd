"""Grounds strewn with obstacles: random cylinders, worlds as in BARN, a warehouse of shelves.

BARN (Perille, Truong, Xiao, Stone, Benchmarking Metric Ground Navigation, 2020, arXiv 2008.13315) has 300 worlds of
30 x 30 cells of 0.15 m: cells are filled at random and smoothed by a cellular automaton, with twelve sets of fill rate
and iterations; a filled cell holds a cylinder of 0.075 m radius. Worlds of `barn` are made like that, but are not those
of the published set: the numbers are drawn here, and rules and sets are ours where the paper leaves them open.

      ● ● ·   A cell with at least FILLS of its 8 neighbours filled is filled next, one with at most CLEARS is
      ● ? ·   empty, others stay. Outside of the field nothing is filled.
      · ● ●
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours.streams import Stream, between
from parcours_navigation.ground.generators.site import Draw, Site, box, drawn, require
from parcours_navigation.ground.ground import lay_ground
from parcours_navigation.ground.outlines import BadGround

_CYLINDERS, _BARN, _WAREHOUSE = 0x63796C696E646572, 0x6261726E, 0x77617265686F7573
"""Purposes of the generators' streams (ASCII for their names)."""

FILLS, CLEARS = 5, 1

BARN_SETS = tuple((fill, smoothing) for fill in (0.16, 0.2, 0.24, 0.28) for smoothing in (2, 3, 4))
"""Fill rate and iterations of the 300 worlds, 25 each."""

BARN_WORLDS = 300


def cylinders(
    seed: int, *, n: int = 20, size: float = 8.0, least: float = 0.1, most: float = 0.4, gap: float = 0.0,
    radius: float = 0.25,
) -> Site:  # fmt: skip
    """Return a square with cylinders at random places, which keep off start and goal in opposite corners.

    Args:
        seed: of its random numbers.
        n: cylinders.
        size: side of the square [m].
        least: smallest radius of a cylinder [m].
        most: largest [m].
        gap: between any two of them at least [m]; below 0 they may overlap. One that finds no room is left out.
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: a parameter is out of its range, or no such field lets the disc through.

    >>> len(cylinders(7).ground.discs)
    20
    """
    require("cylinders", 0, 5000, n=n)
    require("cylinders", 0.01, 1e3, radius=radius, least=least)
    require("cylinders", least, 1e3, most=most)
    require("cylinders", -1e3, 1e3, gap=gap)
    require("cylinders", 8.0 * radius, 1e3, size=size)
    near = 2.0 * radius  # start and goal from the walls

    def draw(by: Draw) -> Site:
        discs = np.empty((n, 3))
        count = _strew(by.stream, size, least, most, gap, near, discs)
        bounds = np.array([0.0, 0.0, size, size])
        start, goal = (near, near, 0.25 * np.pi), (size - near, size - near)
        return Site(lay_ground(discs=discs[:count], bounds=bounds), start, goal, bounds)

    return drawn("cylinders", seed, _CYLINDERS, radius, draw, 20 * n)


@kernel
def _strew(stream: Stream, size: float, least: float, most: float, gap: float, near: float, discs: Record) -> int:
    """Fill in discs, shape (n, 3), in at most 20 n tries, and return how many found room."""
    count = 0
    for _ in range(20 * len(discs)):
        if count == len(discs):
            break
        x, y, r = between(stream, 0.0, size), between(stream, 0.0, size), between(stream, least, most)
        far_x, far_y = x - size + near, y - size + near
        ends = np.sqrt(min((x - near) * (x - near) + (y - near) * (y - near), far_x * far_x + far_y * far_y))
        fits = ends - r > near
        for k in range(count):
            to_x, to_y = discs[k, 0] - x, discs[k, 1] - y
            if not fits or np.sqrt(to_x * to_x + to_y * to_y) - discs[k, 2] - r < gap:
                fits = False
                break
        if fits:
            discs[count, 0], discs[count, 1], discs[count, 2] = x, y, r
            count += 1
    return count


def smoothed(filled: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the next state of the cellular automaton.

    >>> smoothed(np.ones((3, 3), bool)).astype(int).tolist()
    [[1, 1, 1], [1, 1, 1], [1, 1, 1]]
    """
    framed = np.pad(filled, 1).astype(np.int64)
    rows, columns = filled.shape
    around = sum(framed[i : i + rows, j : j + columns] for i in range(3) for j in range(3)) - filled
    return (around >= FILLS) | (filled & (around > CLEARS))


def barn(
    seed: int, *, fill: float = 0.2, smoothing: int = 3, rows: int = 30, columns: int = 30, cell: float = 0.15,
    apron: float = 1.0, radius: float = 0.25,
) -> Site:  # fmt: skip
    """Return a field of cylinders in a grid, made by a cellular automaton; the way leads across it, from left to right.

    Args:
        seed: of its random numbers.
        fill: share of the cells that are filled at first.
        smoothing: iterations of the automaton.
        rows: of the grid.
        columns: ...
        cell: side of a cell, diameter of a cylinder [m].
        apron: free ground on both sides of the field, with start and goal in the middle [m].
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: a parameter is out of its range, or no such field lets the disc through.

    >>> site = barn(7)
    >>> bool((site.ground.discs[:, 2] == 0.075).all())
    True
    """
    require("barn", 0.0, 1.0, fill=fill)
    require("barn", 0, 100, smoothing=smoothing)
    require("barn", 1, 500, rows=rows, columns=columns)
    require("barn", 0.01, 100.0, cell=cell, radius=radius)
    require("barn", 2.5 * radius, 1e3, apron=apron)

    def draw(by: Draw) -> Site:
        filled = by.chances(fill, rows * columns).reshape(rows, columns)
        for _ in range(smoothing):
            filled = smoothed(filled)
        row, column = np.nonzero(filled)
        half = np.full(len(row), 0.5 * cell)
        discs = np.column_stack([(column + 0.5) * cell, (row + 0.5) * cell, half])
        bounds = np.array([-apron, 0.0, columns * cell + apron, rows * cell])
        start, goal = (-0.5 * apron, 0.5 * rows * cell, 0.0), (columns * cell + 0.5 * apron, 0.5 * rows * cell)
        return Site(lay_ground(discs=discs, bounds=bounds), start, goal, bounds)

    return drawn("barn", seed, _BARN, radius, draw, rows * columns)


def barn_world(number: int, *, seed: int = 0, radius: float = 0.25) -> Site:
    """Return one of 300 worlds like those of BARN: 25 of each of BARN_SETS, sparse ones first.

    Args:
        number: 0 to 299.
        seed: of the set of worlds, 0 <= seed < 2**32.
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: the number or seed is out of its range, or no such world lets the disc through.
    """
    if number not in range(BARN_WORLDS):
        raise BadGround("barn", f"worlds have whole numbers from 0 to 299, but {number} was given", slug="ground-range")
    require("barn", 0, 2**32 - 1, seed=seed)
    fill, smoothing = BARN_SETS[number * len(BARN_SETS) // BARN_WORLDS]
    return barn(seed * BARN_WORLDS + number, fill=fill, smoothing=smoothing, radius=radius)


def warehouse(
    seed: int, *, rows: int = 4, columns: int = 3, shelf: float = 3.0, depth: float = 0.8, aisle: float = 1.5,
    missing: float = 0.1, radius: float = 0.25,
) -> Site:  # fmt: skip
    """Return rows of shelves with aisles between and around them, some missing; the way leads from left to right.

    Args:
        seed: of its random numbers.
        rows: of shelves.
        columns: ...
        shelf: how long one is [m].
        depth: [m].
        aisle: how wide aisles are [m].
        missing: share of the shelves that are not there.
        radius: a disc of this size gets through [m].

    Raises:
        BadGround: a parameter is out of its range.

    >>> len(warehouse(7, missing=0.0).ground.solids)
    12
    """
    require("warehouse", 1, 100, rows=rows, columns=columns)
    require("warehouse", 0.01, 1e3, radius=radius, shelf=shelf, depth=depth)
    require("warehouse", 2.4 * radius, 1e3, aisle=aisle)
    require("warehouse", 0.0, 1.0, missing=missing)
    wide, high = aisle + columns * (shelf + aisle), aisle + rows * (depth + aisle)

    def draw(by: Draw) -> Site:
        shelves = []
        for row in range(rows):
            for column in range(columns):
                x, y = aisle + column * (shelf + aisle), aisle + row * (depth + aisle)
                if not by.chance(missing):
                    shelves.append(box(x, y, x + shelf, y + depth))
        bounds = np.array([0.0, 0.0, wide, high])
        off = 0.5 * aisle
        start, goal = (off, by.between(off, high - off), 0.0), (wide - off, by.between(off, high - off))
        return Site(lay_ground(solids=shelves, bounds=bounds), start, goal, bounds)

    return drawn("warehouse", seed, _WAREHOUSE, radius, draw)
