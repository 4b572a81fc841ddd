"""One system case in all its forms: compiled or as components, alone or in a batch, here or on another processor."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.run.campaign import run_campaign
from parcours.run.trace import transitions
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import Outcome, explain, outcomes
from parcours_ramp.planner.latency import none
from parcours_ramp.system.component_form import ComponentRun, run_components
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study

SHORT = 3.0
"""So long [s] lasts a test, after the static second, in each of the hundred and twenty cases."""


@functools.cache
def study(schedule: str) -> SystemStudy:
    return system_study(schedule, seed=3)


@functools.cache
def facts(schedule: str) -> NDArray[np.void]:
    return study(schedule)(0, 90)


@functools.cache
def timeless(schedule: str, time_limit: float) -> SystemStudy:
    """Return the study without latencies; no case is watched beyond its end."""
    return dataclasses.replace(study(schedule), latencies=none(), time_limit=time_limit, watched_on=0.0)


def assert_same(timeless: SystemStudy, number: int) -> ComponentRun:
    """Run a case in both forms and compare what they leave behind: to the bit, and by the verdict."""
    ran, (facts, track, places) = run_components(timeless, number), timeless.track(number)
    assert ran.facts is not None
    for name in track.dtype.names or ():  # where it was, how fast, and when imminent collision was signalled
        assert np.array_equal(ran.track[name], track[name]), name
    assert ran.track.tobytes() == track.tobytes()
    assert ran.places.tobytes() == places.tobytes()
    for name in facts.dtype.names or ():
        assert ran.facts[name].tobytes() == facts[name].tobytes(), name
    assert np.array_equal(outcomes(ran.facts), outcomes(facts))
    assert explain(ran.facts[0]) == explain(facts[0])
    return ran


@pytest.mark.parametrize("block", range(0, 60, 10))
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_components_on_the_simulated_host_leave_the_same_bits_and_verdict_as_the_compiled_loop(
    schedule: str, block: int
) -> None:
    for number in range(block, block + 10):
        assert len(assert_same(timeless(schedule, SHORT), number).track) > 50


@pytest.mark.parametrize("number", range(100, 105))
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_so_they_do_over_whole_cases_that_are_watched_on_and_the_trace_tells_what_was_counted(
    schedule: str, number: int
) -> None:
    whole = dataclasses.replace(study(schedule), latencies=none())
    ran = assert_same(whole, number)
    assert ran.facts is not None
    taken = Counter(transitions(ran.trace))
    assert all(taken[name] >= n for name, n in zip(TRANSITIONS, ran.facts["transitions"][0], strict=True))
    assert taken["p11"] > 100


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_so_they_do_among_solid_obstacles_and_with_any_published_habit_changed(schedule: str) -> None:
    plain = timeless(schedule, 6.0)
    changes: list[dict[str, Any]] = [
        {name: schedule == "original"} for name in ("looks_ahead", "may_leave", "halts_at_once")
    ]
    studies = [dataclasses.replace(plain, solid=True)]
    studies += [dataclasses.replace(plain, parameters=dataclasses.replace(plain.parameters, **c)) for c in changes]
    facts = plain.run(np.arange(60))
    struck = np.flatnonzero(facts["n_obstacle_contacts"] > 0)[:2].tolist()
    for one in studies:
        runs = [assert_same(one, number) for number in struck]
        changed = [
            run.track.tobytes() != plain.track(n)[1].tobytes() or one.solid for n, run in zip(struck, runs, strict=True)
        ]
        assert any(changed)


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_so_they_do_in_the_published_harness_where_the_robot_stands_until_its_first_trajectory_arrives(
    schedule: str,
) -> None:
    harness = system_study(schedule, seed=3, protocol="published")
    for number in (0, 400, 520, 630, 730, 830):  # of six folders: obstacles that wait up to 10 s
        short = dataclasses.replace(harness, latencies=none(), time_limit=12.0, watched_on=0.0)
        track = assert_same(short, number).track
        sets_out = track["time"][track["v"] > 0.0][0] * 1e-9
        assert 0.39 < sets_out < 0.9
        assert track["time"][-1] <= 12_000_000_000


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_cases_in_which_both_forms_are_compared_halt_switch_collide_and_reach_the_goal(schedule: str) -> None:
    short, whole = timeless(schedule, SHORT)(0, 60), timeless(schedule, 20.0)(100, 5)
    assert (short["n_halts"] > 0).sum() >= 5
    assert (short["n_switches"] > 0).sum() >= 20
    assert {Outcome.REACHED} < set(outcomes(np.concatenate([short, whole])).tolist())


def test_without_a_trace_the_components_drive_the_same_way() -> None:
    for schedule in SCHEDULES:
        ran = run_components(timeless(schedule, SHORT), 7, recording=False)
        assert not ran.trace.events
        assert ran.track.tobytes() == timeless(schedule, SHORT).track(7)[1].tobytes()


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_facts_of_a_case_depend_on_its_number_only_not_on_its_company(schedule: str) -> None:
    numbers = np.arange(90)
    assert study(schedule).run(numbers[::-1])[::-1].tobytes() == facts(schedule).tobytes()
    mixed = np.random.default_rng(0).permutation(numbers)
    assert study(schedule).run(mixed).tobytes() == facts(schedule)[mixed].tobytes()
    for number in (0, 17, 89):
        assert study(schedule)(number, 1).tobytes() == facts(schedule)[number : number + 1].tobytes()


def test_a_replay_of_a_case_has_the_facts_of_the_campaign_and_ends_where_they_say() -> None:
    for schedule in SCHEDULES:
        for number in (1, 40):
            again, track, _ = study(schedule).track(number)
            for name in facts(schedule).dtype.names or ():
                assert again[name][0].tobytes() == facts(schedule)[name][number].tobytes(), name
            near = track[np.searchsorted(track["time"], again["t_end"][0]) - 1]
            assert np.hypot(near["x"] - again["x"][0], near["y"] - again["y"][0]) < 0.25 * 0.06


def test_campaigns_with_one_and_two_workers_leave_the_same_bytes(tmp_path: Path) -> None:
    contents = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        outcome = run_campaign(study("guarded"), study("guarded").campaign(90, shard_size=32), folder, workers=workers)
        assert (outcome.finished, outcome.interrupted) == (90, False)
        contents.append({path.name: path.read_bytes() for path in sorted(folder.iterdir())})
        assert outcome.store.load().tobytes() == facts("guarded").tobytes()
    assert contents[0] == contents[1]
    assert len(contents[0]) == 1 + 2 * 3


_PROGRAM = """
import hashlib
from numba.core.registry import cpu_target
from parcours_ramp.system.study import system_study
_, name, features = cpu_target.target_context.codegen().magic_tuple()
assert name == "x86-64" and "+avx" not in features and "+fma" not in features, (name, features)
for schedule in ("original", "guarded"):
    print(hashlib.sha256(system_study(schedule, seed=3)(0, 30).tobytes()).hexdigest())
