"""A binding -> the messages that the tester makes: of the world, of a case's environment, of missing nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from parcours.run.binding import Compiled
from parcours.run.binding.decoding import encoded
from parcours.run.binding.injecting import Writer
from parcours.run.binding.readings import message_type
from parcours.run.binding.worlds import body, odometry
from parcours_navigation.foreign.world import GOAL, LIMITS, START

_OBSTACLE = (1.0, 1.2, -2.0, 0.0, 0.0, 0.1)
"""The one obstacle of abstract cases: it stands."""


class Maker:
    """Makes messages as the binding's `inject` says; what it does not say is 0 or empty.

    Args:
        compiled: the binding.
        inputs: names and values of the case's test inputs.
    """

    def __init__(self, compiled: Compiled, inputs: Mapping[str, float] | None = None) -> None:
        self._compiled, self._inputs = compiled, dict(inputs or {})
        self._empty: dict[str, Writer] = {}

    def message(self, channel: str, values: Mapping[str, object], items: Sequence[Mapping[str, object]]) -> bytes:
        """Return the bytes of a message.

        Args:
            channel: of the binding.
            values: of the names that formulas use.
            items: of each obstacle.

        Raises:
            HostFailure: a name has no value, or a value does not fit its field.
        """
        writer = self._compiled.writers.get(channel)
        if writer is None:
            if channel not in self._empty:
                type_ = message_type(self._compiled.binding.channel(channel))
                self._empty[channel] = Writer(type_, self._compiled.types, (), (), f"channel {channel!r}")
            writer = self._empty[channel]
        return encoded(writer.message({**self._inputs, **values}, items))

    def of_the_environment(self, channel: str, now: int, wall: float) -> bytes:
        """Return what the environment of an abstract case says: the robot stands at its start.

        Args:
            channel: of the binding.
            now: since the case began [ns].
            wall: since 1970 [s].

        Raises:
            HostFailure: as `message`.
        """
        system = self._compiled.binding.system
        radius = dict(system.robot).get("radius", LIMITS["radius"]) if system else LIMITS["radius"]
        start = dict(zip(("start.x", "start.y", "start.heading"), START, strict=True))
        values: dict[str, object] = {
            **body("robot", *START, 0.0, 0.0, radius), **odometry(start, *START), **start,
            **dict(zip(("goal.x", "goal.y", "goal.heading"), GOAL, strict=True)),
            "time": now * 1e-9, "wall_time": wall, "obstacles": 1,
        }  # fmt: skip
        one = {**body("obstacle", *_OBSTACLE), "obstacle.index": 0}
        is_each = system is not None and channel in system.each
        return self.message(channel, {**values, **one} if is_each else values, [one])

    def empty(self, type_: str) -> bytes:
        """Return a message of any type with all fields 0 or empty."""
        return encoded(self._compiled.types.create(type_))
