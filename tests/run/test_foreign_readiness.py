"""When foreign nodes count as ready."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from parcours.run.binding.in_transit import ServiceCall
from parcours.run.binding.structure import ReadyWhen
from parcours.run.hosts.foreign.readiness import Readiness


class Started:
    """Nodes that have been started, as far as their readiness is asked for: what is connected, and who calls."""

    def __init__(self, *names: str) -> None:
        self.connected: set[str] = set()
        self.calls: list[ServiceCall] = []
        self.time = 0
        host = SimpleNamespace(
            binding=SimpleNamespace(stack=None), is_connected=lambda spoke, node: spoke.slot in self.connected
        )
        self.slots: list[Any] = [
            SimpleNamespace(
                name=name, ros_node=f"/{name}",
                node=SimpleNamespace(name=name, ready=[ReadyWhen("bound")], components=(name,), after=()),
            )
            for name in names
        ]  # fmt: skip
        plan: Any = SimpleNamespace(
            spokes=[SimpleNamespace(slot=name, channels=()) for name in names], slots=self.slots
        )
        self.readiness = Readiness(host, plan, SimpleNamespace(calls=self.calls), lambda: self.time)  # type: ignore[arg-type]
        self.readiness.findings = list  # type: ignore[method-assign]
        self.readiness._has_settled = lambda begun: False  # type: ignore[method-assign]
        self.readiness.begin(self.slots)

    def looks_until(self, second: float) -> list[bool]:
        """Look twice a second until then, and return what was seen."""
        seen = []
        while self.time < second * 1e9:
            seen.append(self.readiness.looks())
            self.time += 500_000_000
        return seen


def test_a_node_is_ready_once_one_call_has_waited_for_long_and_not_because_it_makes_many() -> None:
    started = Started("client")
    for second in range(10):
        started.calls[:] = [ServiceCall("/price", "client", None)]
        assert started.looks_until(second + 1) == [False, False]
    assert started.looks_until(12) == [False, False, True, True]


def test_a_node_that_waited_for_another_is_waited_for_again_once_that_has_answered() -> None:
    started = Started("client", "clerk")
    _, clerk = started.slots
    clerk.node.after = ("client",)
    started.readiness._waiting.pop("clerk"), started.readiness._began.pop("clerk")  # it comes after the client
    started.calls.append(ServiceCall("/price", "client", None))
    assert started.looks_until(1.5) == [False] * 3 and not started.readiness.startable()
    started.looks_until(5)
    assert started.readiness.startable() == [clerk]
    started.readiness.begin([clerk])
    assert not any(started.looks_until(7))
    started.connected.add("clerk")  # who has the call now, but has not answered
    assert not any(started.looks_until(8))
    started.calls.clear()  # it has answered; the client goes on, and has not subscribed yet
    assert not any(started.looks_until(12))
    started.connected.add("client")
    assert started.looks_until(12.5) == [True]
