"""Callbacks that may come in any order come in the same one every time: the graphs of bench_order.py, a few times."""

from __future__ import annotations

import importlib.util
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

from parcours.run.binding.slots import Spoke
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours_navigation.foreign import abstract

FILE = Path(__file__).parents[1] / "bench" / "bench_order.py"
AS_DEMANDED = {
    "two ways": ("Sink /right", "Sink /left"),
    "parallel inputs": ("Fusion /y", "Fusion /x"),
    "one topic": ("Sink /all from 2", "Sink /all from 1"),
    "service": ("Server /ask True", "Server /ask False"),
}


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_order", FILE)
    assert spec is not None and spec.loader is not None
    module = sys.modules["bench_order"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", AS_DEMANDED)
def test_callbacks_come_in_the_order_that_is_demanded_in_every_repetition(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")
    bench.enforced(bench.GRAPHS[name], 20, tmp_path)
    seen = bench.seen(bench.GRAPHS[name], tmp_path, 0)
    assert seen.orders == {AS_DEMANDED[name]: 20}


def test_a_message_waits_until_a_node_that_stands_still_has_taken_the_one_before_it(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two that lie there when it goes on are taken in the order of its subscriptions, which is the other one."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")
    say, went_on = ForeignHost.say, list[threading.Timer]()

    def say_to_one_that_stands(self: ForeignHost, spoke: Spoke, data: bytes) -> int:
        if "y" in spoke.channels:
            node = self.running[spoke.slot][1]
            node.act("stop")
            assert node.await_stop(10.0)
            went_on.append(threading.Timer(0.3, node.act, ["continue"]))
            went_on[-1].start()
        return say(self, spoke, data)

    monkeypatch.setattr(ForeignHost, "say", say_to_one_that_stands)
    graph = bench.GRAPHS["parallel inputs"]
    bench.enforced(graph, 3, tmp_path)
    assert len(went_on) == 3
    assert bench.seen(graph, tmp_path, 0).orders == {AS_DEMANDED["parallel inputs"]: 3}


def test_a_node_that_has_not_begun_with_a_message_gets_no_other_one_however_long_it_takes(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")
    monkeypatch.setattr(Session, "rests", lambda self, slot, since: False)  # as if it got no processor
    monkeypatch.setattr(Session, "effort", lambda self, slot: 1)
    monkeypatch.setattr(abstract, "PATIENCE", 500_000_000)
    with pytest.raises(RuntimeError, match=r"Fusion#2 did not take t2 within 0.5 s"):
        bench.enforced(bench.GRAPHS["parallel inputs"], 1, tmp_path)
