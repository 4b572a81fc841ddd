"""RAMP under faults: outcomes judged by what the world saw, the same every time, and no fault ends the study."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from parcours.cli.faults import command
from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.terminal import to_text
from parcours.run.faults import FaultPlan, parse_fault, parse_plan
from parcours.run.hosts.component_faults import Death
from parcours.run.trace import Trace
from parcours_navigation.facts import NEVER, TRACK
from parcours_ramp.faults import running
from parcours_ramp.faults.catalogue import COMPONENTS, SERVICES, TOPICS, CatalogueEntry, catalogue, chosen
from parcours_ramp.faults.judging import CaseOutcome, RobotOutcome, judge
from parcours_ramp.faults.reporting import SHOWN, fault_document, fault_page, tables
from parcours_ramp.faults.running import (
    SOON,
    FaultResults,
    FaultRow,
    Trial,
    faults_study,
    good_cases,
    run_faults,
    run_trial,
)
from parcours_ramp.system.component_form import ComponentRun, run_components, system_links
from parcours_ramp.system.ramp_facts import FACTS

S = 1_000_000_000


@functools.cache
def cases(schedule: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    numbers, (times,) = good_cases([faults_study(schedule, 1)], 2)
    return numbers, times


def trial(schedule: str, line: str) -> Trial:
    numbers, times = cases(schedule)
    return Trial(faults_study(schedule, 1), numbers[0], CatalogueEntry("topics", parse_fault(line)), times[0])


def left_behind(
    *,
    goal: float = -1.0,
    contact: float = -1.0,
    moves_until: float = 40.0,
    died: float = -1.0,
    strikes: int = 1,
    hangs: float = -1.0,
) -> ComponentRun:
    """Return what a case of 40 s leaves behind, times in seconds, -1 for never."""
    facts, track = np.zeros(1, FACTS), np.zeros(800, TRACK)
    for name, at in (("t_goal", goal), ("t_robot_contact", contact), ("t_shared_contact", -1.0)):
        facts[name] = NEVER if at < 0.0 else at * S
    track["time"] = np.arange(800) * 50_000_000
    track["v"][: int(moves_until * 20)] = 0.2
    deaths = () if died < 0.0 else (Death(int(died * S), "Planner", "crash"),)
    facts["t_end"] = (goal if goal > 0.0 else 40.0) * S
    acted = () if hangs < 0.0 else (("Planner", int(hangs * S)),)
    return ComponentRun(facts, track, np.zeros((800, 0, 2)), Trace("simulated", ()), deaths, strikes, acted)


def whole(ran: ComponentRun) -> ComponentRun:
    """Return a run of some seconds as if it had been a case that ended without goal and contact."""
    return ComponentRun(left_behind().facts, ran.track, ran.places, ran.trace, ran.deaths, ran.strikes)


@pytest.mark.parametrize(
    ("ran", "until", "outcome"),
    [
        (left_behind(goal=12.5), None, RobotOutcome.NO_EFFECT),
        (left_behind(goal=12.5, strikes=0), None, RobotOutcome.NOT_STRUCK),
        (left_behind(goal=11.0), 6, RobotOutcome.NO_EFFECT),
        (left_behind(goal=13.5), 6, RobotOutcome.RECOVERS),
        (left_behind(goal=13.5), None, RobotOutcome.LATE),
        (left_behind(goal=13.5), 20, RobotOutcome.LATE),
        (left_behind(goal=12.0, died=4.0), None, RobotOutcome.COASTS),
        (left_behind(goal=12.0, hangs=9.9), 6, RobotOutcome.COASTS),
        (left_behind(goal=12.0, hangs=10.1), 6, RobotOutcome.NO_EFFECT),
        (left_behind(moves_until=7.0, hangs=5.0), 6, RobotOutcome.STOPS),
        (left_behind(moves_until=7.0), None, RobotOutcome.STOPS),
        (left_behind(moves_until=7.0, died=4.0), 6, RobotOutcome.STOPS),
        (left_behind(moves_until=7.0), 6, RobotOutcome.STUCK),
        (left_behind(moves_until=38.0), None, RobotOutcome.RUNS_ON),
        (left_behind(goal=12.0, contact=9.0), None, RobotOutcome.CONTACT),
        (left_behind(moves_until=7.0, contact=6.9), 6, RobotOutcome.CONTACT),
    ],
)
def test_what_became_of_the_robot_is_judged_by_goal_contact_rest_and_whether_the_fault_is_over(
    ran: ComponentRun, until: int | None, outcome: RobotOutcome
) -> None:
    judged = judge(ran, 3 * S, None if until is None else until * S, 12 * S)
    assert judged.outcome is outcome
    stands = outcome in (RobotOutcome.STOPS, RobotOutcome.STUCK)
    assert judged.rest_after == ((3 if ran.deaths else 4) * S if stands else NEVER)


def test_every_entry_of_the_catalogue_strikes_what_ramp_has_and_none_stands_twice() -> None:
    lines = [str(entry) for entry in catalogue()]
    assert len(set(lines)) == len(lines)
    assert 60 <= len(lines) <= 110
    channels = [link.channel for link in system_links()]
    for entry in catalogue():
        FaultPlan(0, (entry.fault,)).check(channels, COMPONENTS)
    assert {entry.target for entry in catalogue()} == {*channels, *COMPONENTS}
    assert set(TOPICS) | set(SERVICES) < set(channels)


def test_cases_under_faults_are_those_that_go_well_without_under_every_schedule() -> None:
    studies = [faults_study(schedule, 1) for schedule in ("original", "guarded")]
    numbers, times = good_cases(studies, 4)
    for study, reached in zip(studies, times, strict=True):
        facts = study.run(np.array(numbers))
        assert tuple(facts["t_goal"].tolist()) == reached
        assert max(reached) <= SOON * S
        assert not (facts["n_robot_contacts"] + facts["n_shared_contacts"]).any()
    with pytest.raises(BadRequest, match="fault-cases"):
        good_cases(studies[:1], 65, most=64)


def test_a_fault_that_never_strikes_leaves_the_bits_as_they_are() -> None:
    study = faults_study("guarded", 1)
    number = cases("guarded")[0][0]
    plain = run_components(study, number, 4.0)
    struck = run_components(
        study, number, 4.0, faults=parse_plan("obstacles: drop from 60 s; update: delay 1 s messages 90000")
    )
    assert struck.track.tobytes() == plain.track.tobytes()
    assert struck.trace == plain.trace
    assert not struck.deaths
    assert struck.strikes == 0


def test_the_same_plan_and_case_give_the_same_bits_and_another_seed_others() -> None:
    study, number = faults_study("guarded", 1), cases("guarded")[0][0]
    text = "obstacles: drop 30 %; update: corrupt 10 %; cmd_vel: jitter 100 ms; Planner: slow down 5 x at 1 s for 1 s"

    def run(seed: int) -> ComponentRun:
        return run_components(study, number, 4.0, faults=parse_plan(f"seed: {seed}\n{text}"))

    one, again, other = run(3), run(3), run(4)
    assert one.track.tobytes() == again.track.tobytes()
    assert one.trace == again.trace
    assert other.trace != one.trace
    assert sum("fault: lost" in event.text for event in one.trace.events) > 10


def test_a_planner_that_crashes_is_dead_and_control_drives_on() -> None:
    study, number = faults_study("original", 1), cases("original")[0][0]
    ran = run_components(study, number, 5.0, faults=parse_plan("Planner: crash at 3 s"))
    assert [(death.time, death.component) for death in ran.deaths] == [(3 * S, "Planner")]
    takes = [event for event in ran.trace.events if event.kind == "take"]
    assert max(event.time for event in takes if event.component == "Planner") < 3 * S
    assert max(event.time for event in takes if event.component == "Control") > 4.9 * S
    judged = run_trial(trial("original", "Planner: crash at 3 s"))
    assert judged.outcome in (RobotOutcome.COASTS, RobotOutcome.STOPS, RobotOutcome.CONTACT, RobotOutcome.RUNS_ON)


def test_a_component_that_raises_because_of_a_message_has_died_and_the_study_goes_on() -> None:
    judged = run_trial(trial("guarded", "trajectory_response: duplicate"))
    assert [death.component for death in judged.deaths] == ["Planner"]
    assert judged.deaths[0].why.startswith("IndexError")
    assert judged.outcome is not RobotOutcome.NO_EFFECT
    assert judged.detail == ""


def test_a_planner_that_waits_for_a_lost_answer_hangs_and_to_reach_the_goal_is_then_no_success() -> None:
    judged = run_trial(trial("guarded", "evaluation_response: drop from 2 s"))
    assert judged.silent == ("Planner",)
    assert not judged.deaths
    assert judged.outcome in (RobotOutcome.COASTS, RobotOutcome.STOPS, RobotOutcome.CONTACT)
    assert run_trial(trial("guarded", "update: duplicate")).silent == ()


def test_a_robot_whose_command_is_lost_for_good_drives_on_as_it_was_told_last() -> None:
    study, number = faults_study("guarded", 1), cases("guarded")[0][0]
    ran = run_components(study, number, 12.0, faults=parse_plan("cmd_vel: drop from 4 s"))
    last = ran.track[ran.track["time"] > 6 * S]
    assert np.ptp(last["v"]) == 0.0
    assert np.ptp(last["w"]) == 0.0
    assert last["v"][0] > 0.1
    assert judge(whole(ran), 4 * S, None, 12 * S).outcome is RobotOutcome.RUNS_ON


def test_one_and_two_workers_give_the_same_results() -> None:
    entries = (*chosen("update: drop from"), *chosen("Sensing: crash at 8"))
    one, two = (run_faults(entries, ("guarded",), cases=1, workers=workers) for workers in (1, 2))
    assert one == two
    assert [(row.schedule, str(row.entry), len(row.outcomes)) for row in one.rows] == [
        ("guarded", "update: drop from 3 s to 6 s", 1),
        ("guarded", "Sensing: crash at 8 s", 1),
    ]
    assert one.repeated.equal == one.repeated.tried > 0


def test_a_case_under_a_fault_that_comes_out_otherwise_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = judge
    forgetful = lambda *what: dataclasses.replace(plain(*what), strikes=int.from_bytes(os.urandom(4)))  # noqa: E731
    monkeypatch.setattr(running, "judge", forgetful)
    found = run_faults(chosen("Sensing: crash at 8"), ("guarded",), cases=1)
    assert (found.repeated.equal, found.repeated.tried, found.repeated.among) == (0, 1, 1)
    assert "Not reproducible: 1 of 1 struck cases came out otherwise" in to_html(fault_page(found))


def results() -> FaultResults:
    """Return made-up results with every outcome."""
    rows = []
    for schedule in ("original", "guarded"):
        for k, entry in enumerate(catalogue()):
            outcome = SHOWN[k % len(SHOWN)]
            deaths = (Death(4 * S, "Planner", "IndexError: <b>"),) if outcome is RobotOutcome.COASTS else ()
            detail = "its process hung" if outcome is RobotOutcome.ERROR else ""
            rest = 2 * S if outcome is RobotOutcome.STOPS else NEVER
            made = CaseOutcome(0, outcome, rest_after=rest, deaths=deaths, detail=detail)
            rows.append(FaultRow(schedule, entry, (made, CaseOutcome(3, RobotOutcome.NO_EFFECT))))
    return FaultResults(1, (0, 3), tuple(rows), {"original": (9, 9), "guarded": (8, 8)})


def test_the_tables_count_every_case_once() -> None:
    *detailed, total = tables(results())
    n = len(catalogue())
    assert len(detailed) == 6
    assert sum(len(table.rows) for table in detailed) == 2 * n
    counted = sum(int(cell) for row in total.rows for cell in row[3:] if cell is not None)  # type: ignore[arg-type, misc]
    assert counted == 4 * n
    text = to_text(detailed[0])
    assert "Planner 1 (IndexError)" in text
    assert "its process hung" in text
    assert "2.0" in text


def test_page_and_document_hold_every_row_and_nothing_of_a_message_is_taken_for_markup() -> None:
    html = to_html(fault_page(results()))
    for entry in catalogue():
        assert str(entry) in html
    assert "<b>" not in html
    document = json.loads(json.dumps(fault_document(results()), allow_nan=False))
    assert len(document["rows"]) == 2 * len(catalogue())
    assert document["rows"][0]["runs"][1] == {
        "case": 3, "outcome": "no effect", "t_goal": -1, "t_contact": -1, "rest_after": -1, "strikes": 0, "deaths": [],
        "silent": [], "detail": "",
    }  # fmt: skip


def test_the_command_lists_runs_and_writes_what_it_is_asked_for(tmp_path: Path) -> None:
    listed = CliRunner().invoke(command, ["ramp_system", "--list", "--only", "freeze"])
    assert listed.output.splitlines() == [str(entry) for entry in catalogue() if "freeze" in str(entry)]
    ran = CliRunner().invoke(
        command,
        [
            "ramp_system",
            "--only",
            "Planner: freeze at 4 s for 500",
            "--cases",
            "1",
            "--set",
            "schedule=guarded",
            "--out",
            str(tmp_path),
        ],
    )
    assert ran.exit_code == 0, ran.output
    assert "Planner: freeze at 4 s for 500 ms" in ran.output
    assert json.loads((tmp_path / "faults.json").read_text())["rows"][0]["schedule"] == "guarded"
    assert "RAMP under faults" in (tmp_path / "faults.html").read_text()
    for wrong, slug in ((["--only", "nobody"], "fault-only"), (["--set", "schedule=best"], "parameter-choice")):
        refused = CliRunner().invoke(command, ["ramp_system", *wrong]).exception
        assert isinstance(refused, BadRequest) and refused.slug == slug
