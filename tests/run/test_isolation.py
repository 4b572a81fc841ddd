"""A process moves into a network of its own, whoever runs it; every case in a process that may be spoilt."""

from __future__ import annotations

import os
import socket
import subprocess
import sys

_NOBODY = 65534
_RUN = [sys.executable, "-m", "parcours.run.hosts.isolation"]
_BECOME_NOBODY = f"""
import ctypes, os
if os.geteuid() == 0:
    os.setgroups([]); os.setgid({_NOBODY}); os.setuid({_NOBODY})
    ctypes.CDLL(None).prctl(4, 1, 0, 0, 0)  # as a program that nobody started: its /proc/self is its own
"""
_ENTER = """
import os, socket, subprocess, sys
import encodings.idna  # nobody may not read an interpreter in the home of root
from parcours.errors import HostFailure
from parcours.run.hosts.isolation import enter_own_network
def network():
    return os.readlink("/proc/self/ns/net")
{before}
before, user = network(), os.getuid()
try:
    enter_own_network()
except HostFailure as failure:
    print("refused", failure)
    sys.exit()
with socket.create_server(("127.0.0.1", 11311)) as server, socket.create_connection(server.getsockname()):
    pass
child = subprocess.run(["readlink", "/proc/self/ns/net"], capture_output=True, text=True).stdout.strip()
names = [name for _, name in socket.if_nameindex() if name == "lo"]
print("entered", network() != before, child == network(), names, os.getuid() == user)
"""


def _allowed(*, without_root: bool) -> bool:
    """Whether the machine allows it at all, asked with another tool."""
    may = [["unshare", "--net", "true"], ["unshare", "--user", "--net", "true"]][1 if without_root else 0 :]
    return any(subprocess.run(command, stderr=subprocess.DEVNULL).returncode == 0 for command in may)


def _told(before: str = "") -> str:
    script = _ENTER.format(before=before)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert not done.returncode, done.stderr
    return done.stdout.strip()


def _entered_or_refused(told: str, *, without_root: bool) -> None:
    if _allowed(without_root=without_root):
        assert told == "entered True True ['lo'] True"
    else:
        assert told.startswith("refused a network of its own: must be allowed by the machine")
        assert told.endswith("[network-namespace]")


def test_a_process_and_its_children_get_a_loopback_of_their_own() -> None:
    _entered_or_refused(_told(), without_root=False)


def test_who_is_not_root_gets_one_too_and_keeps_the_user_number() -> None:
    _entered_or_refused(_told(_BECOME_NOBODY), without_root=True)


def test_a_port_that_is_taken_outside_is_free_inside() -> None:
    with socket.create_server(("127.0.0.1", 0)) as outside:
        port = outside.getsockname()[1]
        listen = [sys.executable, "-c", f"import socket; socket.create_server(('127.0.0.1', {port})); print('free')"]
        assert subprocess.run(listen, capture_output=True, timeout=60).returncode, "it is taken"
        done = subprocess.run([*_RUN, *listen], capture_output=True, text=True, timeout=60)
    if _allowed(without_root=os.geteuid() != 0):
        assert done.stdout == "free\n"
    else:
        assert done.stderr.endswith("[network-namespace]\n")


def test_other_threads_of_python_are_refused_by_name() -> None:
    start = "import threading; threading.Thread(target=threading.Event().wait, daemon=True, name='pump').start()"
    told = _told(start)
    assert told == (
        "refused a network of its own: must be entered before threads exist, but there are also pump; "
        "call enter_own_network first [network-namespace]"
    )


def test_threads_of_libraries_are_refused_where_the_system_refuses_them() -> None:
    unseen = "import _thread, time; _thread.start_new_thread(time.sleep, (60,))"
    told = _told(_BECOME_NOBODY + unseen)
    if _allowed(without_root=True):
        assert "by a process of one thread only, but this one has 2; call enter_own_network before" in told
    assert told.startswith("refused") and told.endswith("[network-namespace]")


def test_a_command_runs_there_and_keeps_its_exit_status() -> None:
    script = "import socket, sys; print([n for _, n in socket.if_nameindex() if n[:3] == 'eth']); sys.exit(3)"
    done = subprocess.run([*_RUN, sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    if _allowed(without_root=os.geteuid() != 0):
        assert (done.returncode, done.stdout) == (3, "[]\n")
    else:
        assert done.returncode == 125 and done.stderr.endswith("[network-namespace]\n")


def test_a_command_that_does_not_exist_is_told() -> None:
    done = subprocess.run([*_RUN, "no-such-command-here"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 125 and done.stderr
