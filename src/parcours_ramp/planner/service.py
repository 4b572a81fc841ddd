"""RAMP's services act on requests only, never because time has passed; Sensing is the smallest (component 6)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

from parcours_ramp.planner.messages import Obstacles, PlannerStep, reporting


class Timeless:
    """A component that keeps nothing between messages and has no timer."""

    def reset(self) -> None:
        """Nothing is kept between messages."""

    def next_wake(self) -> int | None:
        """Time alone demands nothing."""
        return None

    def wake(self, now: int) -> Iterator[PlannerStep]:
        """Time alone demands nothing."""
        yield from ()


class Service(Timeless, ABC):
    """A component that answers requests one at a time.

    Its transitions are p`machine`1, idle, to p`machine`5, returned (Table II).
    """

    machine = 0
    takes: type = object
    gives = ""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        """Answer a request; anything else is a poll that finds nothing."""
        p = f"p{self.machine}"
        if not isinstance(message, self.takes):
            yield reporting(p + "1", tcp_socket=False)
            return
        yield reporting(p + "2", tcp_socket=True)
        yield reporting(p + "3", computation_done=False)
        response = self.answer(message)
        yield reporting(p + "4", (self.gives, response), computation_done=response is not None)
        yield reporting(p + "5")

    @abstractmethod
    def answer(self, request: Any) -> object:
        """Return the response to a request."""


class Sensing(Timeless):
    """The component: passes every odometry message on as an obstacle list, in world coordinates."""

    name = "Sensing"

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        """Turn Obstacles from `odometry` into Obstacles on `obstacles`."""
        if not isinstance(message, Obstacles):
            yield reporting("p61", tcp_socket=False)
            return
        yield reporting("p62", tcp_socket=True)
        yield reporting("p63", ("obstacles", message))
        yield reporting("p64")
