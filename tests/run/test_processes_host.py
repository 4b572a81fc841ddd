"""The processes host: nodes are started, watched and ended, and nothing of them is left behind, whoever is killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from parcours.errors import HostFailure
from parcours.run.hosts.battery import DUTIES, Counting, HostUnderTest, Sink, Source
from parcours.run.hosts.frames import Begin, Died, Grant, Idle, Look, OfferedTurn, Ready, Rest, RunFreely, Wire
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.slots import Answer
from parcours.run.port import ENVIRONMENT, Component, Link

LINKS = (Link("ask", ENVIRONMENT, "Counting", 100), Link("answer", "Counting", ENVIRONMENT, 100))
TOYS = "parcours.run.hosts.battery"


def toys(component: str) -> Plain:
    return Plain(component, {"Source": Source, "Sink": Sink, "Counting": Counting})


def toy_host(components: Sequence[Component], links: Sequence[Link], tester: Answer) -> HostUnderTest:
    transport = started([part.name for part in components], links)
    return RealTimeHost(transport, links, toys(""), environment=tester)


def started(names: Sequence[str] = ("Counting",), links: Sequence[Link] = LINKS) -> ProcessTransport:
    return ProcessTransport(nodes_of(links, names, f"{TOYS}:node_program"), [TOYS])


@pytest.fixture
def transport() -> Iterator[ProcessTransport]:
    transport = started(("Counting", "Source"))
    yield transport
    transport.close()


def said(transport: ProcessTransport, within: float = 10.0) -> list[tuple[str, object]]:
    """Return what nodes say next; nothing after so many seconds."""
    return list(transport.poll(time.perf_counter_ns() + int(within * 1e9)))


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that has ended but was not waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def all_end(pids: Sequence[int], within: float) -> bool:
    until = time.monotonic() + within
    while any(map(is_alive, pids)) and time.monotonic() < until:
        time.sleep(0.01)
    return not any(map(is_alive, pids))


@pytest.mark.parametrize("duty", DUTIES.values(), ids=DUTIES)
def test_it_does_what_every_host_owes(duty: Callable[..., None]) -> None:
    duty(toy_host)


def test_a_killed_node_is_noticed_with_its_signal_and_again_whenever_it_is_spoken_to(
    transport: ProcessTransport,
) -> None:
    os.kill(transport.pids["Counting"], signal.SIGKILL)
    [(node, died)] = said(transport)
    assert node == "Counting" and isinstance(died, Died) and died.status == -signal.SIGKILL
    assert said(transport, within=0.05) == []
    for command in (Rest(), RunFreely(b"", 0), Look(0)):
        transport.command("Counting", command)
        [(node, died)] = said(transport)
        assert node == "Counting" and isinstance(died, Died) and died.status == -signal.SIGKILL
    transport.command("Source", Rest())
    assert said(transport) == [("Source", Ready())], "the others go on"


def test_a_node_that_is_found_dead_while_it_is_sent_to_is_noticed_nevertheless(transport: ProcessTransport) -> None:
    pid = transport.pids["Counting"]
    os.kill(pid, signal.SIGKILL)
    assert all_end([pid], 5.0)
    for _ in range(3):
        transport.deliver("ask", 0, b"x")
        transport.command("Counting", Rest())
    [*_, (node, died)] = said(transport)
    assert node == "Counting" and isinstance(died, Died) and died.status == -signal.SIGKILL


def test_what_a_node_said_before_it_died_is_heard_before_its_death(transport: ProcessTransport) -> None:
    transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    transport.command("Counting", Rest())
    time.sleep(0.2)
    os.kill(transport.pids["Counting"], signal.SIGKILL)
    assert all_end([transport.pids["Counting"]], 5.0)
    heard: list[object] = []
    while not any(isinstance(one, Died) for one in heard):
        heard += [one for _, one in said(transport)]
    assert isinstance(heard[-1], Died) and Ready() in heard


def test_a_driven_node_takes_turns_and_shows_itself(transport: ProcessTransport) -> None:
    transport.command("Counting", Begin(b"", (4, 7), time.perf_counter_ns()))
    assert said(transport) == [("Counting", Ready())]
    asked = Wire("ask", toys("").encode("ask", None))
    for reference, transition in ((4, "c2"), (4, "c1"), (7, "c2")):
        transport.command("Counting", Grant(reference, (OfferedTurn(transition, given=asked),)))
        [(_, turned)] = said(transport)
        assert (turned.reference, turned.manner, turned.transition) == (reference, "taken", transition)  # type: ignore[attr-defined]
    transport.command("Counting", Look(4))
    [(_, shown)] = said(transport)
    assert shown.message is None  # type: ignore[attr-defined]


@pytest.mark.parametrize("at_rest", [True, False])
def test_closing_ends_nodes_even_frozen_ones_and_closing_again_does_nothing(at_rest: bool) -> None:
    transport = started(("Counting", "Source"))
    pids = list(transport.pids.values())
    if not at_rest:
        for name in transport.nodes:
            transport.signal(name, signal.SIGSTOP)
    begun = time.monotonic()
    transport.close()
    assert not any(map(is_alive, pids)) and time.monotonic() - begun < 6.0
    transport.close()
    transport.signal("Counting", signal.SIGKILL)


def test_a_node_whose_backlog_is_full_is_ended_all_the_same() -> None:
    transport = started()
    [pid] = transport.pids.values()
    transport.signal("Counting", signal.SIGSTOP)
    for number in range(8):
        transport.deliver("ask", number, b"x" * 4_000_000)
    begun = time.monotonic()
    transport.close()
    assert not is_alive(pid) and time.monotonic() - begun < 8.0


def test_a_message_to_nobody_here_goes_nowhere(transport: ProcessTransport) -> None:
    transport.deliver("answer", 0, b"x")
    transport.deliver("unheard of", 0, b"x")
    transport.command("Source", Rest())
    assert said(transport) == [("Source", Ready())]


NODE_PROGRAMS = {
    f"{TOYS}:nothing": "leads nowhere.*nothing",
    "no.such.module:node_program": "leads nowhere.*no",
    "no colon": "leads nowhere",
    f"{TOYS}:Plain": "TypeError",
}


@pytest.mark.parametrize("node_program", NODE_PROGRAMS)
def test_a_node_program_that_cannot_be_had_is_named_and_nothing_is_left_running(node_program: str) -> None:
    begun = time.monotonic()
    with pytest.raises(HostFailure, match=rf"node (Counting|Source).*{NODE_PROGRAMS[node_program]}.*node-start"):
        ProcessTransport(nodes_of(LINKS, ("Counting", "Source"), node_program), [TOYS])
    assert time.monotonic() - begun < 5.0
    names = [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children(os.getpid())]
    assert sum(b"forkserver" in name for name in names) <= 1, "the server stays, for the next; no node does"


def children(pid: int) -> list[int]:
    """Return all that descends from a process."""
    try:
        own = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [one for child in map(int, own) for one in (child, *children(child))]


TESTER = """
import os, sys, time
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.hosts.node_program import nodes_of
from parcours.run.port import Link
if __name__ == "__main__":
    links = (Link("numbers", "Source", "Sink"),)
    program = "parcours.run.hosts.battery:node_program"
    transport = ProcessTransport(nodes_of(links, ["Source", "Sink"], program))
    print(*transport.pids.values(), flush=True)
    {then}
