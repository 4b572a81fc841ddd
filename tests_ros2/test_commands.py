"""The command line on ROS 2: a study is checked, run, recorded, judged again and reported, as anybody would do it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

COUNTER = Path(__file__).parent / "counter"
STUDY = "parcours: study/1\nname: counter\nkind: ros\nbinding: binding.yaml\n"


@pytest.fixture(scope="module")
def counter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study that was run with recordings: a client, a clerk, one case."""
    folder = shutil.copytree(COUNTER, tmp_path_factory.mktemp("commands") / "counter")
    (folder / "study.yaml").write_text(STUDY)
    ran = parcours(folder, "run", "study.yaml", "--out", "out", "--record", "mcap", "--case", "sale-tp11.tp31-0.0")
    assert ran.returncode == 0, ran.stderr
    return folder


def parcours(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with the nodes' Python first in the path."""
    env = {**os.environ, "ROS_DOMAIN_ID": "45"}
    env["PATH"] = f"{Path(sys.executable).parent}:{env['PATH']}"
    return subprocess.run([sys.executable, "-m", "parcours", *words], cwd=folder, env=env, capture_output=True,
                          text=True, check=False)  # fmt: skip


def test_a_run_keeps_each_case_its_recording_and_what_nodes_said(counter: Path) -> None:
    [case] = map(json.loads, (counter / "out" / "cases.jsonl").read_text().splitlines())
    assert (case["id"], case["verdict"]) == ("sale-tp11.tp31-0.0/0", "pass")
    assert [file.suffix for file in (counter / "out" / "recordings").iterdir()] == [".mcap"]
    assert (counter / "out" / "nodes").is_dir()


def test_recordings_are_judged_again_to_the_same_verdict_without_the_nodes(counter: Path) -> None:
    (counter / "client.py").rename(counter / "gone")
    try:
        again = parcours(counter, "judge", "out/recordings")
    finally:
        (counter / "gone").rename(counter / "client.py")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "1 of 1 recordings earn the verdict that was recorded" in again.stdout


def test_check_live_compares_what_is_running_and_names_what_is_not(counter: Path) -> None:
    fine = parcours(counter, "binding", "check", "binding.yaml", "--live")
    assert (fine.returncode, "the running system has all that is bound" in fine.stdout) == (0, True), fine.stderr
    wrong = counter / "wrong.yaml"
    text = (counter / "binding.yaml").read_text().replace("topic: /bill", "topic: /bil")
    for limit in ("6 s", "120 s"):  # What is absent is waited for to the end; on a busy machine nodes start later.
        wrong.write_text(text.replace("120 s", limit))
        said = parcours(counter, "binding", "check", "wrong.yaml", "--live")
        if "did you mean '/bill'?" in said.stderr:
            break
    assert (said.returncode, "did you mean '/bill'?" in said.stderr) == (2, True), said.stderr
    assert "Traceback" not in said.stderr, "the process apart says nothing of being asked to end"


def test_a_report_of_it_names_the_case(counter: Path) -> None:
    said = parcours(counter, "report", "out", "--junit", "junit.xml")
    assert said.returncode == 0, said.stderr
    assert "sale-tp11.tp31-0.0" in (counter / "junit.xml").read_text()
