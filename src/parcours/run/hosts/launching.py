"""Nodes -> operating-system processes that run them, that end when their tester ends, and whose ends are noticed.

The processes are forked from a server that has loaded the code once. Each asks the system for a kill signal when that
server ends, and the server ends with the tester, however that comes about: no orphan is left.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Sequence
from multiprocessing.process import BaseProcess

from parcours.errors import HostFailure
from parcours.run.hosts.node import live
from parcours.run.hosts.resident import Line, Node, resident_of
from parcours.run.hosts.scheduling import prefer_real_time

_PARENT_DEATH = 1  # PR_SET_PDEATHSIG
_GRACE = 2.0
"""So long a process may take to end by itself [s] before it is killed."""


class Processes:
    """The processes of a fabric's nodes.

    Args:
        preload: modules that the server loads before it forks.
    """

    def __init__(self, preload: Sequence[str] = ()) -> None:
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["parcours.run.hosts.node", *preload])
        self._running: dict[str, BaseProcess] = {}

    def start(self, node: Node, line: Callable[..., Line], *arguments: object) -> None:
        """Start a node's process.

        Args:
            node: what it runs.
            line: called in the process with the node and the arguments, returns its end of the fabric.
        """
        process = self._context.Process(target=_main, args=(node, line, *arguments), name=node.component, daemon=True)
        process.start()
        self._running[node.component] = process

    def signal(self, node: str, number: int) -> None:
        """Send the node's process a signal; none to one that has ended."""
        process = self._running[node]
        if process.pid is not None and process.is_alive():
            os.kill(process.pid, number)

    def status(self, node: str, within: float = 0.0) -> int | None:
        """Return the node's exit status, negative for a signal; None if it has not ended `within` [s]."""
        process = self._running[node]
        process.join(within)
        return process.exitcode

    def pids(self) -> dict[str, int]:
        """Return the processes' numbers, by component."""
        return {name: process.pid for name, process in self._running.items() if process.pid is not None}

    def stop(self) -> None:
        """Wait for processes that were told to end, and kill those that do not."""
        for process in self._running.values():
            if process.pid is not None and process.is_alive():
                os.kill(process.pid, signal.SIGCONT)
        for process in self._running.values():
            process.join(_GRACE)
            if process.is_alive():
                process.kill()
                process.join()
        self._running.clear()


def end_with_parent() -> None:
    """Ask the system to kill this process as soon as the process that started it has ended.

    Raises:
        HostFailure: the system is not Linux.
    """
    if not sys.platform.startswith("linux"):
        rule = f"processes are bound to their tester's life on Linux only, but this is {sys.platform}"
        raise HostFailure("processes host", rule, "use the simulated host", slug="not-linux")
    ctypes.CDLL(None, use_errno=True).prctl(_PARENT_DEATH, signal.SIGKILL)


def _main(node: Node, line: Callable[..., Line], *arguments: object) -> None:
    parent = os.getppid()
    end_with_parent()
    if os.getppid() != parent:
        return  # it ended before it could be asked for
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the tester says Quit
    prefer_real_time()
    live(node, resident_of(node), line(node, *arguments))
