"""A real master starts on loopback, answers, and leaves nothing behind, however it or its parent ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.master import Master, require_master


def _lives(pid: int) -> bool:
    """Whether a process runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _soon(holds: Callable[[], bool], within: float = 10.0) -> bool:
    """Whether something comes to hold within that many seconds."""
    deadline = time.monotonic() + within
    while time.monotonic() < deadline:
        if holds():
            return True
        time.sleep(0.01)
    return holds()


def _listens_on(port: int) -> set[str]:
    """Return the addresses at which somebody listens on the port, as /proc writes them."""
    tables = "".join(Path(f"/proc/net/{table}").read_text() for table in ("tcp", "tcp6"))
    rows = [line.split() for line in tables.splitlines() if ":" in line.split()[0]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


def test_it_answers_and_listens_on_loopback_only() -> None:
    with Master() as master:
        assert require_master(master.uri, 1.0) == master.pid
        assert _listens_on(master.port) == {"0100007F"}
        assert os.environ["ROS_MASTER_URI"] == master.uri
        assert list(master.folder.rglob("master.log")), "it logs into its own folder"


def test_nothing_is_left_of_it_and_its_port_is_free_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://somewhere:1")
    monkeypatch.delenv("ROS_IP", raising=False)
    with pytest.raises(ZeroDivisionError), Master() as master:
        pid, folder, port = master.pid, master.folder, master.port
        _ = 1 / 0
    assert not _lives(pid) and not folder.exists() and not _listens_on(port)
    assert (os.environ["ROS_MASTER_URI"], os.environ.get("ROS_IP")) == ("http://somewhere:1", None)
    master.close()
    with Master(port) as again:
        assert again.port == port


def test_two_masters_run_side_by_side() -> None:
    with Master() as one, Master() as other:
        assert require_master(one.uri) != require_master(other.uri)


def test_a_port_that_is_taken_is_told_with_its_owner() -> None:
    began = time.monotonic()
    with Master() as first, pytest.raises(HostFailure) as caught:
        Master(first.port).__enter__()
    told = str(caught.value)
    assert f"port {first.port} of 127.0.0.1: must be free, but a ROS master (process " in told
    assert told.endswith("[port-in-use]")
    with socket.create_server(("127.0.0.1", 0)) as server, pytest.raises(HostFailure, match="another program"):
        Master(server.getsockname()[1]).__enter__()
    with pytest.raises(HostFailure, match="between 1 and 65535"):
        Master(70_000).__enter__()
    assert time.monotonic() - began < 5.0


def test_a_frozen_master_is_ended_all_the_same() -> None:
    with Master() as master:
        pid = master.pid
        os.kill(pid, signal.SIGSTOP)
    assert not _lives(pid)


_STANDING = """
import signal, sys, time
from parcours.run.hosts.ros1.master import Master
signal.signal(signal.SIGINT, signal.SIG_IGN)
with Master() as master:
    print(master.pid, master.folder, flush=True)
    sys.stdin.read()
"""


def _standing() -> tuple[subprocess.Popen[str], int, Path]:
    parent = subprocess.Popen(
        [sys.executable, "-c", _STANDING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    pid, folder = parent.stdout.readline().split()
    assert _lives(int(pid))
    return parent, int(pid), Path(folder)


def test_it_dies_with_a_parent_that_is_killed_and_takes_its_folder_along() -> None:
    parent, pid, folder = _standing()
    parent.kill()
    parent.communicate()
    assert _soon(lambda: not _lives(pid)) and _soon(lambda: not folder.exists())


def test_it_stops_by_its_interrupt_even_where_interrupts_are_ignored() -> None:
    parent, pid, folder = _standing()
    parent.communicate("")
    assert parent.returncode == 0 and not _lives(pid) and not folder.exists()


def test_it_outlives_the_thread_that_started_it() -> None:
    master = Master()
    starting = threading.Thread(target=master.__enter__)
    starting.start()
    starting.join()
    try:
        assert not _soon(lambda: not _lives(master.pid), within=0.5)
        assert require_master(master.uri) == master.pid
    finally:
        master.close()


@pytest.mark.parametrize(
    ("body", "rule"),
    [("raise SystemExit('no such luck')", "must run, but ended with status 1"), ("", "must answer within 1 s")],
)
def test_a_master_that_does_not_come_up_is_told_with_what_it_said(
    body: str, rule: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import tempfile

    said = "import sys, time\nprint('I am a strange master', flush=True)\n"
    (tmp_path / "rosmaster.py").write_text(f"{said}{body or 'time.sleep(60)'}\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(HostFailure) as caught:
        Master(within=1.0).__enter__()
    told = str(caught.value)
    assert rule in told and "I am a strange master" in told and told.endswith("[master-start]")
    assert not list(tmp_path.glob("parcours-ros1-*")), "its folder is gone"
