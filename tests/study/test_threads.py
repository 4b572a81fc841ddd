"""Objects with a flow of control of their own, threads and coroutines, as components that move only when permitted."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable

import pytest

from parcours.abtc import abstract_cases, serialise
from parcours.model.model_file import parse_model
from parcours.run.enforcement import Execution
from parcours.run.in_process import execute
from parcours.run.port import Component
from parcours.run.trace import Trace, transitions
from parcours.study.components.tester import prompted
from parcours.study.components.threads import AsyncPort, Port, Threaded

GENEROUS = 60.0
"""Patience where nothing hangs [s]."""

MODEL = parse_model(
    """
parcours: model/1
name: lamp
messages:
  Press: {fields: {long: {type: bool}}}
channels:
  press: {from: environment, to: Lamp, message: Press}
  light: {from: Lamp, to: Eye, message: Press}
  seen: {from: Eye, to: Lamp, message: Press}
components:
  Lamp:
    variables: {dim: {type: bool, role: input}}
    machines:
      bulb:
        initial: "off"
        transitions:
          l1: {from: "off", to: "on", event: press(it), message: light(it)}
          l2: {from: "on", to: waiting}
          l3: {from: waiting, to: "off", event: seen(it)}
  Eye:
    machines:
      retina:
        initial: rest
        transitions:
          e1: {from: rest, to: rest, event: light(it), message: seen(it)}
