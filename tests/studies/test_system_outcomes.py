"""What the system campaign shows: the published schedule sticks and touches obstacles, the repaired one does not."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.verdict.judgement import Verdict
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import (
    VERDICT_OF,
    Outcome,
    Share,
    explain,
    outcomes,
    published,
    shares,
    true_time_left,
)
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.study import SCHEDULES, system_study

CASES = 270


@functools.cache
def facts(schedule: str) -> NDArray[np.void]:
    return system_study(schedule, seed=0)(0, CASES)


def count(schedule: str, *wanted: Outcome) -> int:
    return int(np.isin(outcomes(facts(schedule)), wanted).sum())


def test_the_published_schedule_gets_stuck_and_the_repaired_one_clearly_less_often() -> None:
    stuck = {schedule: int(published(facts(schedule)).stuck.sum()) for schedule in SCHEDULES}
    assert stuck["original"] >= 0.04 * CASES
    assert 4 * stuck["guarded"] <= stuck["original"]
    assert count("guarded", Outcome.STUCK) < count("original", Outcome.STUCK)


def test_the_repaired_schedule_reaches_no_fewer_goals() -> None:
    reached = {schedule: int(published(facts(schedule)).reached.sum()) for schedule in SCHEDULES}
    assert reached["guarded"] >= reached["original"] > 0.4 * CASES


def test_the_repaired_schedule_s_robot_touches_nobody_where_the_published_one_s_does() -> None:
    assert count("original", Outcome.COLLIDED) > 0.05 * CASES
    assert count("guarded", Outcome.COLLIDED) < 0.01 * CASES


def test_a_contact_after_the_end_is_counted_and_spoils_a_goal_that_is_reached_later() -> None:
    rows = facts("original")
    later = (rows["n_contacts_after"] > 0) & (rows["n_robot_contacts"] + rows["n_shared_contacts"] == 0)
    spoilt = rows[later & (rows["t_goal_after"] != NEVER)]
    assert len(spoilt) > 0
    assert (outcomes(spoilt) == Outcome.COLLIDED).all()
    assert "after the end" in explain(spoilt[0])
    closed = np.where(spoilt["t_robot_contact"] == NEVER, spoilt["t_shared_contact"], spoilt["t_robot_contact"])
    assert (closed > spoilt["t_end"]).all()


def test_the_repaired_schedule_fails_clearly_fewer_cases() -> None:
    failing = [outcome for outcome, verdict in VERDICT_OF.items() if verdict is Verdict.FAIL]
    assert 2 * count("guarded", *failing) < count("original", *failing)


def test_imminent_collision_is_signalled_in_a_good_part_of_the_cases_but_not_in_most() -> None:
    for schedule in SCHEDULES:
        share = float(published(facts(schedule)).halted_once.mean())
        assert 0.15 < share < 0.6


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_four_slices_are_a_partition_of_the_cases(schedule: str) -> None:
    slices = shares(facts(schedule))
    assert set(slices) == set(Share)
    assert (np.stack(list(slices.values())).sum(axis=0) == 1).all()


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_every_outcome_is_explained_in_a_sentence_that_fits_it(schedule: str) -> None:
    words = {
        Outcome.COLLIDED: "drove into an obstacle", Outcome.REACHED: "goal reached", Outcome.UNDER_WAY: "s later",
        Outcome.BLOCKED: "rests on the goal", Outcome.STUCK: "never moved again", Outcome.ASTRAY: "did not arrive",
    }  # fmt: skip
    rows = facts(schedule)
    for record, code in zip(rows, outcomes(rows), strict=True):
        assert words[Outcome(code)] in explain(record)


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_true_time_left_is_known_where_the_goal_was_reached_at_all(schedule: str) -> None:
    rows = facts(schedule)
    left = true_time_left(rows)
    known = (rows["t_goal"] != NEVER) | (rows["t_goal_after"] != NEVER)
    assert np.array_equal(~np.isnan(left), known)
    assert (left[rows["t_goal"] != NEVER] == 0.0).all()
    assert (left[rows["t_goal_after"] != NEVER] > 0.0).all()


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_a_stuck_robot_stands_where_it_was_halted(schedule: str) -> None:
    rows = facts(schedule)
    for record in rows[outcomes(rows) == Outcome.STUCK]:
        assert record["halted"] == 1
        assert record["t_last_moving"] < record["t_end"]
        assert record["moved_after"] == 0


def test_the_published_schedule_really_takes_every_transition_of_the_model_but_idle_polls() -> None:
    taken = facts("original")["transitions"].sum(axis=0)
    assert len(taken) == len(TRANSITIONS) == 37
    untaken = {name for name, n in zip(TRANSITIONS, taken, strict=True) if n == 0}
    assert untaken <= {"p14", "p21", "p31", "p41", "p51", "p61"}


def test_services_send_as_many_answers_as_they_get_requests() -> None:
    for schedule in SCHEDULES:
        taken = dict(zip(TRANSITIONS, facts(schedule)["transitions"].sum(axis=0), strict=True))
        for service in "235":
            assert taken[f"p{service}2"] == taken[f"p{service}4"] == taken[f"p{service}5"] > 0
        assert taken["p15"] <= taken["p63"]
        assert taken["p12"] == taken["p13"]
        assert taken["p48"] == taken["p49"]
