"""Runs a command, writes how it ends to a pipe, and lets nothing of it outlive the tester.

Run as a file: `process_keeper.py PARENT DESCRIPTOR FOLDER PRIORITY COMMAND ARGUMENT...`; FOLDER, unless empty, is
removed if the parent ends first; PRIORITY, unless 0, is that of SCHED_FIFO under which the command is to run. It adopts
what the command leaves behind, so that a node that starts others, or that a shell script starts, goes with all it has
started. It watches a pidfd: the death signal of the system would come as soon as the *thread* that started it ends, and
a pipe stays open in forked siblings.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import shutil
import signal
import sys
import time
from pathlib import Path

_PARENT_DEATH, _CHILD_SUBREAPER = 1, 36  # prctl(2)


def _run(command: list[str], say: int) -> None:
    """Become the command, in a process group of its own; the last resort should the keeper be killed is a signal."""
    os.setpgid(0, 0)
    ctypes.CDLL(None).prctl(_PARENT_DEATH, signal.SIGKILL)
    for number in (signal.SIGINT, signal.SIGPIPE):
        signal.signal(number, signal.SIG_DFL)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        os.write(say, f"failed {error.strerror}\n".encode())
    os._exit(127)


def _enter_real_time(priority: int) -> str:
    """Return under which rule this process runs from now on: the child takes it over, with all its threads."""
    if priority:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            return f"SCHED_FIFO {priority}"
    return "SCHED_OTHER"


def _children() -> list[int]:
    with contextlib.suppress(OSError):
        listed = Path(f"/proc/self/task/{os.getpid()}/children").read_text()
        return [int(word) for word in listed.split()]
    return []


def _end_all() -> None:
    """Kill whatever there is below, however deep, and wait for it."""
    until = time.monotonic() + 2.0
    while time.monotonic() < until:
        for pid in _children():
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.002)
        except ChildProcessError:
            return


# A process tree as the keeper sees it; whatever loses its parent below becomes the keeper's own child:
#
#   tester --starts--> keeper (subreaper) --fork--> command (group of its own) --> what it starts
#      ^ pidfd            |  pipe: rule, pid, failed, ended
#      '-- watched by ----'
def main(arguments: list[str]) -> None:
    """Keep the command for as long as PARENT lives."""
    parent, say, folder, priority, *command = arguments
    tester = os.pidfd_open(int(parent))
    if os.getppid() != int(parent):  # it has already ended
        return
    pipe = int(say)
    os.set_inheritable(pipe, False)
    ctypes.CDLL(None).prctl(_CHILD_SUBREAPER, 1)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    rule = _enter_real_time(int(priority))
    child = os.fork()
    if child == 0:
        _run(command, pipe)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.write(pipe, f"rule {rule}\n".encode())
    process = os.pidfd_open(child)
    os.write(pipe, f"pid {child}\n".encode())
    waiting = {tester, process}
    while process in waiting:
        ready, _, _ = select.select(list(waiting), [], [])
        if tester in ready:
            with contextlib.suppress(OSError):
                os.killpg(child, signal.SIGKILL)
            _end_all()
            if folder:
                shutil.rmtree(folder, ignore_errors=True)
            return
        if process in ready:
            ended = time.perf_counter_ns()
            _, status = os.waitpid(child, 0)
            os.write(pipe, f"ended {os.waitstatus_to_exitcode(status)} {ended}\n".encode())
            waiting.discard(process)
    _end_all()


if __name__ == "__main__":
    for ignored in (signal.SIGINT, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    main(sys.argv[1:])
