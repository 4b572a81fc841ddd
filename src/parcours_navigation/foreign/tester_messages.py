"""The messages that the tester makes: of the world, of a case's environment, in the place of nodes that are not run."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence

from parcours.run.binding import Compiled
from parcours.run.binding.passing import Message
from parcours.run.binding.readings import Writer, message_type
from parcours.run.binding.relay import Relay
from parcours.run.binding.worlds import body
from parcours_navigation.foreign.world import LIMITS, START, robot_values

_OBSTACLE = {**body("obstacle", 1.0, 1.2, -2.0, 0.0, 0.0, 0.1), "obstacle.index": 0}
"""The one obstacle of abstract cases: it stands."""


class Maker:
    """Makes messages as the binding's `inject` says; what it does not say is 0 or empty.

    Args:
        compiled: the binding.
        inputs: names and values of the case's test inputs.
    """

    def __init__(self, compiled: Compiled, inputs: Mapping[str, float] | None = None) -> None:
        self._compiled, self._inputs = compiled, {**dict(compiled.binding.constants), **(inputs or {})}
        self._writers = dict(compiled.writers)

    def message(self, channel: str, values: Mapping[str, object], items: Sequence[Mapping[str, object]]) -> bytes:
        """Return the bytes of a message.

        Args:
            channel: of the binding.
            values: of the names that formulas use.
            items: of each obstacle.

        Raises:
            HostFailure: a name has no value, or a value does not fit its field.
        """
        if channel not in self._writers:
            type_ = message_type(self._compiled.binding.channel(channel))
            self._writers[channel] = Writer(type_, self._compiled.types, f"channel {channel!r}")
        return self._compiled.types.packed(self._writers[channel].message({**self._inputs, **values}, items))

    def of_the_environment(self, channel: str, now: int) -> bytes:
        """Return what the environment of an abstract case says at `now` [ns since it began]: the robot is at its start.

        Raises:
            HostFailure: as `message`.
        """
        system = self._compiled.binding.system
        radius = (LIMITS | dict(system.robot) if system else LIMITS)["radius"]
        values = {
            **robot_values(*START, 0.0, 0.0, radius),
            "time": now * 1e-9,
            "wall_time": time.time(),
            "obstacles": 1,
        }
        is_each = system is not None and channel in system.each
        return self.message(channel, {**values, **_OBSTACLE} if is_each else values, [_OBSTACLE])

    def answer(self, relay: Relay, message: Message) -> None:
        """Answer a request in the place of a node: as the binding's `inject` says, or with an empty message."""
        if message.call is None:
            return
        service = relay.binding.channel(message.channel).address
        halves = {one.part: one for one in reversed(relay.binding.channels) if one.address == service}
        if "response" in halves:
            name = halves["response"].name
            relay.answer(message.call, relay.made(name, self.of_the_environment(name, 0)))
            return
        with contextlib.suppress(KeyError):
            empty = self._compiled.types.create(halves["request"].type + "Response")
            relay.finish(message.call, self._compiled.types.packed(empty))
