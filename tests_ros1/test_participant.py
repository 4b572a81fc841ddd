"""Ends of topics and services on a real master: what is sent arrives in order, and a broken connection is made anew."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.endpoints import Kind
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.participant import Participant

TEXT = Kind("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n")
ASK = Kind("toys/Ask", "0" * 32)
Join = Callable[[str], Participant]


def _soon() -> int:
    return time.perf_counter_ns() + 10_000_000_000


@pytest.fixture
def node(master: str) -> Iterator[Join]:
    with ExitStack() as all_:

        def made(name: str) -> Participant:
            one = Participant(name, master)
            all_.callback(one.close)
            return one

        yield made


def test_messages_arrive_in_order_whether_they_are_heard_or_wait_until_they_are_taken(node: Join) -> None:
    speaker, listener = node("/speaker"), node("/listener")
    loud, quiet = speaker.publish("/loud", TEXT, "/listener"), speaker.publish("/quiet", TEXT, "/listener")
    speaker.join()
    heard: list[bytes] = []
    listener.subscribe("/loud", TEXT, "/speaker", heard.append)
    waiting = listener.subscribe("/quiet", TEXT, "/speaker")
    listener.join()
    for k in range(1000):
        loud.send(b"%d" % k)
        quiet.send(b"%d" % -k, b"and")
    while len(heard) < 1000:
        assert listener.spin(_soon())
    assert heard == [b"%d" % k for k in range(1000)]
    taken = [waiting.take(_soon()) for _ in range(2000)]
    assert taken == [one for k in range(1000) for one in (b"%d" % -k, b"and")]
    assert waiting.take(0) is None


def test_a_slow_reader_of_somebody_else_misses_messages_and_the_reader_that_counts_none(node: Join) -> None:
    speaker, listener, gaper = node("/speaker"), node("/listener"), node("/gaper")
    said = speaker.publish("/loud", TEXT, "/listener")
    speaker.join()
    heard, gaped = (one.subscribe("/loud", TEXT, "/speaker") for one in (listener, gaper))
    listener.join()
    gaper.join()
    for k in range(300):
        said.send(b"%03d" % k + bytes(100_000))
        speaker.spin(0)
        assert (heard.take(_soon()) or b"")[:3] == b"%03d" % k
    late = []
    while (message := gaped.take(time.perf_counter_ns() + 300_000_000)) is not None:
        speaker.spin(0)
        late.append(int(message[:3]))
    assert late == sorted(late) and 0 < len(late) < 300


def test_a_server_that_comes_again_is_called_again(node: Join) -> None:
    client = node("/client")
    caller = client.call("/s", ASK)
    for life in range(2):
        server = node("/server")
        served = server.serve("/s", ASK, "/client")
        server.join()
        for data in (b"first", b"second"):
            caller.ask(data)
        assert [served.take(_soon()), served.take(_soon())] == [b"first", b"second"]
        served.answer(None)
        served.answer(b"%d" % life)
        assert caller.take(_soon()) == b"%d" % life, "a refusal is no answer"
        server.close()
        assert caller.take(_soon()) is None, "its end is noticed"
    with pytest.raises(HostFailure, match=r"must be reachable.*\[ros1-header\]$"):
        caller.ask(b"third")


def test_a_request_is_taken_of_a_client_that_is_still_on_its_way_in(node: Join) -> None:
    server, client = node("/server"), node("/client")
    served = server.serve("/s", ASK, "/client")
    server.join()
    caller = client.call("/s", ASK)

    def come() -> None:
        time.sleep(0.3)
        caller.connect()
        caller.ask(b"late")

    coming = threading.Thread(target=come)
    coming.start()
    assert served.take(time.perf_counter_ns()) is None
    assert served.take(None) == b"late"
    coming.join()


def test_another_type_is_declined_and_a_call_that_the_master_refuses_is_told(node: Join, master: str) -> None:
    server, client = node("/server"), node("/client")
    server.serve("/t", ASK, "/client")
    server.join()
    with pytest.raises(HostFailure, match=r"declines: /t: is toys/Ask, but /client calls toys/Ask \(md5 1+\)"):
        client.call("/t", Kind("toys/Ask", "1" * 32)).connect()
    with pytest.raises(HostFailure, match=r"must answer lookupService, but: .*no provider.*\[ros1-answer\]$"):
        ask(master, "lookupService", "/client", "/nowhere")
    with pytest.raises(HostFailure, match=r"must answer getPid, but: Connection refused"):
        ask("http://127.0.0.1:1", "getPid", "/client")
