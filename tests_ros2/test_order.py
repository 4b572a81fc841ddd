"""Callbacks that may come in any order come in the same one every time: the graphs of bench_order.py, a few times."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

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


def test_a_node_that_has_not_begun_with_a_message_gets_no_other_one_however_long_it_takes(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")
    monkeypatch.setattr(Session, "rests", lambda self, slot, since: False)  # as if it got no processor
    monkeypatch.setattr(Session, "effort", lambda self, slot: 1)
    monkeypatch.setattr(abstract, "PATIENCE", 500_000_000)
    with pytest.raises(RuntimeError, match=r"Fusion#2 did not take t2 within 0.5 s"):
        bench.enforced(bench.GRAPHS["parallel inputs"], 1, tmp_path)
