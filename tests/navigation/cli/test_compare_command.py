"""`parcours compare` and `parcours planner` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults

MINE = """
import os, sys
def stand(observation):
    return 0.0, 0.0

def breaks(observation):
    if observation.time > 1.5:
        raise KeyError("door")
    return 0.2, 0.0

def exits(observation):
    sys.exit(0)

def kills(observation):
    os._exit(7)
"""


def call(*words: object) -> Result:
    return CliRunner().invoke(parcours, [str(word) for word in words], catch_exceptions=False)


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("planners") / "mine.py"
    path.write_text(MINE)
    return path


@pytest.fixture(scope="module")
def compared(mine: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A comparison of two planners of the user's own, one of which fails."""
    folder = tmp_path_factory.mktemp("compare")
    result = call(
        "compare", f"{mine}:stand", f"{mine}:breaks", "--cases", 18, "--workers", 1, "--scored-cases", 2,
        "--timed-cases", 1, "--out", folder, "--html", folder / "page.html", "--json",
    )  # fmt: skip
    return folder, result


def test_a_comparison_says_all_as_json_and_as_a_page(compared: tuple[Path, Result], mine: Path) -> None:
    folder, result = compared
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    planners = document["planners"]
    assert list(planners) == [f"{mine}:stand", f"{mine}:breaks"]
    assert planners[f"{mine}:stand"]["outcomes"]["reached"]["count"] == 0
    assert planners[f"{mine}:stand"]["questions"]["stopped for good"]["count"] >= 15
    (why,) = planners[f"{mine}:breaks"]["errors"]
    assert why["cases"] == planners[f"{mine}:breaks"]["outcomes"]["error"]["count"] == 18
    assert "KeyError: 'door' (mine.py:8)" in why["reason"]
    assert planners[f"{mine}:stand"]["measures"]["mean_clearance"]["n"] == 18
    assert planners[f"{mine}:breaks"]["measures"]["mean_clearance"]["n"] == 0
    scored = {(s["benchmark"], s["mode"], s["score"]): s for s in document["benchmarks"]}
    stood = f"{mine}:stand"
    assert scored["arena", "corrected", "goal reached"]["cases"] == 18
    assert scored["arena", "corrected", "goal reached"]["means"][stood] == 0.0
    assert scored["arena", "arena-evaluation", "goal reached"]["cases"] == 2
    assert scored["arena", "arena-evaluation", "goal reached"]["means"][stood] == 1.0  # the published defect
    assert planners[f"{mine}:stand"]["decision_us"]["n"] > 100
    assert len(document["tests_against_first"]) == 3
    page = (folder / "page.html").read_text()
    assert "KeyError" in page and "https:" not in page and "Tests on the same cases against" in page


def test_a_comparison_is_resumed_and_gives_the_same(compared: tuple[Path, Result], mine: Path) -> None:
    folder, first = compared
    kept = {path: path.stat().st_mtime_ns for path in folder.rglob("shard-*")}
    words = (
        "compare",
        f"{mine}:stand",
        f"{mine}:breaks",
        "--cases",
        18,
        "--scored-cases",
        2,
        "--out",
        folder,
        "--json",
    )
    again = json.loads(call(*words, "--timed-cases", 0).stdout)
    before = json.loads(first.stdout)
    for planner in before["planners"].values():
        planner["decision_us"] = None
    assert again == before
    assert kept and kept == {path: path.stat().st_mtime_ns for path in folder.rglob("shard-*")}
    with pytest.raises(BadResults, match=r"\[results-other\]"):
        call(*words, "--seed", 2)


def test_ramp_keeps_its_durations_and_the_others_get_the_delay(tmp_path: Path) -> None:
    result = call(
        "compare", "ramp-guarded", "straight-ahead", "--cases", 9, "--command-delay", 0.1, "--workers", 1,
        "--scored-cases", 0, "--timed-cases", 0, "--out", tmp_path, "--json",
    )  # fmt: skip
    document = json.loads(result.stdout)
    answers = [planner["answers"] for planner in document["planners"].values()]
    assert answers == ["after its published durations", "after 100 ms"]
    assert "published" in document["note"] and document["command_delay_s"] == 0.1


