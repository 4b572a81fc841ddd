"""The ROS 1 host does what every host owes, loses nothing at 2000 messages a second, and answers calls in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest
from tests_ros1 import ros1_toys as toys

from parcours.run.faults.plan import ChannelFault, FaultPlan
from parcours.run.hosts.battery import DUTIES, HostUnderTest
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.hosts.slots import Answer
from parcours.run.port import ENVIRONMENT, Component, Link, LinkKind, links
from parcours.run.trace import transitions

Start = Callable[..., Ros1Transport]
_LIMIT = 20_000_000_000


@pytest.mark.parametrize("duty", DUTIES.values(), ids=DUTIES)
def test_it_does_what_every_host_owes(duty: Callable[..., None], start: Start) -> None:
    def toy_host(components: Sequence[Component], some: Sequence[Link], tester: Answer) -> HostUnderTest:
        transport = start(some, [part.name for part in components])
        return RealTimeHost(transport, some, toys.CODEC, environment=tester)

    duty(toy_host)


def test_nothing_is_lost_at_two_thousand_messages_a_second(start: Start) -> None:
    some = (Link("numbers", "Source", "Sink", 1, LinkKind.SERVICE), Link("seen", "Sink", ENVIRONMENT, 1000))
    transport = start(some, ["Source", "Sink"], kind="many")
    host = RealTimeHost(transport, some, toys.CODEC)
    host.run(_LIMIT)
    host.close()
    assert [e.payload for e in host.trace().events if e.kind == "receive" and e.channel == "seen"] == list(range(2000))
    assert not transport.refusals


CLIENT_AND_SERVER = links(toys.MODEL)


def test_a_client_s_calls_pass_through_the_tester_and_are_answered_in_order(start: Start) -> None:
    transport = start(CLIENT_AND_SERVER, ["Client", "Counting"], model=toys.MODEL)
    host = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC)
    host.run(_LIMIT)
    trace = host.trace()
    assert [e.payload for e in trace.events if e.kind == "receive" and e.channel == "ask"] == ["x", "xx", "xxx"]
    assert [e.payload for e in trace.events if e.kind == "send" and e.channel == "seen"] == [1, 2, 3]
    host.close()


def test_messages_that_no_socket_holds_pass_through_the_tester(start: Start) -> None:
    transport = start(CLIENT_AND_SERVER, ["Client", "Counting"], model=toys.MODEL, kind="many")
    host = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC)
    host.run(_LIMIT)
    events = host.trace().events
    assert [len(str(e.payload)) for e in events if e.kind == "receive" and e.channel == "ask"] == [
        10_000,
        20_000,
        30_000,
    ]
    assert [e.payload for e in events if e.kind == "send" and e.channel == "seen"] == [1, 2, 3]
    host.close()


def test_calls_that_nobody_answers_end_when_the_nodes_rest_and_are_not_mixed_up_with_the_next(
    start: Start,
) -> None:
    transport = start(CLIENT_AND_SERVER, ["Client", "Counting"], model=toys.MODEL)
    lossy = FaultPlan(0, (ChannelFault("answer", "drop"),))
    host = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC, faults=lossy)
    host.run(_LIMIT)
    assert "p" not in transitions(host.trace()), "no answer has come"
    host.reset()
    host.reset()
    whole = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC)
    whole.run(_LIMIT)
    assert [e.payload for e in whole.trace().events if e.kind == "send" and e.channel == "seen"] == [1, 2, 3]
    host.close()


def test_answers_that_were_never_asked_for_reach_the_client_and_real_ones_after_them_their_calls(start: Start) -> None:
    transport = start(CLIENT_AND_SERVER, ["Client"], model=toys.MODEL)
    host = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC)
    for count in (41, 42, 43, 44, 45):
        host.inject("answer", count)
    host.run(_LIMIT)
    assert [e.payload for e in host.trace().events if e.kind == "send" and e.channel == "seen"] == [41, 42, 43, 44, 45]
    asked = [e.payload for e in host.trace().events if e.kind == "send" and e.channel == "ask"]
    assert asked == ["x", "xx", "xxx"], "calls without content are no messages of the model"
    host.close()


def test_a_service_s_answers_reach_the_environment_that_asks(start: Start) -> None:
    transport = start(CLIENT_AND_SERVER, ["Counting"], model=toys.MODEL)
    host = RealTimeHost(transport, CLIENT_AND_SERVER, toys.CODEC)
    host.inject("ask", "a")
    host.inject("ask", "b" * 60)
    host.run(_LIMIT)
    assert [e.payload for e in host.trace().events if e.kind == "receive" and e.channel == "answer"] == [1, 2]
    host.close()
