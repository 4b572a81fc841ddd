"""Path modification: what each operator does to a path, and when it does nothing at all."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours.streams import start
from parcours_ramp.planner.messages import MAX_KNOTS, MODIFICATION, PATH, one
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.path_modification import (
    CHANGE,
    CROSSOVER,
    DELETE,
    INSERT,
    LONGEST_FOR_INSERT,
    MOVE,
    SWAP,
    applies,
    insert_knot,
    modify,
    remove_knot,
)

Knots = list[tuple[float, float]]

PARAMETERS = guarded()
START, GOAL = (0.3, 0.4), (1.9, 1.8)
seeds = st.integers(0, 2**32)
interiors = st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)), max_size=5, unique=True)


def path_of(knots: Knots) -> Record:
    path = one(PATH)
    path.n = len(knots)
    for k, (x, y) in enumerate(knots):
        path.x[k], path.y[k] = x, y
    return path


def knots_of(path: Record) -> Knots:
    return [(float(path.x[k]), float(path.y[k])) for k in range(int(path.n))]


def stream_of(seed: int) -> NDArray[np.uint64]:
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(seed), np.uint64(0), np.uint64(2))
    return stream


def modified(
    operator: int,
    interior: Knots,
    seed: int,
    second: Knots | None = None,
    direction: float = 0.5,
    distance: float = 1.0,
) -> list[Knots]:
    """Return what the operator makes of the path from START over the interior knots to GOAL."""
    request, first_child, second_child = one(MODIFICATION), one(PATH), one(PATH)
    request.operator = operator
    request.first = path_of([START, *interior, GOAL])
    request.second = path_of([START, *(second or []), GOAL])
    request.direction, request.distance = direction, distance
    n = modify(request, PARAMETERS.record(), stream_of(seed), first_child, second_child)
    assert knots_of(request.first) == [START, *interior, GOAL]
    return [knots_of(child) for child in (first_child, second_child)[:n]]


@given(seeds, interiors)
def test_insert_adds_one_knot_away_from_the_others_and_leaves_those_as_they_are(seed: int, interior: Knots) -> None:
    assume(len(interior) + 2 < LONGEST_FOR_INSERT)
    before = [START, *interior, GOAL]
    [after] = modified(INSERT, interior, seed)
    assert len(after) == len(before) + 1
    assert [knot for knot in after if knot in before] == before
    [new] = [knot for knot in after if knot not in before]
    assert after[0] == START
    assert after[-1] == GOAL
    assert all(0.0 <= side <= PARAMETERS.arena for side in new)
    assert min(math.dist(new, knot) for knot in before) >= PARAMETERS.operator_distance


@given(seeds, interiors)
def test_delete_takes_out_one_interior_knot(seed: int, interior: Knots) -> None:
    assume(interior)
    before = [START, *interior, GOAL]
    [after] = modified(DELETE, interior, seed)
    assert after in [before[:k] + before[k + 1 :] for k in range(1, len(before) - 1)]


@given(seeds, interiors)
def test_change_moves_one_interior_knot_away_from_the_others(seed: int, interior: Knots) -> None:
    assume(interior)
    before = [START, *interior, GOAL]
    [after] = modified(CHANGE, interior, seed)
    assert len(after) == len(before)
    changed = [k for k in range(len(before)) if after[k] != before[k]]
    assert len(changed) == 1
    assert 0 < changed[0] < len(before) - 1
    others = [knot for k, knot in enumerate(after) if k != changed[0]]
    assert min(math.dist(after[changed[0]], knot) for knot in others) >= PARAMETERS.operator_distance


@given(seeds, interiors)
def test_swap_exchanges_two_interior_knots(seed: int, interior: Knots) -> None:
    assume(len(interior) > 1)
    before = [START, *interior, GOAL]
    [after] = modified(SWAP, interior, seed)
    assert sorted(after) == sorted(before)
    assert sum(a != b for a, b in zip(after, before, strict=True)) == 2
    assert (after[0], after[-1]) == (START, GOAL)


@given(seeds, interiors, interiors)
def test_crossover_gives_two_paths_of_the_head_of_one_and_the_tail_of_the_other(
    seed: int, interior: Knots, other: Knots
) -> None:
    one_parent, other_parent = [START, *interior, GOAL], [START, *other, GOAL]
    children = modified(CROSSOVER, interior, seed, other)
    assert len(children) == 2
    for child, head, tail in zip(children, (one_parent, other_parent), (other_parent, one_parent), strict=True):
        assert (child[0], child[-1]) == (START, GOAL)
        assert 2 <= len(child) <= MAX_KNOTS - 1
        assert any(
            child[:k] == head[:k] and _is_part(child[k:], tail[1:]) for k in range(1, len(child))
        )  # a tail that makes the path too long loses knots, never the goal


def _is_part(part: Knots, whole: Knots) -> bool:
    rest = iter(whole)
    return all(knot in rest for knot in part)


@given(seeds, interiors, st.floats(-math.pi, math.pi), st.floats(0.05, 3.0))
def test_move_puts_the_first_interior_knot_beside_the_obstacle_and_never_behind_it(
    seed: int, interior: Knots, direction: float, distance: float
) -> None:
    before = [START, *interior, GOAL]
    [after] = modified(MOVE, interior, seed, direction=direction, distance=distance)
    expected = before if interior else [START, GOAL, GOAL]
    assert len(after) == len(expected)
    assert after[2:] == expected[2:]
    x, y = after[1]
    assert 0.0 <= x <= PARAMETERS.arena
    assert 0.0 <= y <= PARAMETERS.arena
    inside = 0.0 < x < PARAMETERS.arena and 0.0 < y < PARAMETERS.arena
    if not inside:
        return  # pressed back to the arena's edge
    away = abs(math.remainder(math.atan2(y - START[1], x - START[0]) - direction, math.tau))
    if distance < 0.275 + PARAMETERS.robot_radius:
        assert away >= 0.5 * math.pi - 1e-9  # too near already: away from it
    else:
        assert away <= 0.5 * math.pi + 1e-9
        # The way to the new knot misses the obstacle's centre by more than the two bodies need.
        assert distance * math.sin(away) > 0.225 or distance * math.cos(away) < 0.0


@pytest.mark.parametrize(
    ("operator", "interior"),
    [(INSERT, 3), (INSERT, 5), (DELETE, 0), (CHANGE, 0), (SWAP, 0), (SWAP, 1)],
)
def test_an_operator_that_is_not_applicable_makes_nothing(operator: int, interior: int) -> None:
    knots = [(0.5 + 0.1 * k, 1.0) for k in range(interior)]
    assert not applies(operator, interior + 2)
    assert modified(operator, knots, 1) == []


def test_an_operator_is_called_applicable_exactly_when_it_makes_something() -> None:
    for operator in range(6):
        for n in range(2, 8):
            made = modified(operator, [(0.3 * k, 1.9 - 0.3 * k) for k in range(1, n - 1)], 4, [(1.0, 1.0)])
            assert applies(operator, n) == bool(made)


@given(seeds, interiors, st.integers(0, 6), st.integers(0, 4))
def test_taking_an_inserted_knot_out_again_restores_the_path(
    seed: int, interior: Knots, place: int, operator: int
) -> None:
    path = path_of([START, *interior, GOAL])
    before = knots_of(path)
    place = min(place, len(before))
    insert_knot(path, place, 9.0, 9.0)
    assert knots_of(path)[place] == (9.0, 9.0)
    remove_knot(path, place)
    assert knots_of(path) == before


def test_the_same_stream_makes_the_same_path_and_another_one_another() -> None:
    once, again, other = (modified(INSERT, [(1.0, 0.3)], seed) for seed in (5, 5, 6))
    assert once == again != other
