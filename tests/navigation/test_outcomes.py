"""Rules on facts: the paper's four results, and the sound outcomes beside them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours_navigation.facts import FACTS, NEVER
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


def facts(**given: object) -> NDArray[np.void]:
    """One case that ended at 21 s far from its goal, with what is given changed."""
    record = np.zeros(1, FACTS)
    for name in ("t_goal", "t_goal_after", "t_contact", "t_robot_contact", "t_shared_contact"):
        record[name] = NEVER
    record["t_end"], record["to_goal"], record["goal_gap"], record["min_clearance"] = 21_000_000_000, 1.0, 0.5, 0.1
    for name, value in given.items():
        record[name] = value
    return record


@pytest.mark.parametrize(
    ("given", "outcome"),
    [
        ({"t_goal": 12_000_000_000, "to_goal": 0.1}, Outcome.REACHED),
        ({"t_goal": 12_000_000_000, "n_robot_contacts": 1, "t_robot_contact": 5}, Outcome.COLLIDED),
        ({"t_goal": 12_000_000_000, "n_shared_contacts": 1, "t_shared_contact": 5}, Outcome.COLLIDED),
        ({"t_goal": 12_000_000_000, "n_obstacle_contacts": 3, "t_contact": 5}, Outcome.REACHED),
        ({"t_goal_after": 30_000_000_000, "halted": 1, "moved_after": 1}, Outcome.UNDER_WAY),
        ({"t_goal_after": 30_000_000_000, "n_contacts_after": 1, "t_robot_contact": 25_000_000_000}, Outcome.COLLIDED),
        ({"goal_gap": -0.01, "halted": 1}, Outcome.BLOCKED),
        ({"halted": 1, "moved_after": 0}, Outcome.STUCK),
        ({"halted": 1, "moved_after": 1}, Outcome.ASTRAY),
        ({"halted": 0, "feasible": 1}, Outcome.ASTRAY),
    ],
)
def test_the_first_rule_that_holds_gives_the_outcome(given: dict[str, object], outcome: Outcome) -> None:
    record = facts(**given)
    assert outcomes(record).tolist() == [outcome]
    assert explain(record[0])


def test_a_flag_at_the_end_is_stuck_by_the_published_rule_even_if_the_robot_moves_again() -> None:
    record = facts(halted=1, moved_after=1, n_halts=2, t_goal_after=30_000_000_000)
    assert published(record).stuck.all() and outcomes(record)[0] == Outcome.UNDER_WAY


def test_the_published_goal_is_not_latched() -> None:
    assert not published(facts(t_goal=5, to_goal=0.3)).reached.any()


def test_time_left_is_known_for_feasible_trajectories_only() -> None:
    assert published(facts(feasible=1, time_left=4.8)).time_left.tolist() == [4.8]
    assert np.isnan(published(facts(feasible=0, time_left=4.8)).time_left).all()


def test_true_time_left_counts_from_the_end_of_the_case() -> None:
    late = facts(t_goal_after=25_500_000_000)
    assert true_time_left(late).tolist() == [4.5]
    assert true_time_left(facts(t_goal=3)).tolist() == [0.0]
    assert np.isnan(true_time_left(facts())).all()


def test_every_case_lies_in_exactly_one_slice_of_figure_5b() -> None:
    rng = np.random.default_rng(1)
    many = np.concatenate([facts() for _ in range(200)])
    many["to_goal"] = rng.choice([0.1, 1.0], 200)
    many["feasible"], many["halted"] = rng.integers(0, 2, 200), rng.integers(0, 2, 200)
    assert np.all(np.sum(list(shares(many).values()), axis=0) == 1)
    assert set(shares(many)) == set(Share)


def test_every_outcome_has_a_verdict() -> None:
    assert set(VERDICT_OF) == set(Outcome)


def test_a_case_that_another_ended_says_when_it_ended_and_who_ran_into_whom() -> None:
    hit = facts(n_obstacle_contacts=1, t_contact=6_450_000_000, t_end=6_460_000_000)[0]
    assert "when the test ended at 6.46 s; an obstacle had run into it at 6.45 s" in explain(hit)
    assert "run into" not in explain(facts()[0])
