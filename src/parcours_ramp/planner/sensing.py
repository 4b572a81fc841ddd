"""Sensing: what the obstacles' own sensors report -> the list of obstacles for the planner (component 6)."""

from __future__ import annotations

from collections.abc import Iterator

from parcours_ramp.planner.messages import Obstacles, Step
from parcours_ramp.planner.service import Service


class Sensing(Service):
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