"""


def test_a_processor_without_vector_extensions_and_no_optimiser_gives_the_same_facts_to_the_bit(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        env={
            **os.environ, "PARCOURS_CACHE_DIR": str(tmp_path), "NUMBA_CPU_NAME": "x86-64",
            "NUMBA_CPU_FEATURES": "+sse2,-avx,-fma", "NUMBA_OPT": "0",  # as written: nothing fused, nothing reordered
        },
        capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip
    here = [hashlib.sha256(facts(schedule)[:30].tobytes()).hexdigest() for schedule in SCHEDULES]
    assert done.stdout.split() == here


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_facts_of_a_case_agree_with_each_other(schedule: str) -> None:
    rows = facts(schedule)
    reached = rows["t_goal"] != NEVER
    assert reached.any()
    assert not reached.all()
    assert np.array_equal(reached, rows["to_goal"] < 0.2)
    late = rows["t_end"][reached] - rows["t_goal"][reached]
    assert late.min() >= 0
    assert late.max() <= 50_000_000  # the run ends with the next event of the loop
    assert (rows["t_end"][~reached] == 21_000_000_000).all()
    assert (rows["t_goal_after"][reached] == NEVER).all()
    assert (rows["t_goal_after"][rows["t_goal_after"] != NEVER] > 21_000_000_000).all()
    touched = rows["n_robot_contacts"] + rows["n_shared_contacts"] + rows["n_obstacle_contacts"] > 0
    assert np.array_equal(touched, rows["t_contact"] != NEVER)
    assert np.array_equal(touched, rows["min_clearance"] <= 0.0)
    assert np.array_equal(rows["n_halts"] > 0, rows["halted_time"] > 0)
    assert (rows["travelled"] <= 0.25 * rows["t_end"] * 1e-9 + 1e-9).all()
    assert (rows["travelled"] >= np.hypot(rows["x"], rows["y"]) - 1e-9).all()
    assert np.array_equal(rows["number"], np.arange(90))


def test_shares_of_work_fit_the_published_rates() -> None:
    for schedule in SCHEDULES:
        rows = facts(schedule)
        seconds = rows["t_end"].sum() * 1e-9
        watched = np.where(rows["t_goal"] != NEVER, rows["t_end"], 0).sum() * 1e-9
        whole = rows[rows["t_goal"] != NEVER]
        sensed = whole["transitions"][:, TRANSITIONS.index("p64")].sum()
        assert sensed == pytest.approx(20.0 * watched, rel=0.01)
        assert (rows["n_planning_cycles"] > 0).all()
        assert rows["n_planning_cycles"].sum() > 5.0 * seconds
