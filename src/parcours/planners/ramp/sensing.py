"""Sensing: what the obstacles' own sensors report -> the list of obstacles for the planner (component 6)."""

from __future__ import annotations

from collections.abc import Iterator

from parcours.planners.ramp.messages import Obstacles, Step


class Sensing:
    """The component: passes every odometry message on as an obstacle list, in world coordinates."""

    name = "Sensing"

    def reset(self) -> None:
        """Nothing is kept between messages."""

    def next_wake(self) -> int | None:
        """Time alone demands nothing."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Time alone demands nothing."""
        yield from ()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Turn Obstacles from `odometry` into Obstacles on `obstacles`."""
        if not isinstance(message, Obstacles):
            yield Step("p61")
            return
        yield Step("p62")
        yield Step("p63", (("obstacles", message),))
        yield Step("p64")
