"""A busy machine turns no true pass into a fail, nor a true fail into a pass, more often than the bound says."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.run.noise import Noise
from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import judge, parse_bound

Times = NDArray[np.float64]
Machine = Callable[[np.random.Generator, int], Times]

TRIALS, REPEATS, PER_REPEAT = 300, 300, 8
ERROR = 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / TRIALS)
"""The stated error and three standard deviations of what so many trials show of it."""


def idle(rng: np.random.Generator, n: int) -> Times:
    """Next to nothing [ms]."""
    return np.full(n, 0.01)


def busy(rng: np.random.Generator, n: int) -> Times:
    """Always a little, exponential [ms]."""
    return rng.exponential(0.4, n)


def preempted(rng: np.random.Generator, n: int) -> Times:
    """Nearly one time in a hundred, a whole time slice [ms]."""
    return np.where(rng.random(n) < 0.009, 50.0, 0.01)


def hidden(rng: np.random.Generator, n: int) -> Times:
    """So rare that the samples just do not show it: the case the allowance is for [ms]."""
    return np.where(rng.random(n) < 0.0015, 50.0, 0.01)


def heavy(rng: np.random.Generator, n: int) -> Times:
    """A tail without variance [ms]."""
    return 0.02 * rng.pareto(1.2, n)


def bursts(rng: np.random.Generator, n: int) -> Times:
    """Quiet, but for spells that last some fifty samples and take 3 % of the time [ms]."""
    inside = np.zeros(n, dtype=bool)
    for start in np.flatnonzero(rng.random(n) < 0.03 / 50):
        inside[start : start + 50] = True
    return np.where(inside, rng.exponential(20.0, n), 0.01)


MACHINES = (idle, busy, preempted, hidden, heavy, bursts)


def just_good(rng: np.random.Generator, n: int) -> Times:
    """99 % of durations are 4.9 ms, the others far too long: p99 < 5 ms holds, by nothing."""
    return np.where(rng.random(n) < 0.01, 80.0, 4.9)


def near_good(rng: np.random.Generator, n: int) -> Times:
    """None is too long, and all nearly are: every < 5 ms holds."""
    return rng.uniform(4.5, 4.999, n)


def just_bad(rng: np.random.Generator, n: int) -> Times:
    """1.02 % of durations are 5.1 ms: p99 < 5 ms does not hold."""
    return np.where(rng.random(n) < 0.0102, 5.1, 4.9)


def verdicts(true: Machine, machine: Machine, bound: str, seed: int, *, told: bool = True) -> Counter[Verdict]:
    """Judge many runs: PER_REPEAT samples of noise, then a repeat, which meets the same machine, and so on."""
    rng = np.random.default_rng(seed)
    asked = parse_bound(bound)
    found: Counter[Verdict] = Counter()
    for _ in range(TRIALS):
        added = machine(rng, REPEATS * (PER_REPEAT + 1)).reshape(REPEATS, PER_REPEAT + 1)
        taken = ((true(rng, REPEATS) + added[:, 0]) * 1e6).astype(np.int64)
        noise = Noise(tuple((added[:, 1:].ravel() * 1e6).astype(np.int64).tolist()))
        found[judge(taken, asked, noise if told else None).verdict] += 1
    return found


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(("true", "bound"), [(just_good, "p99 < 5 ms"), (near_good, "p99 < 5 ms")])
def test_noise_makes_no_fail_of_a_quantile_that_holds(true: Machine, bound: str, machine: Machine) -> None:
    assert verdicts(true, machine, bound, 11)[Verdict.FAIL] / TRIALS <= ERROR


@pytest.mark.parametrize("machine", MACHINES)
def test_noise_makes_no_fail_of_a_hard_bound_that_holds(machine: Machine) -> None:
    found = verdicts(near_good, machine, f"every < 5 ms with {100 * (1 - 1 / (PER_REPEAT + 1)):.3f} % confidence", 12)
    assert found[Verdict.FAIL] / TRIALS <= 1 / (PER_REPEAT + 1) + 3.0 * math.sqrt(0.1 / TRIALS)


@pytest.mark.parametrize("machine", MACHINES)
def test_noise_makes_no_pass_of_a_quantile_that_does_not_hold(machine: Machine) -> None:
    assert verdicts(just_bad, machine, "p99 < 5 ms", 13)[Verdict.PASS] / TRIALS <= ERROR


@pytest.mark.parametrize("machine", [idle, busy])
def test_a_late_stamp_at_the_beginning_makes_no_pass_of_a_quantile_that_does_not_hold(machine: Machine) -> None:
    def shortened(rng: np.random.Generator, n: int) -> Times:
        return -machine(rng, n)

    rng = np.random.default_rng(14)
    passed = 0
    for _ in range(TRIALS):
        taken = ((just_bad(rng, 600) + shortened(rng, 600)).clip(0.0) * 1e6).astype(np.int64)
        noise = Noise(tuple((machine(rng, 4000) * 1e6).astype(np.int64).tolist()))
        passed += judge(taken, parse_bound("p99 < 5 ms"), noise).passed
    assert passed / TRIALS <= ERROR


@pytest.mark.parametrize(("true", "machine"), [(just_good, preempted), (near_good, busy)])
def test_the_same_runs_judged_without_their_noise_fail_too_often(true: Machine, machine: Machine) -> None:
    assert verdicts(true, machine, "p99 < 5 ms", 11, told=False)[Verdict.FAIL] / TRIALS > 2 * ERROR


@pytest.mark.parametrize("machine", [idle, busy, heavy])
def test_what_is_far_from_its_limit_is_decided_on_a_busy_machine_too(machine: Machine) -> None:
    def fast(rng: np.random.Generator, n: int) -> Times:
        return rng.uniform(1.0, 2.0, n)

    def slow(rng: np.random.Generator, n: int) -> Times:
        return np.where(rng.random(n) < 0.1, 90.0, 2.0)

    assert verdicts(fast, machine, "p99 < 20 ms with 90 % confidence", 15)[Verdict.PASS] / TRIALS > 0.9
    assert verdicts(slow, machine, "p99 < 20 ms", 16)[Verdict.FAIL] / TRIALS > 0.8
