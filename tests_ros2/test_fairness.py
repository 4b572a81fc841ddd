"""What foreign nodes may expect of their tester: patience, answers that fit, no blame for what it made up itself."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from parcours.run.binding import read_binding
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.scheduling import NODE_PRIORITY
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.results import Result
from parcours_navigation.foreign.running import ForeignStudy
from parcours_navigation.foreign.tester_messages import Maker

SALE = "sale-tp11.tp31-0.0/0"


@pytest.fixture
def counter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The binding of a client and a clerk, to be changed."""
    shutil.copytree(Path(__file__).parent / "counter", tmp_path / "counter")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "44")
    return tmp_path / "counter" / "binding.yaml"


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1, old
    file.write_text(text.replace(old, new))


def run(binding: Path, out: Path, **wanted: Any) -> list[Result]:
    with ForeignHost(read_binding(binding), out / "nodes") as host:
        return list(ForeignStudy(host, ProcessOrder(str(binding), str(out), **wanted)).run())


def test_calls_wait_for_their_server_latched_messages_for_their_listener_and_parameters_reach_their_node(
    counter: Path, tmp_path: Path
) -> None:
    with ForeignHost(read_binding(counter), tmp_path) as host:
        session = Session(host, whole(host.binding))
        try:
            session.start()
            maker = Maker(host.compile())
            session.relay.inject("order", maker.of_the_environment("order", session.now()))
            until = session.now() + 60_000_000_000
            sent = lambda channel: [e for e in session.relay.events if (e.kind, e.channel) == ("send", channel)]  # noqa: E731
            while not (sent("bill") and sent("posted")) and session.now() < until:
                session.poll(until)
        finally:
            session.end()
        decoder = Decoder(host.binding, host.graph.types)
        [bill] = [decoder.message("bill", event.payload.content) for event in sent("bill")]
        assert bill.point.x == 7.0 + (1.0 + 41.0) + (100.0 + 41.0) and bill.header.stamp.sec > 0
        assert decoder.message("posted", sent("posted")[0].payload.content).point.x == 3.0


def test_a_call_outside_the_case_is_answered_by_the_real_server(counter: Path, tmp_path: Path) -> None:
    [result] = run(counter, tmp_path, abstract=(SALE,))
    assert result.judged.judgement.passed, result.judged.judgement.why


def test_an_answer_of_the_tester_that_cannot_be_read_is_nobody_s_fault(counter: Path, tmp_path: Path) -> None:
    edit(counter, "    answer: node\n", "")
    edit(counter, '    inject:\n      set: {"plan.poses[0].pose.position.x": 0.0}\n', "")
    [result] = run(counter, tmp_path, abstract=(SALE,))
    assert result.judged.judgement.verdict is Verdict.INCONCLUSIVE, result.judged.judgement.why
    assert "Client#0 did not take c2 (send bill) within 4 s" in result.judged.judgement.why


def test_what_never_ends_in_all_repeats_fails(counter: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    edit(counter, "/clerk/fee: 41.0", "/clerk/fee: -410.0")
    monkeypatch.setattr("parcours_navigation.foreign.timing._LONGEST", 5_000_000)
    [result] = run(counter, tmp_path, repeats=200)
    assert result.judged.judgement.verdict is Verdict.FAIL, result.judged.judgement.why
    assert "p99 of 200 repeats is never" in result.judged.judgement.why


@pytest.mark.parametrize("priority", [NODE_PRIORITY, 0])
def test_a_limit_is_not_missed_by_a_node_that_did_not_get_its_real_time(
    counter: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, priority: int
) -> None:
    edit(counter, "/clerk/fee: 41.0", "/clerk/fee: -410.0")
    edit(counter, "ros_node: /client", "ros_node: /client\n    realtime: true")
    edit(counter, "p99 < 1 s over 200 repeats", "p50 < 1 s over 10 repeats")
    monkeypatch.setattr("parcours_navigation.foreign.timing._LONGEST", 5_000_000)
    monkeypatch.setattr("parcours.run.hosts.foreign.host.NODE_PRIORITY", priority)  # 0: as where it is not allowed
    [result] = run(counter, tmp_path, repeats=10)
    [(name, rule)] = result.judged.scheduling
    if rule == "SCHED_OTHER":
        assert result.judged.judgement.verdict is Verdict.INCONCLUSIVE
        assert "Client was to run in real time, which is not allowed here" in result.judged.judgement.why
    else:
        assert (name, rule, result.judged.judgement.verdict) == ("Client", "SCHED_FIFO 9", Verdict.FAIL)
