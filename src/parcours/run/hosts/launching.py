"""Runs nodes as operating-system processes that end when their tester ends, and notices when one ends.

The processes are forked from a server that has loaded the code once. Each asks the system for a kill signal when that
server ends, and the server ends with the tester, however that comes about: no orphan is left.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Sequence
from multiprocessing import forkserver, resource_tracker
from multiprocessing.process import BaseProcess
from signal import SIGKILL

from parcours.errors import HostFailure
from parcours.run.hosts.frames import Broke, Died, Ready, Report, Rest
from parcours.run.hosts.node import live
from parcours.run.hosts.node_program import Line, Node, Transport, node_program_of
from parcours.run.hosts.scheduling import NODE_PRIORITY, ordinary, prefer_real_time

# The life of a node:
#
#   tester ──starts──► fork server (modules loaded once) ──forks──► node: _main -> live ──► Ready
#      │ pipe                 │ PR_SET_PDEATHSIG                        │
#      └─closes at its end──► ends ──────────SIGKILL─────────────────► ends, and its process group at `stop`
#
#   in order:  Quit ─► the node returns ─► `stop` joins it; after _GRACE it is killed.

_PARENT_DEATH = 1  # PR_SET_PDEATHSIG
_GRACE = 2.0
"""How long processes may take to end by themselves [s] before they are killed."""

_START = 120.0
"""How long the nodes may take to say that they are there [s]; the first start on a machine compiles."""


class Processes:
    """The processes of a transport's nodes."""

    def __init__(self, preload: Sequence[str] = ()) -> None:
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["parcours.run.hosts.node", *preload])
        self._running: dict[str, BaseProcess] = {}

    def start(self, node: Node, line: Callable[..., Line], *arguments: object) -> None:
        """Start a node's process."""
        process = self._context.Process(target=_main, args=(node, line, *arguments), name=node.component, daemon=True)
        try:
            _ensure_server()
            process.start()
        except (EOFError, OSError) as error:
            rule = f"must start, but the server that nodes are forked from does not answer: {type(error).__name__}"
            raise HostFailure(f"node {node.component}", rule, "its own words stand above", slug="node-start") from error
        self._running[node.component] = process

    def signal(self, node: str, number: int) -> None:
        """Send the node's process a signal; none to one that has ended."""
        if node in self._running:
            _send(self._running[node], number)

    def status(self, node: str, within: float = 0.0) -> int | None:
        """Return the node's exit status, negative for a signal; None if it has not ended `within` [s]."""
        process = self._running[node]
        process.join(within)
        return process.exitcode

    def pids(self) -> dict[str, int]:
        """Return the processes' numbers, by component."""
        return {name: process.pid for name, process in self._running.items() if process.pid is not None}

    def stop(self) -> None:
        """Wait for processes that have got Quit, and kill those that do not."""
        running = [process for process in self._running.values() if process.pid is not None]
        for process in running:
            _send(process, signal.SIGCONT)
        until = time.monotonic() + _GRACE
        for process in running:
            process.join(max(0.0, until - time.monotonic()))
            if process.is_alive():
                process.kill()
                process.join()
            if process.pid is not None:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
        self._running.clear()


