"""Numbered system cases: a start vector of the obstacles, blocks by Each Choice, values by seed, start times.

Case k belongs to abstract case k mod 9 and is its row k div 9; any case is built from (seed, number) alone. The start
vector says in which order the obstacles set out: 0 with the one before, 1 while it moves, 2 after it has stopped. The
stop durations of Table VII are drawn under that condition, so an obstacle that starts with another shares its duration.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from parcours.abtc import AbstractCase, abstract_cases
from parcours.data import Constraint, InputModel, parse_input_model
from parcours.data.compiled_drawing import Drawer
from parcours.data.constraints import allows, meets
from parcours.elementary import PI, atan2
from parcours.errors import BadRequest, require_known
from parcours.kernels import Record, kernel
from parcours.model import parse_model
from parcours.model.expression import parse_expression
from parcours.model.structure import Cefsm
from parcours.suite import Case, Plan, combine
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.cases.published import folder_of

Protocol = Literal["table-vii", "published"]
PROTOCOLS: tuple[Protocol, ...] = ("table-vii", "published")

STATIC = 1.0
"""All obstacles stand for this time first [s] (section VI-B)."""

TIME_LIMIT = 20.0
"""A test lasts this long [s] (section VI-B); see `SystemCases.end` from when on."""

WATCHED_ON = 40.0
"""An unfinished case is watched for this long beyond its end, for the true remaining time [s]; ours."""

LONGEST = 3600.0
"""Neither of them may be longer [s]."""

PUBLISHED_CASES = 905
"""As many cases as the paper ran."""

LONGEST_ARC, LONGEST_LINE = 5.0, 12.0
"""How long an obstacle of the published protocol moves [s]: an arc of at most pi radians, or a line."""

_N = 3
_TRIES = 100_000


FILES = {"model": Path(__file__).with_name("model.yaml"), "data": Path(__file__).with_name("domains.yaml")}
"""The model of the obstacles (Table VI), and the input domains (Table VII)."""


def obstacle_model() -> Cefsm:
    """Return the behavioural model of the three obstacles (Table VI)."""
    return parse_model(_text("model.yaml"), "cases/model.yaml")


@functools.cache
def input_model(
    protocol: Protocol = "table-vii", robot_radius: float = 0.125, obstacle_radius: float = 0.1
) -> InputModel:
    """Return the input domains of a protocol; obstacles keep apart by 0.2 m, or by their diameter if that is more."""
    name = "domains.yaml" if protocol == "table-vii" else "published.yaml"
    constants = {"least_distance": max(0.2, 2.0 * obstacle_radius)}
    if protocol == "table-vii":
        constants |= {"robot_radius": robot_radius, "obstacle_radius": obstacle_radius}
    return parse_input_model(_text(name), f"cases/{name}", constants)


@functools.cache
def start_cases() -> tuple[AbstractCase, ...]:
    """Return the nine abstract cases of three obstacles."""
    return tuple(abstract_cases(obstacle_model()))


@functools.cache
def _drawers(protocol: Protocol, robot_radius: float, obstacle_radius: float) -> tuple[Drawer, ...]:
    """Return what draws the values for each abstract case; one for all of them under the published protocol."""
    model = input_model(protocol, robot_radius, obstacle_radius)
    if protocol == "published":
        return (Drawer(model),)
    vectors = [case.start_vector for case in start_cases()]
    return tuple(Drawer(replace(model, constraints=(*model.constraints, *_order(vector)))) for vector in vectors)


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class SystemCases:
    """A numbered, endless family of system cases."""

    seed: int  # the campaign's seed
    # "table-vii" (the paper's domains, all nine start vectors) or "published" (the authors' generator and delays, five
    # start vectors)
    protocol: Protocol = "table-vii"
    robot_radius: float = 0.125  # [m]
    obstacle_radius: float = 0.1
    study: str = "navigation"  # the name with which their ids begin

    def __post_init__(self) -> None:
        require_known(self.protocol, PROTOCOLS, "protocol", slug="unknown-protocol")
        for name in ("robot_radius", "obstacle_radius"):
            radius = getattr(self, name)
            if not 0.0 < radius <= 0.5:
                rule = f"it must be above 0 and at most 0.5 m, but is {radius} m"
                raise BadRequest(f"system cases, {name}", rule, slug="radius-range")

    @property
    def inputs(self) -> InputModel:
        """The input model of these cases."""
        return input_model(self.protocol, self.robot_radius, self.obstacle_radius)

    def end(self, time_limit: float) -> float:
        """Return when a test of that length ends [s]; the published harness counts the static second in, ours does not.

        >>> SystemCases(0).end(20.0), SystemCases(0, "published").end(20.0)
        (21.0, 20.0)
        """
        return time_limit if self.protocol == "published" else STATIC + time_limit

    def vector(self, number: int) -> tuple[int, ...]:
        """Return the start vector of a case."""
        if self.protocol == "published":
            return folder_of(number).vector
        return start_cases()[number % len(start_cases())].start_vector

    def id(self, number: int) -> str:
        """Return the stable id of a case: study, abstract case, row.

        >>> SystemCases(0).id(10)
        'navigation/together-tp11.tp21.tp31-0.0.1/1'
        """
        if self.protocol == "published":
            return f"{self.study}/published-{folder_of(number).folder}/{number}"
        abstract = start_cases()[number % len(start_cases())]
        return f"{self.study}/{abstract.id}/{number // len(start_cases())}"

    def number(self, id: str) -> int | None:
        """Return the number of a case by its id, with or without the study, or by the number itself; None if unknown.

        >>> cases = SystemCases(0)
        >>> cases.number(cases.id(10)), cases.number("10"), cases.number("together-tp11.tp21.tp31-0.0.1/1")
        (10, 10, 10)
        """
        if id.isdecimal():
            return int(id) if len(id) < 16 else None
        abstract, _, row = "/".join(id.split("/")[-2:]).partition("/")
        if not (row.isdecimal() and len(row) < 16):
            return None
        if self.protocol == "published":
            return int(row) if self.id(int(row)).endswith(f"/{abstract}/{row}") else None
        ids = [case.id for case in start_cases()]
        return int(row) * len(ids) + ids.index(abstract) if abstract in ids else None

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the drawn values of the cases in the order of `inputs.names`, shape (n, n_inputs)."""
        model = self.inputs
        if self.protocol == "published":
            rows = np.zeros((len(numbers), len(model.domains)), np.int64)
            [drawer] = _drawers("published", self.robot_radius, self.obstacle_radius)
            return drawer.draw(rows, numbers, seed=self.seed)
        plan = self._plan(int(numbers.max(initial=0)) + 1)
        rows = plan.blocks(numbers)
        table = np.empty((len(numbers), len(model.domains)))
        drawers = _drawers("table-vii", self.robot_radius, self.obstacle_radius)
        for a, (abstract, drawer) in enumerate(zip(start_cases(), drawers, strict=True)):
            where = np.flatnonzero(numbers % len(drawers) == a)
            drawn = drawer.draw(rows[where], numbers[where], seed=self.seed, tries=_TRIES)
            for i, leader in enumerate(_leaders(abstract.start_vector)):
                drawn[:, model.names.index(f"ds{i + 1}")] = drawn[:, model.names.index(f"ds{leader + 1}")]
            table[where] = drawn
        return table

    @property
    def period(self) -> int:
        """By how much numbers differ of cases that set out in the same order."""
        return PUBLISHED_CASES if self.protocol == "published" else len(start_cases())

    def settled(
        self, values: NDArray[np.float64], numbers: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return what these cases make of drawn values, shape (n, n_inputs), and whether they take them, shape (n,)."""
        met = allows(self.inputs, values)
        if self.protocol == "published":
            return values, met
        names, found = self.inputs.names, values.copy()
        for a, abstract in enumerate(start_cases()):
            where = np.flatnonzero(numbers % len(start_cases()) == a)
            columns = {name: values[where, k] for k, name in enumerate(names)}
            for rule in _order(abstract.start_vector) if len(where) else ():
                met[where] &= meets(rule, columns)
            for i, leader in enumerate(_leaders(abstract.start_vector)):
                found[where, names.index(f"ds{i + 1}")] = columns[f"ds{leader + 1}"]
        return found, met

    def _plan(self, n_cases: int) -> Plan:
        ids = [abstract.id for abstract in start_cases()]
        return combine(self.study, ids, self.inputs, seed=self.seed, n_cases=n_cases)

    def suite(self, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases as files keep them; by default as many as Each Choice needs for every abstract case."""
        names = self.inputs.names
        total = n_cases if n_cases is not None else 3 * len(start_cases())
        for first in range(0, total, 1024):
            numbers = np.arange(first, min(first + 1024, total))
            for number, values in zip(numbers.tolist(), self.values(numbers), strict=True):
                study, abstract, row = self.id(number).split("/")
                yield Case(study, number, abstract, int(row), names, tuple(values.tolist()), 20.0, self.seed)

    def obstacles(self, numbers: NDArray[np.int64]) -> Record:
        """Return the cases as an array of OBSTACLE, shape (n, 3): where they stand, how and when they move."""
        names = list(self.inputs.names)
        values = self.values(numbers)
        column = {name: values[:, k] for k, name in enumerate(names)}
        x, y, v, w = (np.stack([column[f"{p}{i}"] for i in (1, 2, 3)], axis=1) for p in ("x", "y", "v", "w"))
        if self.protocol == "published":
            waits = np.array([folder_of(int(n)).delays for n in numbers], dtype=float).reshape(len(numbers), _N)
            turning = np.abs(w) > 0.01
            lasts = np.where(turning, np.minimum(LONGEST_ARC, PI / np.maximum(np.abs(w), 0.01)), LONGEST_LINE)
        else:
            waits, lasts = (np.stack([column[f"{p}{i}"] for i in (1, 2, 3)], axis=1) for p in ("ds", "dm"))
        obstacles = np.zeros((len(numbers), _N), OBSTACLE)
        obstacles["radius"] = self.obstacle_radius
        obstacles["speed"], obstacles["turn"] = v, w
        obstacles["start"] = np.rint((STATIC + waits) * 1e9).astype(np.int64)
        obstacles["stop"] = np.rint((STATIC + waits + lasts) * 1e9).astype(np.int64)
        if self.protocol == "published":  # the harness reports a waiting obstacle with its full speed and yaw rate
            obstacles["announced"] = obstacles["start"] - round(STATIC * 1e9)
        _place(x, y, obstacles)
        return obstacles


@dataclass(frozen=True, slots=True)
class GivenCases(SystemCases):
    """Cases whose values are given instead of drawn, in any order of setting out; what is not given is drawn."""

    given: Mapping[int, tuple[float, ...]] = field(default_factory=dict, hash=False)  # by the number of the case

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the values of the cases, shape (n, n_inputs): case 0 is asked for to compile, given or not."""
        return given_or_drawn(numbers, self.given, partial(SystemCases.values, self))


def given_or_drawn(
    numbers: NDArray[np.int64],
    given: Mapping[int, tuple[float, ...]],
    draw: Callable[[NDArray[np.int64]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the values of cases, shape (n, n_inputs): those given by number, or what `draw` returns."""
    missing = np.array([number for number in numbers.tolist() if number not in given], np.int64)
    table = {**given, **dict(zip(missing.tolist(), draw(missing), strict=True))} if len(missing) else given
    return np.array([table[number] for number in numbers.tolist()])


@kernel
def _place(x: Record, y: Record, obstacles: Record) -> None:
    """Put each obstacle at (x, y), heading at the robot's start in the origin."""
    for k in range(obstacles.shape[0]):
        for i in range(obstacles.shape[1]):
            obstacles[k, i].x0, obstacles[k, i].y0 = x[k, i], y[k, i]
            obstacles[k, i].heading0 = atan2(-y[k, i], -x[k, i])


def _leaders(vector: tuple[int, ...]) -> list[int]:
    """Return for each obstacle the first of those that start together with it."""
    leaders: list[int] = []
    for i in range(len(vector)):
        leaders.append(leaders[i - 1] if i and vector[i] == vector[i - 1] else i)
    return leaders


@functools.cache
def _order(vector: tuple[int, ...]) -> tuple[Constraint, ...]:
    """Return the constraints on stop and move durations that put the obstacles in the order of the start vector."""
    rules, leaders = [], _leaders(vector)
    for i in range(1, len(vector)):
        offset = vector[i] - vector[i - 1]
        before, moves, this = f"ds{leaders[i - 1] + 1}", f"dm{i}", f"ds{i + 1}"
        if offset == 1:
            rules.append((f"starts_{i + 1}_while_{i}_moves", f"{before} < {this} && {this} < {before} + {moves}"))
        elif offset == 2:
            rules.append((f"starts_{i + 1}_after_{i}_stopped", f"{this} >= {before} + {moves}"))
    return tuple(
        Constraint(name, parse_expression(text, "start vector"), "order of the start vector") for name, text in rules
    )
