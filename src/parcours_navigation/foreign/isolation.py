"""Runs cases on foreign nodes in a process apart, whose network nobody else can reach.

A network of one's own is entered before a process has threads, which the one that shows progress has. So a fresh
interpreter runs the nodes, and says each result as soon as it is known:

    study                                    process apart
      | what is wanted (JSON, a line) ------------>|  enters its network, starts master and nodes
      |<-------------------- ("result", a dict) ...|
      |<------------------------ ("end", None) or  |
      |<------------- ("error", what was raised)   |
      | end of its standard input ---------------->|  the study is gone: ends, and all nodes with it
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from parcours.errors import HostFailure, ParcoursError

_ENDING = 15.0
"""How long the process may take to end its nodes and itself when it is asked to [s]."""


@dataclass(frozen=True, slots=True)
class ProcessOrder:
    """What is wanted of a process apart.

    Attributes:
        binding: its file.
        out: folder for recordings and the output of the nodes.
        own: whether to enter a network of its own.
        master: of a ROS 1 master that runs; else one of its own.
        seed: of obstacles and test inputs.
        protocol: of the obstacles.
        faults: a plan of faults as text, or a file; empty for none.
        record: mcap, bag or empty.
        repeats: of each span; 0 for no timing.
        abstract: ids of abstract cases.
        system: numbers of system cases.
        passive: name of a span -> its durations in earlier system cases, in shares [ns].
        about: what recordings say besides.
        only_check: start the nodes once, compare what they register with the binding, and run nothing.
    """

    binding: str
    out: str
    own: bool = True
    master: str = ""
    seed: int = 1
    protocol: str = "table-vii"
    faults: str = ""
    record: str = ""
    repeats: int = 0
    abstract: tuple[str, ...] = ()
    system: tuple[int, ...] = ()
    passive: Mapping[str, Sequence[Sequence[int]]] = field(default_factory=dict)
    about: Mapping[str, str] = field(default_factory=dict)
    only_check: bool = False


def run_apart(order: ProcessOrder) -> Iterator[dict[str, object]]:
    """Yield the result of each case (`results.entry_of`) as soon as it is known. Closing it ends the nodes.

    Raises:
        ParcoursError: whatever of ours was raised there.
        HostFailure: the process ended before it was done.
    """
    reading, writing = os.pipe()
    words = [sys.executable, "-m", __spec__.name, str(writing)]
    with Connection(reading, writable=False) as line:
        process = subprocess.Popen(words, stdin=subprocess.PIPE, pass_fds=(writing,), start_new_session=True)
        os.close(writing)
        try:
            assert process.stdin is not None
            with contextlib.suppress(BrokenPipeError):
                process.stdin.write(json.dumps(asdict(order)).encode() + b"\n")
                process.stdin.flush()
            while (said := _heard(line))[0] == "result":
                yield said[1]  # type: ignore[misc]
            if said[0] == "error":
                raise said[1]  # type: ignore[misc]
            if said[0] != "end":
                rule = f"must run to its end, but ended with status {process.wait()}"
                where, remedy = "the process that runs the nodes", "its last words are above"
                raise HostFailure(where, rule, remedy, slug="foreign-apart")
        finally:
            _end(process)


def _heard(line: Connection) -> tuple[str, object]:
    try:
        kind, content = line.recv()
    except (EOFError, OSError):
        return "lost", None
    return str(kind), content


def _end(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(OSError):
        process.terminate()
    try:
        process.communicate(timeout=_ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def main(descriptor: int) -> None:
    """Be the process apart: obey the order on standard input, and say results on a pipe."""
    os.dup2(2, 1)  # standard output is the study's, who may write JSON there
    line = Connection(descriptor, readable=False)
    os.set_inheritable(descriptor, False)
    signal.signal(signal.SIGTERM, _stop)
    try:
        given = json.loads(sys.stdin.readline())
        order = ProcessOrder(**given)
        if order.own:
            from parcours.run.hosts.isolation import enter_own_network

            enter_own_network()
        threading.Thread(target=_end_with_study, daemon=True, name="lifeline").start()
        _obey(order, lambda kind, content: line.send((kind, content)))
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends now anyway
        line.send(("end", None))
    except ParcoursError as error:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        line.send(("error", error))
    except (KeyboardInterrupt, BrokenPipeError):
        pass


def _stop(number: int, frame: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once: what it interrupts must be able to end the nodes
    raise KeyboardInterrupt


def _end_with_study() -> None:
    sys.stdin.read()
    os.kill(os.getpid(), signal.SIGTERM)


def _obey(order: ProcessOrder, say: Callable[[str, object], None]) -> None:
    from parcours.run.binding import read_binding
    from parcours.run.hosts.foreign.host import ForeignHost

    binding, out = read_binding(order.binding), Path(order.out)
    if order.only_check and binding.stack is not None:
        from parcours_navigation.foreign.stack_nodes import check_stack

        check_stack(binding)
        say("result", {"proposals": []})
        return
    with ForeignHost(binding, out / "nodes", order.master, is_shared=not order.own) as host:
        if order.only_check:
            from parcours_navigation.foreign.checking import check_live

            say("result", {"proposals": check_live(host)})
            return
        from parcours_navigation.foreign.running import ForeignStudy

        for result in ForeignStudy(host, order).run():
            say("result", result.entry())


if __name__ == "__main__":
    main(int(sys.argv[1]))