class NodeProcesses(ABC):
    """What the tester's end of every transport has: a process for each node."""

    label = ""
    """The host's name in traces."""

    def __init__(self, nodes: Sequence[Node], preload: Sequence[str]) -> None:
        self._nodes = {node.component: node for node in nodes}
        self._processes = Processes(preload)
        self._dead: dict[str, int] = {}
        """Exit status of the nodes that have ended."""
        self._killed: set[str] = set()

    @property
    def nodes(self) -> Sequence[str]:
        """The components that have a node."""
        return tuple(self._nodes)

    @property
    def pids(self) -> dict[str, int]:
        """The processes' numbers, by component."""
        return self._processes.pids()

    def signal(self, node: str, signal: int) -> None:
        """Send the node's process a signal."""
        if signal == SIGKILL:
            self._killed.add(node)
        self._processes.signal(node, signal)

    @property
    def is_losing_one(self) -> bool:
        """Whether a process has ended, or is about to, whose end `poll` has not said yet."""
        # A process that was sent SIGKILL may still be there for a moment.
        return any(node in self._killed or self._processes.status(node) is not None
                   for node in self._nodes if node not in self._dead)  # fmt: skip

    @abstractmethod
    def poll(self, until: int) -> Sequence[tuple[str, Report]]:
        """Return what nodes have said, waiting until the monotonic clock shows `until` [ns]."""

    @abstractmethod
    def close(self) -> None:
        """End all nodes, and wait until they have ended. Again: do nothing."""

    def _start(self, line: Callable[..., Line], *arguments: object) -> None:
        for node in self._nodes.values():
            self._processes.start(node, line, *arguments)

    def _await_nodes(self, is_connected: Callable[[], bool] = lambda: True) -> None:
        """Return once all nodes have reported and `is_connected`. Raises HostFailure if a node does not start."""
        missing = set(self._nodes)
        deadline = time.perf_counter_ns() + int(_START * 1e9)
        while missing or not is_connected():
            for node, said in self.poll(time.perf_counter_ns() + 5_000_000):
                if isinstance(said, Broke):
                    self._processes.status(node, within=_GRACE)  # it leaves the graph in order if it is not killed
                    raise HostFailure(f"node {node}", f"must start, but raised {said.text}", slug="node-start")
                if isinstance(said, Died):
                    raise HostFailure(f"node {node}", f"must start, but its process ended: {ending(said.status)}",
                                      "its own words stand above", slug="node-start")  # fmt: skip
                missing.discard(node)
            if time.perf_counter_ns() > deadline:
                who = ", ".join(sorted(missing)) or "connection with all of them"
                rule = f"nodes must start within {_START:g} s, but there is no {who}"
                raise HostFailure(f"{self.label} host", rule, slug="node-start")

    @contextlib.contextmanager
    def _closing_on_failure(self) -> Iterator[None]:
        """Kill the nodes and close if the start fails: what hears them may belong to another tester."""
        try:
            yield
        except BaseException:
            for name in self.pids:
                self._processes.signal(name, signal.SIGKILL)
            self._dead = dict.fromkeys(self._nodes, 0)
            self.close()
            raise


def bring_to_rest(transport: Transport, nodes: Collection[str], within: int) -> tuple[dict[str, Died], set[str]]:
    """Let nodes forget what they were doing; return those that died, and those that hang [ns], which are killed.

    A node that hangs could not be told from one that goes on later, in the middle of another case.
    """
    waiting, died = set(nodes), {}
    for node in waiting:
        transport.signal(node, signal.SIGCONT)  # a fault may have frozen it
        transport.command(node, Rest())
    until = time.perf_counter_ns() + within
    while waiting and time.perf_counter_ns() < until:
        for node, said in transport.poll(until):
            if isinstance(said, Ready | Died):
                waiting.discard(node)
            if isinstance(said, Died):
                died[node] = said
    for node in waiting:
        transport.signal(node, SIGKILL)
    return died, waiting


def ending(status: int) -> str:
    """Return how a process ended, in words.

    >>> ending(-9), ending(3)
    ('killed by SIGKILL', 'exit status 3')
    """
    if status >= 0:
        return f"exit status {status}"
    known = {one.value: one.name for one in signal.Signals}
    return f"killed by {known.get(-status, f'signal {-status}')}"


def _ensure_server() -> None:
    """Start the server that processes are forked from, deaf to Ctrl-C: that is the tester's alone to hear."""
    resource_tracker.ensure_running()  # the server would start it, too, but hearing Ctrl-C again afterwards
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        with ordinary():  # what it loads and compiles must not stop the machine
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, masked)


def _let_go_of_server() -> None:
    """Close this process's copy of the pipe by which the server sees that its tester has ended.

    A node that hangs or is frozen would keep it open, and so the server and itself alive without end.
    """
    server = getattr(forkserver, "_forkserver", None)
    alive = getattr(server, "_forkserver_alive_fd", None)
    if alive is not None:
        os.close(alive)
        server._forkserver_alive_fd = None  # type: ignore[union-attr]


def _send(process: BaseProcess, number: int) -> None:
    if process.pid is not None and process.is_alive():
        with contextlib.suppress(ProcessLookupError):  # it has ended this very moment
            os.kill(process.pid, number)


def end_with_parent() -> None:
    """Ask the system to kill this process as soon as the process that started it has ended.

    Raises HostFailure if the system is not Linux.
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
    os.setpgrp()  # so that what a component starts can be ended with it
    _let_go_of_server()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the tester says Quit
    prefer_real_time(NODE_PRIORITY)
    mine = line(node, *arguments)
    try:
        node_program = node_program_of(node)
    except Exception as error:
        mine.report(Broke(time.perf_counter_ns(), f"{type(error).__name__}: {error}"))
        sys.exit(1)
    live(node, node_program, mine)
