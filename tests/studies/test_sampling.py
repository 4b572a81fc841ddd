"""Campaign cases that are run again component by component: a fault in data or facts fails its case."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours_ramp.planner import viewing
from parcours_ramp.system import sampling
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.sampled_results import FILE, read_sampled
from parcours_ramp.system.sampling import SampledJudgement, judge_sampled
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_sound_cases_pass_and_are_reported(schedule: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def not_watched_on(study: SystemStudy, number: int) -> SampledJudgement:
        return judge_sampled(dataclasses.replace(study, watched_on=0.0), number)

    monkeypatch.setattr(sampling, "judge_sampled", not_watched_on)
    arguments = ["run", "ramp_system", "--schedule", schedule, "--cases", "4", "--time-limit", "1", "--judged", "3"]
    run = CliRunner().invoke(parcours, [*arguments, "--workers", "1", "--out", str(tmp_path)])
    assert {number: one["verdict"] for number, one in read_sampled(tmp_path).items()} == {"0": "pass", "3": "pass"}
    assert "Sampled cases" in run.output
    asked = CliRunner().invoke(parcours, ["coverage", str(tmp_path), "--json"])
    goals = {one["name"]: one for one in json.loads(asked.output)}
    pairs = goals["pairs of transitions taken, judged cases"]
    assert 20 < pairs["held"] < pairs["wanted"] and "p12 p13" not in pairs["missing"]
    assert set(pairs["missing"]).isdisjoint(
        ", ".join(one["pairs"] for one in read_sampled(tmp_path).values()).split(", ")
    )
    assert goals["transitions taken"]["held"] > 20
    oracles = goals["data oracles asked, judged cases"]
    assert 60 < oracles["held"] < oracles["wanted"]
    assert {"guard of p21", "operations of p43"} < set(oracles["missing"]).difference(
        ["guard of p15", "actions of p12"]
    )
    before = shutil.copytree(tmp_path, tmp_path / "before")
    failed = json.loads((tmp_path / FILE).read_bytes())
    failed["3"]["verdict"] = "fail"
    (tmp_path / FILE).write_text(json.dumps(failed))
    compared = CliRunner().invoke(parcours, ["compare", str(before), str(tmp_path), "--json"])
    document = json.loads(compared.output)[str(tmp_path)]
    assert document["shared"] == 6 and [one.endswith("/0/data") for one in document["flipped"]] == [True]


def test_data_that_are_wrong_fail_their_case(monkeypatch: pytest.MonkeyPatch) -> None:
    def twice_as_fast(channel: str, payload: Any) -> Any:
        message = viewing.message_of(channel, payload)
        if channel == "best_trajectory" and message is not None:
            message = {**message, "points": [{**s, "v": 2 * s["v"]} for s in message["points"]]}  # type: ignore[attr-defined]
        return message

    monkeypatch.setattr(sampling, "message_of", twice_as_fast)
    judgement = judge_sampled(dataclasses.replace(system_study("guarded"), time_limit=1.0), 0).judgement
    assert judgement.verdict == "fail" and "best_trajectory/" in judgement.why


def test_facts_that_differ_fail_their_case(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = run_components

    def another(*arguments: Any) -> Any:
        ran = plain(*arguments)
        assert ran.facts is not None
        ran.facts["n_control_cycles"] += 1
        return ran

    monkeypatch.setattr(sampling, "run_components", another)
    judgement = judge_sampled(dataclasses.replace(system_study("guarded"), time_limit=1.0), 0).judgement
    assert judgement.verdict == "fail" and "n_control_cycles is" in judgement.why