""",
    "lamp.yaml",
)
SECOND = 1_000_000_000


def lamp(make: Callable[[], object], patience: float = GENEROUS) -> Threaded:
    return Threaded(MODEL.component("Lamp"), make, patience)


def taken(component: Component, channel: str = "press", message: object = None, now: int = 0) -> list[str]:
    return [step.transition for step in component.handle(channel, message, now)]


class Thread:
    """Lights when pressed, and two seconds later, when asked, waits for the eye."""

    dim = False

    def __init__(self) -> None:
        self.log: list[object] = []

    def run(self, port: Port) -> None:
        self.log.append("started")
        while True:
            channel, message = port.receive()
            self.log.append((channel, message, port.time))
            if channel == "press":
                port.took("l1", light={"long": self.dim})
                port.sleep(2.0)
                self.log.append(port.time)
                port.took("l2")
            elif channel == "seen":
                port.took("l3")


class Coroutine(Thread):
    async def run(self, port: AsyncPort) -> None:  # type: ignore[override]
        self.log.append("started")
        while True:
            channel, message = await port.receive()
            self.log.append((channel, message, port.time))
            if channel == "press":
                await port.took("l1", light={"long": self.dim})
                await asyncio.sleep(2.0)
                self.log.append(port.time)
                await port.took("l2")
            elif channel == "seen":
                await port.took("l3")


BOTH = pytest.mark.parametrize("kind", [Thread, Coroutine])


@BOTH
def test_a_flow_of_control_moves_one_permit_at_a_time(kind: type[Thread]) -> None:
    made = kind()
    component = lamp(lambda: made)
    component.set_inputs({"dim": True})
    work = component.handle("press", "now", 5 * SECOND)
    assert made.log == []
    step = next(work)
    assert (step.transition, step.sends) == ("l1", (("light", {"long": True}),))
    assert made.log == ["started", ("press", "now", 5.0)]
    assert next(work, None) is None
    assert component.next_wake() == 7 * SECOND
    assert list(component.wake(6 * SECOND)) == []
    assert component.next_wake() == 7 * SECOND
    assert [step.transition for step in component.wake(7 * SECOND)] == ["l2"]
    assert made.log[2:] == [7.0]
    assert component.next_wake() is None
    assert taken(component, "seen", now=8 * SECOND) == ["l3"]
    component.close()


@BOTH
def test_messages_wait_for_one_that_sleeps_and_requests_do_not(kind: type[Thread]) -> None:
    made = kind()
    component = lamp(lambda: made)
    assert taken(component) == ["l1"]
    assert list(component.prompt("l2", 1)) == []
    assert taken(component, "seen", "kept", 2) == []
    assert [step.transition for step in component.wake(2 * SECOND)] == ["l2", "l3"]
    assert [entry for entry in made.log if isinstance(entry, tuple)] == [("press", None, 0.0), ("seen", "kept", 2.0)]
    component.close()


@BOTH
def test_a_new_message_may_come_before_the_work_on_the_last_is_over(kind: type[Thread]) -> None:
    component = lamp(kind)
    assert next(component.handle("press", None, 0)).transition == "l1"
    assert taken(component, "seen", now=0) == []
    assert [step.transition for step in component.wake(2 * SECOND)] == ["l2", "l3"]
    component.close()


class Asked:
    def run(self, port: Port) -> None:
        while True:
            channel, wanted = port.receive()
            if channel is None and wanted is not None:
                port.took(str(wanted))


class AskedCoroutine:
    async def run(self, port: AsyncPort) -> None:
        while True:
            channel, wanted = await port.receive()
            if channel is None and wanted is not None:
                await port.took(str(wanted))


@pytest.mark.parametrize("kind", [Asked, AskedCoroutine])
def test_one_that_waits_hears_which_transition_is_wanted(kind: Callable[[], object]) -> None:
    component = lamp(kind)
    assert [step.transition for step in component.prompt("l2", 0)] == ["l2"]
    assert list(component.handle(None, None, 1)) == []
    assert [step.transition for step in component.prompt("l3", 2)] == ["l3"]
    component.close()


@BOTH
def test_a_reset_makes_a_fresh_object_and_ends_the_old_flow(kind: type[Thread]) -> None:
    made: list[Thread] = []

    def make() -> Thread:
        made.append(kind())
        return made[-1]

    component = lamp(make)
    before = set(threading.enumerate())
    taken(component)
    assert len(set(threading.enumerate()) - before) == 1
    component.reset()
    assert not set(threading.enumerate()) - before
    assert component.next_wake() is None
    assert taken(component) == ["l1"]
    assert [one.log for one in made] == [["started", ("press", None, 0.0)]] * 2
    component.close()


def test_one_that_returns_takes_nothing_more() -> None:
    class Brief:
        def run(self, port: Port) -> None:
            port.receive()
            port.took("l1")

    class BriefCoroutine:
        async def run(self, port: AsyncPort) -> None:
            await port.receive()
            await port.took("l1")

    for kind in (Brief, BriefCoroutine):
        component = lamp(kind)
        assert taken(component) == ["l1"]
        assert taken(component, "seen") == []
        assert list(component.prompt("l2", 0)) == []
        component.close()


# Coroutines: other tasks and the time of the loop


class Tasks:
    """Messages go through a queue to a task, which takes the transitions."""

    async def run(self, port: AsyncPort) -> None:
        queue: asyncio.Queue[str] = asyncio.Queue()
        worker = asyncio.create_task(self.work(port, queue))
        while True:
            channel, _ = await port.receive()
            await queue.put({"press": "l1", "seen": "l3"}[str(channel)])
            assert not worker.done()

    async def work(self, port: AsyncPort, queue: asyncio.Queue[str]) -> None:
        while True:
            transition = await queue.get()
            await port.took(transition)
            if transition == "l1":
                await port.took("l2")


def test_tasks_of_a_coroutine_run_until_all_of_them_wait() -> None:
    component = lamp(Tasks)
    assert taken(component) == ["l1", "l2"]
    assert taken(component, "seen") == ["l3"]
    component.close()


class Impatient:
    async def run(self, port: AsyncPort) -> None:
        await port.receive()
        try:
            async with asyncio.timeout(3.0):
                await port.receive()
        except TimeoutError:
            await port.took("l2")
        await port.receive()
        await port.took("l3")


def test_timeouts_of_a_coroutine_keep_the_time_of_the_tester() -> None:
    component = lamp(Impatient)
    assert taken(component, now=SECOND) == []
    assert component.next_wake() == 4 * SECOND
    assert [step.transition for step in component.wake(4 * SECOND)] == ["l2"]
    assert taken(component, "seen", now=5 * SECOND) == ["l3"]
    component.close()


class Outside:
    """Waits for something that happens in another thread of its own."""

    async def run(self, port: AsyncPort) -> None:
        await port.receive()
        await asyncio.to_thread(time.sleep, 0.05)
        await port.took("l1")


def test_a_coroutine_may_wait_for_what_is_outside_its_loop() -> None:
    component = lamp(Outside)
    assert taken(component) == ["l1"]
    component.close()


# Whole cases


class Eye:
    async def run(self, port: AsyncPort) -> None:
        while True:
            _, message = await port.receive()
            await port.took("e1", seen=message)


def executed(kinds: dict[str, Callable[[], object]]) -> list[Execution]:
    def made(name: str) -> Component:
        modelled = MODEL.component(name)
        return Threaded(modelled, kinds[name], GENEROUS)

    return [
        execute(
            serialise(case), made, lambda event: {"long": True},
            prompt=lambda event, component, now: prompted(event.transition, component, now), case=case.id,
        )
        for case in abstract_cases(MODEL)
    ]  # fmt: skip


def test_a_case_takes_the_same_course_every_time() -> None:
    before = set(threading.enumerate())
    first = executed({"Lamp": Thread, "Eye": Eye})
    assert first
    assert all(one.completed for one in first), [str(one.deviation) for one in first]
    assert {"l1", "l2", "l3"} <= {name for one in first for name in lamp_steps(one.trace)}
    assert executed({"Lamp": Thread, "Eye": Eye}) == first
    assert executed({"Lamp": Coroutine, "Eye": Eye}) == first
    assert not set(threading.enumerate()) - before


def lamp_steps(trace: Trace) -> tuple[str, ...]:
    names = {event.component for event in trace.events if event.component.startswith("Lamp#")}
    return tuple(step for name in sorted(names) for step in transitions(trace, name))
