"""The arguments of rosmaster -> a ROS 1 master that ends, and removes its folder, when the process that wanted it ends.

Run as a file, by any Python that has rosmaster: `core.py PARENT FOLDER --core -p PORT`. The death signal of the system
would come as soon as the *thread* that started the master ends, and a pipe stays open in forked siblings: it watches a
pidfd.
"""

from __future__ import annotations

import os
import select
import shutil
import signal
import sys
import threading


def _end(folder: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    os.kill(os.getpid(), signal.SIGKILL)


def _watch(process: int, folder: str) -> None:
    select.select([process], [], [])
    _end(folder)


def main(arguments: list[str]) -> None:
    """Be the master for as long as PARENT lives."""
    parent, folder, *rest = arguments
    # A tester's real-time priority is not for its master, which may spin and would then starve the machine.
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    process = os.pidfd_open(int(parent))
    if os.getppid() != int(parent):  # it has already ended
        _end(folder)
    threading.Thread(target=_watch, args=(process, folder), daemon=True).start()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit that it is ignored
    import rosmaster

    rosmaster.rosmaster_main(["rosmaster", *rest])


if __name__ == "__main__":
    del sys.path[0]
    main(sys.argv[1:])
