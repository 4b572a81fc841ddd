"""RAMP's components in nodes whose time passes a thousand times slower: a busy machine cannot make one late."""

from __future__ import annotations

from collections.abc import Iterator

from parcours.run.port import Component, Step
from parcours_ramp.components.node_program import ComponentNodeProgram

SLOWER = 1000  # Ten seconds of waiting for the processor count as ten milliseconds


class _Slow:
    """A component that is told of the slower time, but for what it is woken for: that is not waited for longer."""

    def __init__(self, component: Component) -> None:
        self.component = component
        self.name, self.next_wake, self.reset = component.name, component.next_wake, component.reset

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        return self.component.handle(channel, message, now // SLOWER)

    def wake(self, now: int) -> Iterator[Step]:
        return self.component.wake(max(now // SLOWER, self.component.next_wake() or 0))


class SlowNodeProgram(ComponentNodeProgram):
    def instance(self, case: bytes) -> Component:
        return _Slow(super().instance(case))

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        assert isinstance(component, _Slow)
        return super().prompt(name, component.component, now // SLOWER)

    def view(self, component: Component) -> tuple[str, object] | None:
        assert isinstance(component, _Slow)
        return super().view(component.component)
