"""A failing case as data into a smaller one that fails for the same cause: fewer items, shorter times, round numbers.

Data is a tree of mappings, lists, numbers and texts, as a YAML file holds it. Items are left out by delta debugging
(Zeller, Hildebrandt, IEEE TSE 2002), list by list from the root (Misherghi, Su, ICSE 2006). The budget is a number of
re-runs, so that the same case is always reduced to the same one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from parcours.errors import ParcoursError

Data = Any
Path = tuple[str | int, ...]

_DECIMALS = (3, 2, 1, 0)


@dataclass(frozen=True, slots=True)
class CaseShape:
    """What of a case may change; keys are named wherever they stand in the tree."""

    lists: tuple[str, ...] = ()  # keys of lists whose items may be left out
    optional: tuple[str, ...] = ()  # keys that may be left out
    times: tuple[Path, ...] = ()  # numbers that are to be small
    zero: tuple[str, ...] = ()  # keys of numbers that may become 0
    fixed: tuple[str, ...] = ()  # keys under which nothing changes


@dataclass(frozen=True, slots=True)
class Reduced:
    """A case that cannot be made smaller, or not within the budget."""

    data: Data
    runs: int  # how often a case was run again
    complete: bool  # whether the budget sufficed


class _Spent(Exception):
    """The budget is used up."""


def reduce(data: Data, fails: Callable[[Data], bool], shape: CaseShape, budget: int) -> Reduced:
    """Return the smallest failing case that is found within a number of re-runs.

    Args:
        data: a case that fails; it is left as it is.
        fails: runs a case, and says whether it fails for the same cause. It raises ParcoursError, and costs nothing,
            where data make no case.
        shape: what may change.
        budget: most calls of `fails`.

    >>> shape = CaseShape(lists=("discs",), times=(("limit",),))
    >>> case = {"discs": [{"x": 0.3172}, {"x": 4.0451}, {"x": 1.5}], "limit": 60.0}
    >>> def fails(case):
    ...     return case["limit"] >= 7 and any(3 < disc["x"] < 5 for disc in case["discs"])
    >>> found = reduce(case, fails, shape, 99)
    >>> found.data, found.runs < 30, found.complete
    ({'discs': [{'x': 4}], 'limit': 7}, True, True)
    """
    reduction = _Reduction(data, fails, shape, budget)
    try:
        before = None
        while before != reduction.data:
            before = reduction.data
            reduction.leave_out()
            reduction.shorten()
            reduction.round_all([path for path in reduction.numbers() if path[-1] in shape.zero], None)
            for decimals in _DECIMALS:
                reduction.round_all([*reduction.numbers()], decimals)
    except _Spent:
        return Reduced(reduction.data, reduction.runs, False)
    return Reduced(reduction.data, reduction.runs, True)


class _Reduction:
    def __init__(self, data: Data, fails: Callable[[Data], bool], shape: CaseShape, budget: int) -> None:
        self.data, self.runs = data, 0
        self._fails, self._shape, self._budget = fails, shape, budget
        self._known = {_key(data): True}

    def _takes(self, candidate: Data) -> bool:
        """Return whether a candidate fails, too; if it does, go on from it."""
        key = _key(candidate)
        if key not in self._known:
            if self.runs >= self._budget:
                raise _Spent
            try:
                self._known[key] = self._fails(candidate)
                self.runs += 1
            except ParcoursError:
                self._known[key] = False
        if self._known[key]:
            self.data = candidate
        return self._known[key]

    def leave_out(self) -> None:
        """Leave out optional keys, and items of lists: all, halves, quarters ... single ones."""
        for optional in [path for path, _ in self._nodes() if path and path[-1] in self._shape.optional]:
            if _has(self.data, optional):
                self._takes(_without(self.data, optional))
        done: set[Path] = set()
        while (path := self._next_list(done)) is not None:
            done.add(path)
            size = len(_at(self.data, path))
            while size:
                first = 0
                while first < len(items := _at(self.data, path)):
                    if not self._takes(_with(self.data, path, items[:first] + items[first + size :])):
                        first += size
                size //= 2

    def _next_list(self, done: set[Path]) -> Path | None:
        lists = (path for path, node in self._nodes() if isinstance(node, list) and path[-1] in self._shape.lists)
        return next((path for path in lists if path not in done), None)

    def shorten(self) -> None:
        """Make times whole and small, by bisection, which finds the least if all longer ones fail, too."""
        for path in self._shape.times:
            least, most = 0, math.ceil(_at(self.data, path))
            if not self._takes(_with(self.data, path, most)):
                continue
            while most - least > 1:
                middle = (least + most) // 2
                if self._takes(_with(self.data, path, middle)):
                    most = middle
                else:
                    least = middle

    def numbers(self) -> Iterator[Path]:
        """Yield where numbers stand that may be rounded."""
        return (path for path, node in self._nodes() if isinstance(node, float) and math.isfinite(node))

    def round_all(self, paths: Sequence[Path], decimals: int | None) -> None:
        """Round numbers to a number of decimals, or to 0: together if that does, else half of them and half of them."""
        candidate = self.data
        for path in paths:
            candidate = _with(candidate, path, 0 if decimals is None else _rounded(_at(candidate, path), decimals))
        if not paths or self._takes(candidate) or len(paths) == 1:
            return
        self.round_all(paths[: len(paths) // 2], decimals)
        self.round_all(paths[len(paths) // 2 :], decimals)

    def _nodes(self) -> Iterator[tuple[Path, Data]]:
        return _walk(self.data, (), self._shape.fixed)


def _rounded(value: float, decimals: int) -> float | int:
    rounded = round(value, decimals)
    return int(rounded) if rounded == int(rounded) else rounded


def _walk(node: Data, path: Path, fixed: tuple[str, ...]) -> Iterator[tuple[Path, Data]]:
    yield path, node
    below = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, child in below:
        if key not in fixed:
            yield from _walk(child, (*path, key), fixed)


def _key(data: Data) -> str:
    return json.dumps(data, sort_keys=True)


def _at(data: Data, path: Path) -> Data:
    for key in path:
        data = data[key]
    return data


def _has(data: Data, path: Path) -> bool:
    try:
        _at(data, path)
    except (KeyError, IndexError):
        return False
    return True


def _with(data: Data, path: Path, value: Data) -> Data:
    """Return the tree with another value at a path; what is beside it is shared."""
    if not path:
        return value
    copy = data.copy()
    copy[path[0]] = _with(data[path[0]], path[1:], value)
    return copy


def _without(data: Data, path: Path) -> Data:
    holder = _at(data, path[:-1])
    return _with(data, path[:-1], {key: value for key, value in holder.items() if key != path[-1]})
