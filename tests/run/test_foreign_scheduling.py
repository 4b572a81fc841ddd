"""Real time for foreign nodes: given where it is allowed, and the rule under which they run is known."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from parcours.run.hosts.foreign.process import KeptProcess
from parcours.run.hosts.scheduling import NODE_PRIORITY, real_time
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.foreign.judging import JudgedCase
from parcours_navigation.foreign.results import Result, tables

_STARTED = """
import os, sys
from pathlib import Path
from parcours.run.hosts.foreign.process import KeptProcess
one = KeptProcess("one", ["sleep", "60"], Path("/"), dict(os.environ), Path(sys.argv[1]), priority=9)
one.await_start()
print(one.rule, os.sched_getscheduler(one.pid))
one.end(0.0)
"""


def test_a_node_runs_in_real_time_where_that_is_allowed_and_its_keeper_does_not(tmp_path: Path) -> None:
    with real_time() as rule:
        is_allowed = rule.startswith("SCHED_FIFO")
    wanted = (f"SCHED_FIFO {NODE_PRIORITY}", os.SCHED_FIFO) if is_allowed else ("SCHED_OTHER", os.SCHED_OTHER)
    one = KeptProcess("one", ["sleep", "60"], tmp_path, dict(os.environ), tmp_path / "log", priority=NODE_PRIORITY)
    try:
        one.await_start()
        keeper = int(Path(f"/proc/{one.pid}/stat").read_text().rpartition(")")[2].split()[1])
        assert (one.rule, os.sched_getscheduler(one.pid)) == wanted
        assert os.sched_getscheduler(keeper) == os.SCHED_OTHER
    finally:
        one.end(0.0)


def test_a_node_runs_all_the_same_where_it_is_not_allowed(tmp_path: Path) -> None:
    words = ["setpriv", "--bounding-set=-sys_nice"] if os.geteuid() == 0 else ["prlimit", "--rtprio=0"]
    said = subprocess.run([*words, sys.executable, "-c", _STARTED, str(tmp_path / "log")], capture_output=True,
                          text=True, check=True)  # fmt: skip
    assert said.stdout.split() == ["SCHED_OTHER", str(os.SCHED_OTHER)]


_CROWD = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
for _ in range(3):
    if not os.fork():
        break
while True:
    pass
"""


def test_a_process_that_waits_for_its_turn_is_known_to_want_a_processor_and_one_that_sleeps_is_not(
    tmp_path: Path,
) -> None:
    one = KeptProcess("one", [sys.executable, "-c", _CROWD], tmp_path, dict(os.environ), tmp_path / "log")
    other = KeptProcess("other", ["sleep", "60"], tmp_path, dict(os.environ), tmp_path / "log")
    try:
        for process in (one, other):
            process.await_start()
        while one.effort() < 300_000_000:
            time.sleep(0.05)
        assert one.demand() > 2 * one.effort()
        assert one.is_wanting()
        assert other.demand() < 0.3 * one.demand()
        assert not other.is_wanting()
    finally:
        one.end(0.0)
        other.end(0.0)


def test_the_report_names_who_did_not_get_it() -> None:
    judged = JudgedCase(
        Judgement(Verdict.PASS, "well"), scheduling=(("Planner#0", "SCHED_OTHER"), ("Eyes", "SCHED_FIFO 9"))
    )
    [_, table] = tables([Result("a/0", "abstract", judged, 1.0)])
    assert [(row[0], row[2], str(row[3])[:16]) for row in table.rows] == [
        ("Eyes", 1, ""), ("Planner", 1, "not allowed here"),
    ]  # fmt: skip