@pytest.mark.parametrize(
    ("planners", "complaint"),
    [
        (["orca", "orca"], r"named once, but 'orca' and 'orca'.*\[compare-twice\]"),
        (["a/b.py:C", "a-b.py:C"], r"kept in the same folder.*\[compare-twice\]"),
        (["orcas"], r"did you mean 'orca'\?.*\[planner-unknown\]"),
    ],
)
def test_names_that_cannot_be_compared_are_refused(planners: list[str], complaint: str, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=complaint):
        call("compare", *planners, "--out", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_check_tells_what_is_wrong_and_its_exit_code_says_whether_something_is(mine: Path) -> None:
    wrong = call("planner", "check", f"{mine}:stand", "--only", "reaches_a_free_goal")
    assert wrong.exit_code == 1
    assert "error: 0.000 m in 30 s of an empty world" in wrong.stdout and "[never-moves]" in wrong.stdout
    right = call("planner", "check", "straight-ahead", "--only", "reaches_a_free_goal", "--json")
    assert right.exit_code == 0
    assert json.loads(right.stdout) == {
        "planner": "straight-ahead", "passed": True, "findings": [], "made": ["reaches_a_free_goal"], "left": [],
    }  # fmt: skip


@pytest.mark.parametrize(("name", "slug"), [("exits", "planner-raises"), ("kills", "process-dies")])
def test_a_check_of_a_planner_that_ends_its_process_fails_with_a_finding(mine: Path, name: str, slug: str) -> None:
    result = call("planner", "check", f"{mine}:{name}", "--json")
    assert result.exit_code == 1
    (finding,) = json.loads(result.stdout)["findings"]
    assert (finding["slug"], finding["level"]) == (slug, "error")


def test_the_checks_are_listed_with_what_they_demand() -> None:
    listed = json.loads(call("planner", "check", "orca", "--list", "--json").stdout)
    assert listed["is_quiet"] == "It prints nothing."
    assert "It prints nothing." in call("planner", "check", "orca", "--list").stdout


def test_the_tables_come_as_markdown_ready_for_a_document(compared: tuple[Path, Result], mine: Path) -> None:
    folder, _ = compared
    words = ("compare", f"{mine}:stand", f"{mine}:breaks", "--cases", 18, "--scored-cases", 0, "--timed-cases", 0)
    text = call(*words, "--out", folder, "--markdown").stdout
    assert text.startswith("Seed 1, protocol table-vii, 18 cases, the same for all.")
    line = next(line for line in text.splitlines() if line.startswith("| stuck in imminent collision, of the solvable"))
    assert line.replace("\xa0", " ").count("0.0 % [0.0, 17.6]") == 2
    with pytest.raises(BadRequest, match=r"\[compare-both\]"):
        call(*words, "--out", folder, "--markdown", "--json")


def test_added_delays_are_kept_with_the_campaign_and_only_for_ramp(tmp_path: Path) -> None:
    words = ("run", "ramp_system", "--cases", 3, "--workers", 1, "--added-sensing", 0.25, "--out", tmp_path / "late")
    ran = call(*words, "--json")
    summary = json.loads(ran.stdout)
    (late,) = summary.values()
    assert late["measures"]["min_clearance"]["n"] == 3 and 0.0 < late["measures"]["survivability"]["median"] < 1.0
    kept = json.loads((tmp_path / "late" / "campaign.json").read_text())
    assert kept["parameters"]["latencies"]["added_sensing"] == 0.25
    reported = call("report", tmp_path / "late")
    told = reported.stdout
    assert reported.exit_code == ran.exit_code
    assert "time in imminent collision" in told and "least time to collision" in told
    refused = call("run", "navigation", "--planner", "orca", "--added-stop", 0.1, "--out", tmp_path / "x")
    assert refused.exit_code == 2 and "No such option" in refused.output and "--added-stop" in refused.output
    assert not (tmp_path / "x").exists()
