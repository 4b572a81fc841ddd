"""Services through the tester: calls and their answers keep their order, and a call that nobody answers is ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import pytest
from tests_ros2.conftest import soon
from tests_ros2.desks import CHANNELS, LINKS, node_program

from parcours.run.faults.plan import ChannelFault, ComponentFault, FaultPlan
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.ros2.participant import Ros2Participant
from parcours.run.hosts.ros2.transport import Ros2Transport

SECOND = 1_000_000_000

Desk = Callable[..., RealTimeHost]


class Told(list[object]):
    """What the tester is told; answers nothing."""

    def __call__(self, channel: str, payload: object, now: int) -> Sequence[tuple[str, object]]:
        self.append(payload)
        return ()


@pytest.fixture
def desk() -> Iterator[Desk]:
    made: list[RealTimeHost] = []

    def make(told: Told, names: Sequence[str] = ("Asker", "Oracle"), faults: FaultPlan | None = None) -> RealTimeHost:
        transport = Ros2Transport(nodes_of(LINKS, names, "tests_ros2.desks:node_program"), CHANNELS)
        made.append(RealTimeHost(transport, LINKS, node_program(""), environment=told, faults=faults))
        return made[-1]

    yield make
    for host in made:
        host.close()


def test_answers_come_in_the_order_of_the_questions(desk: Desk) -> None:
    told = Told()
    host = desk(told)
    for number in range(200):
        host.inject("go", number)
    host.run(20 * SECOND)
    assert told == list(range(200))


def test_answers_that_answer_no_call_arrive_too(desk: Desk) -> None:
    told = Told()
    host = desk(told)
    for message in ([1, 2, 3], 4, [], [5, 6], 7):
        host.inject("go", message)
    host.run(20 * SECOND)
    assert told == [1, 2, 3, 4, 5, 6, 7]


def test_the_environment_can_answer_what_was_never_asked(desk: Desk) -> None:
    told = Told()
    host = desk(told, ["Asker"])
    for message in ("made up", "this, too"):
        host.inject("answer", message)
    host.run(20 * SECOND)
    assert told == ["made up", "this, too"]


def test_the_environment_can_ask(desk: Desk) -> None:
    told = Told()
    host = desk(told, ["Oracle"])
    for message in (1, "nobody answers this", 2):
        host.inject("question", message)
    host.run(20 * SECOND)
    assert told == [1, 2]


def test_after_a_reset_no_answer_is_taken_for_one_to_an_earlier_call(desk: Desk) -> None:
    told = Told()
    host = desk(told)
    for _ in range(3):
        for message in ("nobody answers this", [1, 2], "nor this", 3):
            host.inject("go", message)
        host.run(20 * SECOND)
        host.reset()
    assert told == [1, 2, 3] * 3


def test_answers_that_a_fault_drops_leave_no_gap(desk: Desk) -> None:
    told = Told()
    host = desk(told, faults=FaultPlan(1, (ChannelFault("answer", "drop", 0.5),)))
    for number in range(100):
        host.inject("go", number)
    host.run(20 * SECOND)
    assert 10 < len(told) < 90
    assert told == [number for number in range(100) if number in told]


def test_a_call_that_nobody_answers_is_ended_when_the_node_rests(desk: Desk) -> None:
    host = desk(Told())
    host.inject("go", 0)
    host.run(20 * SECOND)
    caller = Ros2Participant("stranger")
    ended: list[bytes | None] = []
    oracle = caller.call("/oracle")
    assert soon(lambda: oracle.is_matched)
    question = node_program("").encode("question", "nobody answers this")
    oracle.ask(question, lambda answer, why: ended.append(answer))
    caller.spin(time.perf_counter_ns() + 200_000_000)
    assert not ended
    host.reset()
    assert caller.spin(time.perf_counter_ns() + 5 * SECOND)
    caller.close()
    assert ended == [None]


def test_who_asks_may_die_before_the_answer(desk: Desk) -> None:
    told = Told()
    host = desk(told, faults=FaultPlan(1, (ComponentFault("Asker", "crash", at_ns=SECOND // 2),)))
    host.inject("go", 1)
    host.inject("go", "nobody answers this")
    host.inject("go", 2, at=SECOND)
    host.run(2 * SECOND)
    assert told == [1]
    assert host.deaths == {"Asker": "killed by SIGKILL"}
    assert [event.text for event in host.trace().events if event.kind == "drop"] == ["its receiver is dead"]
