"""The population: who is best, who is the same, and who may join in whose place."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours.streams import start
from parcours_ramp.planner.messages import MEMBER, PREDICTION, many, one
from parcours_ramp.planner.parameters import Parameters, guarded
from parcours_ramp.planner.planner_state import PLANNER
from parcours_ramp.planner.planning_cycle import is_known, offer_candidate
from parcours_ramp.planner.population import SAME_PATH, best_member, is_same


def member(direction: float, fitness: float, feasible: bool = True, id: int = 0) -> Record:
    """Return a member whose path leads a metre in that direction [rad] and then to (2, 2)."""
    made = one(MEMBER)
    made.id = id
    made.path.n = 3
    made.path.x[1], made.path.y[1] = math.cos(direction), math.sin(direction)
    made.path.x[2] = made.path.y[2] = 2.0
    made.trajectory.n = 1
    made.trajectory.fitness, made.trajectory.feasible = fitness, int(feasible)
    return made


def population(*members: Record) -> Record:
    made = many(MEMBER, 16)
    for k, each in enumerate(members):
        made[k] = each
        made[k].id = k + 1
    return made


def stream_of(seed: int) -> NDArray[np.uint64]:
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(seed), np.uint64(0), np.uint64(1))
    return stream


def offered(
    members: Record, n: int, candidate: Record, seed: int = 0, parameters: Parameters | None = None
) -> set[int]:
    """Offer the candidate, and return the ids of the members that were replaced (0: it was appended)."""
    planner = one(PLANNER)
    planner.members, planner.n, planner.candidate, planner.stream = members, n, candidate, stream_of(seed)
    planner.candidate.id = 99
    before = [int(members[k].id) for k in range(n)]
    if not is_known(planner):
        offer_candidate(planner, many(PREDICTION, 0), (parameters or guarded()).record())
    after_n = int(planner.n)
    after = [int(planner.members[k].id) for k in range(after_n)]
    assert after_n in (n, n + 1)
    assert after.count(99) <= 1
    return set(before) - set(after) if after_n == n else {0}


FITNESS = (0.05, 0.09, 0.02, 0.04, 0.07)


def five(feasible: tuple[bool, ...] = (True,) * 5) -> Record:
    rows = zip(range(5), FITNESS, feasible, strict=True)
    return population(*(member(0.3 * k, fitness, able) for k, fitness, able in rows))


@given(st.lists(st.floats(0.001, 1.0), min_size=1, max_size=16))
def test_the_best_member_is_the_fittest_and_the_first_of_equals(fitness: list[float]) -> None:
    members = population(*(member(0.1 * k, value) for k, value in enumerate(fitness)))
    assert best_member(members, len(fitness)) == fitness.index(max(fitness))


def test_whoever_is_offered_joins_a_population_that_is_not_full() -> None:
    assert offered(five(), 4, member(2.5, 1e-4, feasible=False)) == {0}


def test_a_path_that_is_there_already_does_not_join_however_fit_it_is() -> None:
    for n in (4, 5):
        assert offered(five(), n, member(0.3, 0.9)) == set()


def test_paths_are_the_same_if_all_knots_but_the_start_lie_within_five_centimetres() -> None:
    one_path, near, far = member(0.0, 0.1).path, member(0.0, 0.1).path, member(0.0, 0.1).path
    near.x[1] += 0.99 * SAME_PATH
    near.x[0] = 1.0
    far.x[1] += 1.01 * SAME_PATH
    assert is_same(one_path, near)
    assert not is_same(one_path, far)
    shorter = member(0.0, 0.1).path
    shorter.n = 2
    assert not is_same(one_path, shorter)


@given(st.integers(0, 2**32))
def test_the_best_is_never_replaced_and_one_other_always_is(seed: int) -> None:
    gone = offered(five(), 5, member(2.5, 0.001), seed)
    assert len(gone) == 1
    assert FITNESS.index(max(FITNESS)) + 1 not in gone


def test_the_worse_of_two_drawn_victims_goes_so_the_worst_goes_most_often() -> None:
    gone = [next(iter(offered(five(), 5, member(2.5, 0.5), seed))) for seed in range(800)]
    counts = {id: gone.count(id) for id in (1, 3, 4, 5)}
    assert sum(counts.values()) == 800
    order = sorted(counts, key=lambda id: FITNESS[id - 1])
    assert [counts[id] for id in order] == sorted(counts.values(), reverse=True)
    assert counts[order[0]] > 2 * counts[order[-1]]


def test_an_infeasible_candidate_never_enters_a_feasible_population() -> None:
    for seed in range(50):
        assert offered(five(), 5, member(2.5, 0.001, feasible=False), seed) == set()


@given(st.integers(0, 2**32))
def test_an_infeasible_candidate_replaces_only_infeasible_members(seed: int) -> None:
    gone = offered(five((True, True, False, True, False)), 5, member(2.5, 0.001, feasible=False), seed)
    assert gone <= {3, 5}


def test_an_infeasible_candidate_finds_its_victim_in_most_draws() -> None:
    members = [
        offered(five((True, True, False, True, False)), 5, member(2.5, 0.001, False), seed) for seed in range(50)
    ]
    assert sum(bool(gone) for gone in members) >= 45
