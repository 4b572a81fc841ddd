"""Real-time scheduling: had where it is allowed, done without where it is not, and given back afterwards."""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
import sys

import pytest

from parcours.run.hosts.scheduling import PRIORITY, prefer_real_time, real_time

_DROP_CAPABILITY, _SYS_NICE = 24, 23
STATE = "(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)"
REPORT = f"""
import os
from parcours.run.hosts.scheduling import prefer_real_time, real_time
first = {STATE}
with real_time() as rule:
    inside = {STATE}
print(first == {STATE}, rule, *inside)
"""


def forbid() -> None:
    """Forbid real-time scheduling to the program that this process is about to become, root's included."""
    ctypes.CDLL(None).prctl(_DROP_CAPABILITY, _SYS_NICE, 0, 0, 0)
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))


def said(script: str, *, allowed: bool) -> list[str]:
    """Return what a script says in a process of its own."""
    before = None if allowed else forbid
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, preexec_fn=before)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_the_class_that_was_is_restored_and_the_rule_told_is_the_one_in_force() -> None:
    restored, rule, *rest = said(REPORT, allowed=True)
    assert restored == "True"
    if rule == "SCHED_FIFO":
        assert rest == [str(PRIORITY), str(os.SCHED_FIFO), str(PRIORITY)]
    else:
        assert [rule, *rest] == ["SCHED_OTHER", str(os.SCHED_OTHER), "0"]


def test_without_permission_all_goes_on_in_the_ordinary_class() -> None:
    assert said(REPORT, allowed=False) == ["True", "SCHED_OTHER", str(os.SCHED_OTHER), "0"]


def test_what_is_raised_inside_passes_and_the_class_is_restored_all_the_same() -> None:
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    with pytest.raises(ZeroDivisionError), real_time():
        raise ZeroDivisionError
    assert (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority) == before


def test_a_refusal_is_told_as_the_ordinary_class(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    assert prefer_real_time() == "SCHED_OTHER"
    with real_time() as rule:
        assert rule == "SCHED_OTHER"


HOST = f"""
import os, pathlib
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.scheduling import real_time
from parcours.run.port import Link
if __name__ == "__main__":
    links = (Link("numbers", "Source", "Sink"),)
    with real_time():
        transport = ProcessTransport(nodes_of(links, ["Sink"], "parcours.run.hosts.battery:node_program"))
        [pid] = transport.pids.values()
        server = int(pathlib.Path(f"/proc/{{pid}}/stat").read_text().rpartition(")")[2].split()[1])
        print({STATE}[0], os.sched_getscheduler(pid), os.sched_getscheduler(server))
    transport.close()
    print({STATE}[0])
"""


@pytest.mark.parametrize("allowed", [True, False])
def test_tester_and_nodes_are_of_one_class_and_a_host_starts_without_permission(allowed: bool) -> None:
    during, of_node, of_server, afterwards = map(int, said(HOST, allowed=allowed))
    assert during == of_node and of_server == afterwards == os.SCHED_OTHER, "loading code must not stop the machine"
    assert allowed or during == os.SCHED_OTHER
