"""Round trips between two processes of this machine by the transports that a host of nodes could use.

python bench/bench_transport.py --trips 2000

One process sends a message, the other sends it back: 1 KB, as a command of RAMP's control has, and 50 KB, as a request
to evaluate trajectories. Everything idles otherwise: the one that waits sleeps in the operating system, as nodes do,
except where a transport can only be polled (noted in the output). Libraries that are not installed are named;
Parcours needs none of them.
"""

from __future__ import annotations

import argparse
import importlib.util
import multiprocessing
import os
import socket
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from parcours.run.hosts.scheduling import prefer_real_time
from parcours.run.hosts.sockets import FrameSocket

SIZES = (1_000, 50_000)
WARM_UP = 100

Exchange = Callable[[bytes], None]
"""Sends a message there and returns once it is back."""


def frames_echo(end: socket.socket) -> None:
    mine = FrameSocket(end)
    while not mine.closed:
        mine.wait(None)
        for frame in mine.frames():
            mine.send(frame, wait=True)


@contextmanager
def frames(folder: str) -> Iterator[Exchange]:
    mine, its = socket.socketpair()
    with echoing(frames_echo, its):
        its.close()
        end = FrameSocket(mine)

        def exchange(message: bytes) -> None:
            end.send(message, wait=True)
            while not end.frames():
                end.wait(None)

        yield exchange
        end.close()


def pipe_echo(end: Any) -> None:
    try:
        while True:
            end.send_bytes(end.recv_bytes())
    except EOFError:
        return


@contextmanager
def pipe(folder: str) -> Iterator[Exchange]:
    mine, its = multiprocessing.Pipe()
    with echoing(pipe_echo, its):
        its.close()

        def exchange(message: bytes) -> None:
            mine.send_bytes(message)
            mine.recv_bytes()

        yield exchange
        mine.close()


def zmq_echo(address: str) -> None:
    import zmq

    end = zmq.Context().socket(zmq.PAIR)
    end.connect(address)
    while (message := end.recv()) != b"end":
        end.send(message)


@contextmanager
def zmq(folder: str) -> Iterator[Exchange]:
    import zmq

    address = f"ipc://{folder}/zmq"
    end = zmq.Context().socket(zmq.PAIR)
    end.bind(address)
    with echoing(zmq_echo, address):

        def exchange(message: bytes) -> None:
            end.send(message)
            end.recv()

        yield exchange
        end.send(b"end")


def nng_echo(address: str) -> None:
    import pynng

    with pynng.Pair0(dial=address) as end:
        while (message := end.recv()) != b"end":
            end.send(message)


@contextmanager
def nng(folder: str) -> Iterator[Exchange]:
    import pynng

    address = f"ipc://{folder}/nng"
    with pynng.Pair0(listen=address) as end, echoing(nng_echo, address):

        def exchange(message: bytes) -> None:
            end.send(message)
            end.recv()

        yield exchange
        end.send(b"end")
        time.sleep(0.1)


def _session(role: str, address: str) -> Any:
    import zenoh

    settings = zenoh.Config()
    settings.insert_json5("scouting/multicast/enabled", "false")
    settings.insert_json5(f"{role}/endpoints", f'["{address}"]')
    return zenoh.open(settings)


def zenoh_echo(address: str) -> None:
    session = _session("connect", address)
    back, there = session.declare_publisher("bench/back"), session.declare_subscriber("bench/there")
    while (message := there.recv().payload.to_bytes()) != b"end":
        back.put(message)


@contextmanager
def zenoh(folder: str) -> Iterator[Exchange]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    session = _session("listen", address)
    there, back = session.declare_publisher("bench/there"), session.declare_subscriber("bench/back")
    with echoing(zenoh_echo, address):
        time.sleep(3.0)  # until both have found each other

        def exchange(message: bytes) -> None:
            there.put(message)
            back.recv()

        yield exchange
        there.put(b"end")
    session.close()


