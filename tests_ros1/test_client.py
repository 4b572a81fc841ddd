"""Ends of topics and services on a real master: messages keep their order, a broken connection is made again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from parcours.errors import HostFailure
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.ros1.client import Ros1Node
from parcours.run.hosts.ros1.endpoints import Kind
from parcours.run.hosts.ros1.graph import ask

TEXT = Kind("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n")
ASK = Kind("toys/Ask", "0" * 32)
Join = Callable[[str], Ros1Node]


def _spin(*nodes: Ros1Node, until: Callable[[], object], within: float = 10.0) -> None:
    """Let nodes hear until something holds."""
    deadline = time.monotonic() + within
    while not until():
        assert time.monotonic() < deadline
        for one in nodes:
            one.spin(time.perf_counter_ns() + 1_000_000)


@pytest.fixture
def node(master: str) -> Iterator[Join]:
    with ExitStack() as all_:

        def made(name: str) -> Ros1Node:
            one = Ros1Node(name, master)
            all_.callback(one.close)
            return one

        yield made


def test_messages_arrive_in_order(node: Join) -> None:
    speaker, listener = node("/speaker"), node("/listener")
    loud, quiet = (speaker.publish(topic, TEXT, peer="/listener") for topic in ("/loud", "/quiet"))
    speaker.join()
    heard: dict[str, list[bytes]] = {"/loud": [], "/quiet": []}
    for topic in heard:
        listener.subscribe(topic, TEXT, heard[topic].append, peer="/speaker")
    _spin(listener, until=lambda: loud.is_matched and quiet.is_matched)
    for k in range(1000):
        loud.send(b"%d" % k)
        quiet.send(b"%d" % -k, b"and")
    _spin(listener, until=lambda: sum(map(len, heard.values())) == 3000)
    assert heard["/loud"] == [b"%d" % k for k in range(1000)]
    assert heard["/quiet"] == [one for k in range(1000) for one in (b"%d" % -k, b"and")]


def test_only_the_publisher_that_is_named_is_heard(node: Join, master: str) -> None:
    refused: list[str] = []
    listener = Ros1Node("/listener", master, refused.append)
    heard: list[bytes] = []
    said = {name: node(name).publish("/loud", TEXT, peer="/listener") for name in ("/speaker", "/other")}
    for publisher in said.values():
        publisher._owner.join()
    listener.subscribe("/loud", TEXT, heard.append, peer="/speaker")
    _spin(listener, until=lambda: said["/speaker"].is_matched and refused)
    said["/speaker"].send(b"mine")
    said["/other"].send(b"theirs")
    _spin(listener, until=lambda: heard)
    listener.close()
    assert heard == [b"mine"]
    assert refused[0].startswith("/loud: /other publishes std_msgs/String (md5 ")
    assert refused[0].endswith("there, but it belongs to /speaker; it is not heard")


def test_a_slow_reader_misses_messages_and_the_reader_that_counts_none(node: Join) -> None:
    speaker, listener, gaper = node("/speaker"), node("/listener"), node("/gaper")
    said = speaker.publish("/loud", TEXT, peer="/listener")
    speaker.join()
    heard: list[int] = []
    gaped: list[int] = []
    listener.subscribe("/loud", TEXT, lambda data: heard.append(int(data[:3])), peer="/speaker")
    gaper.subscribe("/loud", TEXT, lambda data: gaped.append(int(data[:3])), peer="/speaker")
    _spin(listener, gaper, until=lambda: len(said.peers) == 2)
    lost = 0
    for k in range(300):
        lost += said.send(b"%03d" % k + bytes(100_000))
        _spin(speaker, listener, until=lambda: len(heard) == k + 1)  # noqa: B023
    assert heard == list(range(300))
    _spin(speaker, gaper, until=lambda: len(gaped) == 300 - lost)
    assert gaped == sorted(gaped) and 0 < lost < 300


def test_who_comes_late_gets_the_last_message_of_a_topic_that_latches(node: Join) -> None:
    speaker, listener = node("/speaker"), node("/listener")
    speaker.publish("/map", TEXT, latch=True).send(b"old", b"new")
    speaker.join()
    heard: list[bytes] = []
    listener.subscribe("/map", TEXT, heard.append)
    _spin(listener, until=lambda: heard)
    assert heard == [b"new"]


def test_a_server_that_comes_again_is_called_again_and_answers_keep_their_order(node: Join) -> None:
    client = node("/client")
    caller = client.call("/s", ASK, lanes=1)
    answers: list[bytes | None] = []

    def answered(data: bytes | None, why: str) -> None:
        answers.append(data)

    for life in range(2):
        server = node("/server")
        asked: list[tuple[bytes, Reply]] = []
        server.serve("/s", ASK, lambda data, reply, asked=asked: asked.append((data, reply)), peer="/client")  # type: ignore[misc]
        server.join()
        for data in (b"first", b"second", b"third"):
            caller.ask(data, answered)
        _spin(client, server, until=lambda asked=asked: len(asked) == 3)  # type: ignore[misc]
        assert [data for data, _ in asked] == [b"first", b"second", b"third"]
        asked[0][1](None)
        asked[1][1](b"%d" % life)
        _spin(client, server, until=lambda: len(answers) == 2)
        server.close()
        _spin(client, until=lambda: len(answers) == 3)
        assert answers == [None, b"%d" % life, None], "refused, answered, and its end is noticed"
        answers.clear()
    caller.ask(b"fourth", answered)
    assert answers == [None]
    with pytest.raises(HostFailure, match=r"\[ros1-(header|answer)\]$"):
        caller.connect()


def test_calls_that_are_open_at_once_have_connections_of_their_own(node: Join) -> None:
    client, server = node("/client"), node("/server")
    asked: list[tuple[bytes, Reply]] = []
    server.serve("/s", ASK, lambda data, reply: asked.append((data, reply)))
    server.join()
    caller = client.call("/s", ASK, lanes=2)
    answers: list[tuple[bytes | None, str]] = []

    def answered(data: bytes | None, why: str) -> None:
        answers.append((data, why))

    for data in (b"one", b"two", b"three"):
        caller.ask(data, answered)
    assert answers == [(None, "2 calls are open already")]
    _spin(client, server, until=lambda: len(asked) == 2)
    for data, reply in sorted(asked, reverse=True):
        reply(b"re: " + data)
        _spin(client, server, until=lambda data=data: answers[-1] == (b"re: " + data, ""))  # type: ignore[misc]
    caller.ask(b"four", answered)
    _spin(client, server, until=lambda: len(asked) == 3)
    caller.abandon(answered)
    asked[2][1](b"late")
    client.spin(time.perf_counter_ns() + 100_000_000)
    assert len(answers) == 3


def test_another_type_is_declined_and_a_call_that_the_master_refuses_is_told(node: Join, master: str) -> None:
    server, client = node("/server"), node("/client")
    server.serve("/t", ASK, lambda data, reply: None, peer="/client")
    server.join()
    with pytest.raises(HostFailure, match=r"declines: /t: is toys/Ask, but /client calls toys/Ask \(md5 1+\)"):
        client.call("/t", Kind("toys/Ask", "1" * 32)).connect()
    with pytest.raises(HostFailure, match=r"must answer lookupService, but: .*no provider.*\[ros1-answer\]$"):
        ask(master, "lookupService", "/client", "/nowhere")
    with pytest.raises(HostFailure, match=r"must answer getPid, but: Connection refused"):
        ask("http://127.0.0.1:1", "getPid", "/client")
