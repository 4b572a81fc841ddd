"""Twenty system cases in real time: RAMP's components as ROS 1 nodes, two graphs side by side, each with a master."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from parcours_ramp.system.live_results import rejudge

PARCOURS = (sys.executable, "-m", "parcours")
CASES = 10
KNOWN = ("goal reached", "the goal was not reached", "the robot drove", "an obstacle rests")
SECONDS = 5.0
"""Of each case, after the second in which nothing moves: long enough to plan, drive, and meet obstacles."""


def run(schedule: str, out: Path) -> subprocess.Popen[str]:
    given = ("run", "ramp_system", "--host", "ros1", "--schedule", schedule, "--seed", "7", "--cases", str(CASES))
    more = ("--time-limit", str(SECONDS), "--record", "mcap", "--out", str(out), "--json", "--fail-if", "deaths > 0")
    return subprocess.Popen([*PARCOURS, *given, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_twenty_system_cases_run_live_conform_to_the_model_and_are_judged_again_the_same(tmp_path: Path) -> None:
    started = {schedule: run(schedule, tmp_path / schedule) for schedule in ("original", "guarded")}
    for schedule, process in started.items():
        said, complaint = process.communicate(timeout=300)
        assert process.returncode == 0, complaint
        (results,) = json.loads(said).values()
        assert len(results) == CASES
        for result in results:
            assert result["deaths"] == {}
            assert result["why"].startswith(KNOWN)
            moved = result["outcome"] == "reached" or result["seconds"] == 1.0 + SECONDS
            assert moved, result
        recordings = sorted((tmp_path / schedule / "recordings").glob("*.mcap"))
        assert len(recordings) == CASES
        for path in recordings[::3]:
            assert rejudge(path).agrees, path
