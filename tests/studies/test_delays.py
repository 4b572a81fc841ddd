"""RAMP with added delays: the study, what it keeps, and the chapter that is drawn from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.pieces import Figure, Page, Table, Text
from parcours.run.campaign import run_campaign
from parcours_navigation.outcomes import published
from parcours_ramp.paper.delays_chapter import delays_chapter
from parcours_ramp.system.delays import DELAYED, DELAYS, QUESTIONS, DelayResults, DelayStudy, settings_of
from parcours_ramp.system.study import SCHEDULES, system_study

TIMES = (0.0, 0.5, 1.0)
N = 60


def planted(**yes: tuple[int, int, int]) -> DelayResults:
    """Return results in which so many of the first cases say yes at each time; keys: schedule_delay_question."""
    study = DelayStudy(1, N, TIMES)
    rows = np.zeros(study.n_runs, DELAYED)
    for k, setting in enumerate(settings_of(TIMES)):
        at = TIMES.index(setting.seconds)
        for question in QUESTIONS:
            for delay in (setting.delay,) if setting.delay else DELAYS:
                count = yes.get(f"{setting.schedule}_{delay}_{question}", (0, 0, 0))[at]
                rows[question][k * N : k * N + count] = 1
    return DelayResults(study, rows)


def test_each_setting_is_run_once_and_no_delay_only_once_a_schedule() -> None:
    settings = settings_of(TIMES)
    assert len(set(settings)) == len(settings) == len(SCHEDULES) * (1 + len(DELAYS) * 2)
    assert [s.schedule for s in settings if not s.delay] == list(SCHEDULES)


@pytest.mark.parametrize("delay", DELAYS)
def test_a_setting_adds_to_what_it_names_and_to_nothing_else(delay: str) -> None:
    (setting,) = (s for s in settings_of((0.0, 0.25)) if s.schedule == "guarded" and s.delay == delay)
    latencies = setting.study(1).latencies
    added = {name: getattr(latencies, f"added_{name}") for name in DELAYS}
    assert added == {name: 0.25 if name == delay else 0.0 for name in DELAYS}
    assert setting.study(1).parameters.schedule == "guarded"


def test_runs_without_delay_are_those_of_the_study_without_delays() -> None:
    study = DelayStudy(1, 8, (0.0, 1.0))
    rows = study(0, study.n_runs)
    plain = system_study("original", seed=1)(0, 8)
    assert np.array_equal(rows["number"][:8], np.arange(8))
    assert np.array_equal(rows["stuck"][:8] == 1, published(plain).stuck)
    assert np.array_equal(rows["reached"][:8] == 1, plain["t_goal"] >= 0)


def test_runs_do_not_depend_on_how_they_are_cut_nor_on_workers(tmp_path: Path) -> None:
    study = DelayStudy(1, 3, (0.0, 1.0))
    whole = study(0, study.n_runs)
    parts = np.concatenate([study(first, 4) for first in range(0, study.n_runs, 4)])
    assert parts.tobytes() == whole.tobytes()
    kept = run_campaign(study, study.campaign(), tmp_path).store.load()
    assert kept.tobytes() == whole.tobytes()


def test_a_second_of_delay_in_seeing_changes_what_happens() -> None:
    study = DelayStudy(1, 24, (0.0, 1.0))
    results = DelayResults(study, study(0, study.n_runs))
    changed = [results.flags("original", "sensing", s, "stuck") for s in (0.0, 1.0)]
    reached = [results.flags("original", "sensing", s, "reached") for s in (0.0, 1.0)]
    assert (changed[0] != changed[1]).any() or (reached[0] != reached[1]).any()


def test_rates_and_pairs_are_counted_per_schedule_and_delay() -> None:
    results = planted(original_stop_contact=(10, 20, 40), guarded_stop_contact=(1, 1, 1))
    assert [rate.count for rate in results.rates("original", "stop", "contact")] == [10, 20, 40]
    assert [rate.count for rate in results.rates("guarded", "stop", "contact")] == [1, 1, 1]
    assert [rate.count for rate in results.rates("original", "sensing", "contact")][1:] == [0, 0]
    pairs = results.against_none("original", "stop", "contact")
    assert (pairs.both, pairs.first_only, pairs.second_only) == (10, 0, 30)
    assert pairs.p_value == pytest.approx(2.0**-29)


def test_the_chapter_says_what_the_data_say_and_no_more() -> None:
    results = planted(original_stop_contact=(10, 20, 40), original_sensing_contact=(10, 10, 11))
    section = delays_chapter(results)
    (told,) = (piece.body for piece in section.pieces if isinstance(piece, Text))
    original, guarded = (line for line in told.splitlines() if line.startswith("- **"))
    assert "16.7 % → 66.7 % with late stop command" in original
    assert "sensing" not in original
    assert guarded == "- **guarded**: no rate changes by more than chance explains."
    other = delays_chapter(planted(guarded_planning_reached=(50, 40, 5)))
    (told,) = (piece.body for piece in other.pieces if isinstance(piece, Text))
    assert "goal reached within 20 s 83.3 % → 8.3 % with late planning and control" in told


def test_the_chapter_draws_every_rate_with_its_cases_and_fits_a_page() -> None:
    results = planted(original_stop_stuck=(6, 12, 18))
    section = delays_chapter(results)
    (figure,) = (piece for piece in section.pieces if isinstance(piece, Figure))
    assert f"{N} cases a point" in figure.note
    assert "stuck in imminent collision, stop command, original: 10.0% at 0, 20.0% at 0.5, 30.0% at 1" in figure.alt
    tables = [piece for piece in section.pieces if isinstance(piece, Table)]
    assert [len(table.rows) for table in tables] == [len(SCHEDULES) * len(DELAYS) * len(QUESTIONS)] * 2
    assert "What delays cost" in to_html(Page("", "", (), (section,)))


@pytest.mark.parametrize("times", [(), (0.1, 0.2), (0.0, 0.5, 0.5), (0.0, -1.0)])
def test_times_that_do_not_increase_from_none_are_refused(times: tuple[float, ...]) -> None:
    with pytest.raises(BadRequest, match=r"\[delay-times\]"):
        DelayStudy(1, 5, times)


def test_what_was_not_run_cannot_be_asked_for() -> None:
    results = planted()
    with pytest.raises(BadRequest, match=r"0.3 s were not added.*\[delay-times\]"):
        results.flags("original", "stop", 0.3, "stuck")
    with pytest.raises(BadRequest, match=r"\[unknown-delay\]"):
        results.flags("original", "braking", 0.5, "stuck")
    with pytest.raises(BadRequest, match=r"\[unknown-question\]"):
        results.flags("original", "stop", 0.5, "late")
    with pytest.raises(BadRequest, match=r"\[runs-shape\]"):
        DelayResults(results.study, results.rows[1:])
    with pytest.raises(BadRequest, match=r"\[count-range\]"):
        DelayStudy(1, 0, TIMES)