"""


@pytest.fixture
def tester(tmp_path: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    begun: list[subprocess.Popen[str]] = []

    def begin(then: str) -> subprocess.Popen[str]:
        script = tmp_path / "tester.py"
        script.write_text(TESTER.replace("{then}", then))
        begun.append(subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                      text=True, start_new_session=True))  # fmt: skip
        return begun[-1]

    yield begin
    for one in begun:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(one.pid, signal.SIGKILL)
        one.communicate(timeout=10)


def pids_of(tester: subprocess.Popen[str]) -> list[int]:
    """Return its nodes, their fork server, and whatever else it has started."""
    assert tester.stdout is not None
    nodes = list(map(int, tester.stdout.readline().split()))
    others = set(children(tester.pid)) - set(nodes)
    assert len(nodes) == 2 and others
    return [*others, *nodes]


@pytest.mark.parametrize("frozen", [False, True])
def test_no_node_and_no_fork_server_outlives_a_tester_that_is_killed(
    tester: Callable[[str], subprocess.Popen[str]], frozen: bool
) -> None:
    process = tester("time.sleep(60)")
    pids = pids_of(process)
    if frozen:
        os.kill(pids[-1], signal.SIGSTOP)
    process.kill()
    assert all_end(pids, 3.0), [pid for pid in pids if is_alive(pid)]


def test_no_node_outlives_a_tester_that_forgets_to_close_or_raises(
    tester: Callable[[str], subprocess.Popen[str]],
) -> None:
    for then in ("sys.exit(3)", "raise RuntimeError('of the tester')", "os._exit(4)"):
        process = tester(then)
        assert process.stdout is not None
        nodes = list(map(int, process.stdout.readline().split()))
        _, complaint = process.communicate(timeout=20)
        assert all_end(nodes, 3.0)
        assert complaint.count("Traceback") == ("raise" in then)


def test_no_node_outlives_its_fork_server(transport: ProcessTransport) -> None:
    pids = list(transport.pids.values())
    [server] = {int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1]) for pid in pids}
    os.kill(server, signal.SIGKILL)
    assert all_end(pids, 3.0)
    assert {node for node, one in said(transport) + said(transport, 1.0) if isinstance(one, Died)} <= {
        "Counting",
        "Source",
    }
    again = started()
    again.command("Counting", Rest())
    assert said(again) == [("Counting", Ready())], "the next transport has a server of its own"
    again.close()


def test_idle_nodes_say_so_once_and_use_no_time(transport: ProcessTransport) -> None:
    transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    assert said(transport) == [("Counting", Idle(0))]
    used = processor_time(transport.pids["Counting"])
    assert said(transport, 0.3) == []
    assert processor_time(transport.pids["Counting"]) - used <= 2, "hundredths of a second"


def processor_time(pid: int) -> int:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])