def _service(name: str) -> tuple[Any, Any, Any]:
    """Return a node, a publisher and a subscriber: shared memory, asked again and again."""
    import ctypes

    import iceoryx2 as iox2

    node = iox2.NodeBuilder.new().create(iox2.ServiceType.Ipc)
    kind = iox2.Slice[ctypes.c_uint8]
    there, back = (
        node.service_builder(iox2.ServiceName.new(f"{name}/{way}")).publish_subscribe(kind).open_or_create()
        for way in ("there", "back")
    )
    return node, there, back


def _give(publisher: Any, message: bytes) -> None:
    import ctypes

    sample = publisher.loan_slice_uninit(len(message))
    ctypes.memmove(sample.payload().as_ptr(), message, len(message))
    sample.assume_init().send()


def _take(subscriber: Any) -> bytes:
    import ctypes

    while (sample := subscriber.receive()) is None:
        pass
    payload = sample.payload()
    return ctypes.string_at(payload.as_ptr(), payload.len())


def iceoryx_echo(name: str) -> None:
    _node, there, back = _service(name)
    subscriber = there.subscriber_builder().create()
    publisher = back.publisher_builder().initial_max_slice_len(max(SIZES)).create()
    while (message := _take(subscriber)) != b"end":
        _give(publisher, message)


@contextmanager
def iceoryx(folder: str) -> Iterator[Exchange]:
    name = f"bench{os.getpid()}"
    _node, there, back = _service(name)
    publisher = there.publisher_builder().initial_max_slice_len(max(SIZES)).create()
    subscriber = back.subscriber_builder().create()
    with echoing(iceoryx_echo, name):
        time.sleep(2.0)

        def exchange(message: bytes) -> None:
            _give(publisher, message)
            _take(subscriber)

        yield exchange
        _give(publisher, b"end")


@contextmanager
def echoing(echo: Callable[[Any], None], argument: object) -> Iterator[None]:
    """Run the other side in a process of its own."""
    process = multiprocessing.get_context("spawn").Process(target=_echo, args=(echo, argument), daemon=True)
    process.start()
    try:
        yield
        process.join(5.0)
    finally:
        process.kill()
        process.join()


def _echo(echo: Callable[[Any], None], argument: object) -> None:
    prefer_real_time()
    echo(argument)


TRANSPORTS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "FrameSocket (ours)": ("parcours", frames),
    "multiprocessing.Pipe": ("multiprocessing", pipe),
    "ZeroMQ, ipc": ("zmq", zmq),
    "nng, ipc": ("pynng", nng),
    "zenoh, peers": ("zenoh", zenoh),
    "iceoryx2, busy": ("iceoryx2", iceoryx),
}


def measured(exchange: Exchange, size: int, trips: int) -> list[float]:
    """Return the round trips, sorted [us]."""
    message, taken = bytes(size), []
    for _ in range(WARM_UP + trips):
        begun = time.perf_counter_ns()
        exchange(message)
        taken.append((time.perf_counter_ns() - begun) * 1e-3)
    return sorted(taken[WARM_UP:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trips", type=int, default=2000)
    parser.add_argument("--only", default="", help="transports whose names hold this")
    given = parser.parse_args()
    rule = prefer_real_time()
    print(f"{given.trips} round trips each, {rule}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(
        f"{'transport':<22}"
        + "".join(f"{f'{size // 1000} KB p50':>13}{'p99':>9}" for size in SIZES)
        + "   [us]  p50 ratio"
    )
    first: list[float] = []
    for name, (module, transport) in TRANSPORTS.items():
        if given.only not in name:
            continue
        if importlib.util.find_spec(module) is None:
            print(f"{name:<22} not installed")
            continue
        try:
            with tempfile.TemporaryDirectory() as folder, transport(folder) as exchange:
                taken = [measured(exchange, size, given.trips) for size in SIZES]
        except Exception as error:
            print(f"{name:<22} {type(error).__name__}: {error}")
            continue
        middle = [statistics.median(one) for one in taken]
        first = first or middle
        figures = "".join(f"{m:>13.0f}{one[int(0.99 * len(one))]:>9.0f}" for m, one in zip(middle, taken, strict=True))
        print(f"{name:<22}{figures}         {' '.join(f'{m / f:.2f}' for m, f in zip(middle, first, strict=True))}")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
