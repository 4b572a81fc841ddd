"""Real-time scheduling: had where it is allowed, done without where it is not, and given back afterwards."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from parcours.run.hosts import scheduling
from parcours.run.hosts.scheduling import PRIORITY, prefer_real_time, real_time

STATE = "(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)"
REPORT = f"""
import os
from parcours.run.hosts.scheduling import prefer_real_time, real_time
{{before}}
first = {STATE}
with real_time() as rule:
    inside = {STATE}
print(first == {STATE}, rule, *inside)
"""


def reported(before: str = "") -> list[str]:
    """Return what a process of its own says of itself: restored, rule, class and priority inside."""
    done = subprocess.run([sys.executable, "-c", REPORT.format(before=before)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def as_nobody() -> str:
    return "os.setgid(65534); os.setgroups([]); os.setuid(65534)" if os.geteuid() == 0 else ""


def test_the_class_that_was_is_restored_and_the_rule_told_is_the_one_in_force() -> None:
    restored, rule, *rest = reported()
    assert restored == "True"
    if rule == "SCHED_FIFO":
        assert rest == [str(PRIORITY), str(os.SCHED_FIFO), str(PRIORITY)]
    else:
        assert [rule, *rest] == ["SCHED_OTHER", str(os.SCHED_OTHER), "0"]


def test_without_permission_all_goes_on_in_the_ordinary_class() -> None:
    import resource

    before = "import resource; resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); " + as_nobody()
    assert resource.RLIM_INFINITY != 0
    assert reported(before) == ["True", "SCHED_OTHER", str(os.SCHED_OTHER), "0"]


def test_what_is_raised_inside_passes_and_the_class_is_restored_all_the_same() -> None:
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    with pytest.raises(ZeroDivisionError), real_time():
        raise ZeroDivisionError
    assert (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority) == before


def test_a_refusal_is_told_as_the_ordinary_class(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object) -> None:
        raise PermissionError

    monkeypatch.setattr(scheduling.os, "sched_setscheduler", refused)
    assert prefer_real_time() == "SCHED_OTHER"
    with real_time() as rule:
        assert rule == "SCHED_OTHER"


HOST = """
import os, sys
from parcours.run.port import links
from parcours.studies.hosting import started
from parcours.studies.ramp_components.model import component_model
from parcours.run.hosts.frames import Rest
if __name__ == "__main__":
    import resource; resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    {before}
    model = component_model()
    links = links(model)
    with started("processes", links, ["Sink"], "parcours.run.hosts.toys:resident", []) as fabric:
        print({state}[0], *(os.sched_getscheduler(pid) for pid in fabric.pids.values()))
"""


def test_a_host_starts_without_permission(tmp_path: object) -> None:
    script = HOST.format(before=as_nobody(), state=STATE)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(os.SCHED_OTHER)] * 2
