"""How flows of control end: by an exception, by a hang that is given up, or by being closed; each with its place."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, ClassVar

import pytest

from parcours.errors import HostFailure
from parcours.model.structure import Component, Machine, Transition
from parcours.study.components.threads import AsyncPort, Port, Threaded

GENEROUS = 60.0
"""Patience where nothing hangs [s]."""

LAMP = Component(
    "Lamp", (Machine("bulb", "off", ("off",), tuple(Transition(name, "off", "off") for name in ("l1", "l2", "l3"))),)
)


def lamp(make: Callable[[], object], patience: float = GENEROUS) -> Threaded:
    return Threaded(LAMP, make, patience)


def taken(component: Threaded) -> list[str]:
    return [step.transition for step in component.handle("press", None, 0)]


def fails(port: Any) -> None:
    raise KeyError("bulb")


class Raises:
    def run(self, port: Port) -> None:
        port.receive()
        fails(port)


class RaisesCoroutine:
    async def run(self, port: AsyncPort) -> None:
        await port.receive()
        await asyncio.sleep(0)
        fails(port)


class Exits:
    def run(self, port: Port) -> None:
        raise SystemExit(3)


class Strange:
    def run(self, port: Port) -> None:
        port.took("e1")


class StrangeCoroutine:
    async def run(self, port: AsyncPort) -> None:
        await port.took("l9")


class Floods:
    def run(self, port: Port) -> None:
        port.took("l1", *[("light", None)] * 10_001)


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        (Raises, r"raised KeyError at test_thread_ends.py:\d+, in fails: 'bulb'"),
        (RaisesCoroutine, r"raised KeyError at test_thread_ends.py:\d+, in fails: 'bulb'"),
        (Exits, r"raised SystemExit at test_thread_ends.py:\d+, in run: 3"),
        (Strange, r"raised ValueError at .*, in run: took 'e1', which is no transition of Lamp; .*Known: l1, l2, l3"),
        (StrangeCoroutine, r"raised ValueError at .*, in run: took 'l9', which is no transition of Lamp"),
        (Floods, r"raised ValueError at .*, in run: sent 10001 messages in one transition; at most 10000"),
    ],
)
def test_what_a_flow_raises_is_raised_in_the_tester_with_its_place(kind: Callable[[], object], why: str) -> None:
    component = lamp(kind)
    for _ in range(2):  # and again: one that has failed stays failed
        with pytest.raises(HostFailure, match=rf"component Lamp: its run\(port\) must not raise, but {why}"):
            taken(component)
    component.close()


FREE = threading.Event()
"""Set at the end of each test: what still hangs may end."""


@pytest.fixture(autouse=True)
def freed() -> Iterator[None]:
    FREE.clear()
    yield
    FREE.set()


class Hangs:
    def run(self, port: Port) -> None:
        port.receive()
        self.halt()
        port.took("l1")

    def halt(self) -> None:
        FREE.wait()


class HangsCoroutine(Hangs):
    async def run(self, port: AsyncPort) -> None:  # type: ignore[override]
        await port.receive()
        self.halt()
        await port.took("l1")


class WaitsForNothing:
    async def run(self, port: AsyncPort) -> None:
        await port.receive()
        await asyncio.Event().wait()


@pytest.mark.parametrize(
    ("kind", "where"),
    [(Hangs, r"test_thread_ends.py:\d+, in halt"), (HangsCoroutine, ".*, in halt"), (WaitsForNothing, "an await")],
)
def test_one_that_hangs_is_left_behind_with_its_place(kind: Callable[[], object], where: str) -> None:
    component = lamp(kind, patience=0.3)
    before = time.monotonic()
    expected = (
        rf"component Lamp: its thread must come back to its port within 0.3 s, but is at {where}.*\[thread-silent\]"
    )
    with pytest.raises(HostFailure, match=expected):
        taken(component)
    with pytest.raises(HostFailure, match="must come back"):
        list(component.prompt("l2", 0))
    thread = component._thread
    component.close()
    assert time.monotonic() - before < 30
    FREE.set()
    assert thread is not None
    thread.join(GENEROUS)
    assert not thread.is_alive()  # it ended at its next call of the port


class Stubborn:
    """Catches what should end it, and goes on."""

    calls = 0

    def run(self, port: Port) -> None:
        while True:
            Stubborn.calls += 1
            try:
                port.receive()
            except BaseException:
                continue


class Tidy:
    ended: ClassVar[list[str]] = []

    def run(self, port: Port) -> None:
        try:
            port.receive()
            port.took("l1")
        finally:
            self.ended.append("thread")


class TidyCoroutine(Tidy):
    async def run(self, port: AsyncPort) -> None:  # type: ignore[override]
        beside = asyncio.create_task(self.wait())
        try:
            await port.receive()
            await port.took("l1")
        finally:
            self.ended.append("coroutine")
            await beside

    async def wait(self) -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            self.ended.append("task")
            await asyncio.sleep(1000)
            raise


def test_closing_unwinds_what_waits() -> None:
    Tidy.ended = []
    for kind in (Tidy, TidyCoroutine):
        for steps in (0, 1):
            component = lamp(kind)
            work = component.handle("press", None, 0)
            assert len(list(islice(work, steps))) == steps
            thread = component._thread
            component.close()
            component.close()
            assert taken(component) == []
            assert thread is None or not thread.is_alive()
    assert Tidy.ended.count("thread") == 1
    assert {"coroutine", "task"} <= set(Tidy.ended)


def test_one_that_catches_its_end_is_put_to_sleep() -> None:
    component = lamp(Stubborn)
    taken(component)
    component.close()
    assert Stubborn.calls < 200
    calls = Stubborn.calls
    time.sleep(0.05)
    assert Stubborn.calls == calls


@pytest.mark.parametrize(("kind", "raised"), [(TimeoutError, HostFailure), (KeyboardInterrupt, KeyboardInterrupt)])
def test_an_alarm_while_a_thread_is_waited_for_gives_it_up_with_its_place(
    kind: type[BaseException], raised: type[BaseException]
) -> None:
    def ring(number: int, frame: object) -> None:
        raise kind("too late")

    component = lamp(Hangs)
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(raised, match="too late"):
            taken(component)
    finally:
        signal.signal(signal.SIGALRM, before)
    with pytest.raises(HostFailure, match=rf"but is at .*, in \w+ when {kind.__name__} comes: too late"):
        taken(component)
    component.close()
