"""One campaign, bit by bit the same: any order, any shards."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.run.campaign import run_campaign
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study

CASES, SEED = 65, 11
"""More cases than the largest shard holds, and one of each kind several times."""

SHARDS = (1, 7, 64)


@functools.cache
def study(schedule: str) -> SystemStudy:
    return system_study(schedule, seed=SEED)


@functools.cache
def facts(schedule: str) -> NDArray[np.void]:
    return study(schedule)(0, CASES)


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_cases_run_forwards_backwards_shuffled_or_alone_have_the_same_bits(schedule: str) -> None:
    numbers, whole = np.arange(CASES), facts(schedule)
    orders = [numbers[::-1], np.random.default_rng(1).permutation(numbers), numbers.repeat(2)[::-2]]
    for order in orders:
        assert study(schedule).run(order).tobytes() == whole[order].tobytes()
    alone = np.concatenate([study(schedule)(int(number), 1) for number in numbers[::5]])
    assert alone.tobytes() == whole[::5].tobytes()


@pytest.mark.parametrize("shard_size", SHARDS)
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_a_campaign_in_shards_of_any_size_holds_the_same_bits(schedule: str, shard_size: int, tmp_path: Path) -> None:
    outcome = run_campaign(study(schedule), study(schedule).campaign(CASES, shard_size=shard_size), tmp_path, workers=1)
    assert outcome.store.load().tobytes() == facts(schedule).tobytes()
    assert len(list(tmp_path.iterdir())) == 1 + 2 * -(-CASES // shard_size)  # its description; shards and their sums


def test_the_bits_are_those_of_these_very_cases() -> None:
    # Or the comparisons would hold of anything.
    for schedule in SCHEDULES:
        assert len(set(facts(schedule)["t_end"].tolist())) > CASES // 3
        assert system_study(schedule, seed=SEED + 1)(0, CASES).tobytes() != facts(schedule).tobytes()
    assert facts("original").tobytes() != facts("guarded").tobytes()
    nudged = facts("guarded").copy()
    nudged["x"][7] = np.nextafter(nudged["x"][7], 9.0)
    assert nudged.tobytes() != facts("guarded").tobytes()
