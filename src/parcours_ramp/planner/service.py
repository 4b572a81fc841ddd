"""RAMP's services act on requests only, never because time has passed; Sensing is the smallest (component 6)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

from parcours_ramp.planner.messages import Obstacles, Step


class Timeless:
    """A component that keeps nothing between messages and has no timer."""

    def reset(self) -> None:
        """Nothing is kept between messages."""

    def next_wake(self) -> int | None:
        """Time alone demands nothing."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Time alone demands nothing."""
        yield from ()


class Service(Timeless, ABC):
    """A component that answers requests one at a time.

    Its transitions are p`machine`1, idle, to p`machine`5, returned (Table II).
    """

    machine = 0
    takes: type = object
    gives = ""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Answer a request; anything else is a poll that finds nothing."""
        p = f"p{self.machine}"
        if not isinstance(message, self.takes):
            yield Step(p + "1")
            return
        yield Step(p + "2")
        response = self.answer(message)
        yield Step(p + "3")
        yield Step(p + "4", ((self.gives, response),))
        yield Step(p + "5")

    @abstractmethod
    def answer(self, request: Any) -> object:
        """Return the response to a request."""


class Sensing(Timeless):
    """The component: passes every odometry message on as an obstacle list, in world coordinates."""

    name = "Sensing"

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Turn Obstacles from `odometry` into Obstacles on `obstacles`."""
        if not isinstance(message, Obstacles):
            yield Step("p61")
            return
        yield Step("p62")
        yield Step("p63", (("obstacles", message),))
        yield Step("p64")
