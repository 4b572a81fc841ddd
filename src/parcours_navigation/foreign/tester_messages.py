"""The messages that the tester makes: of the world, of a case's environment, in the place of nodes that are not run."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from typing import Any

from parcours.errors import HostFailure
from parcours.run.binding import Compiled
from parcours.run.binding.in_transit import RawMessage, ServiceCall
from parcours.run.binding.message_formulas import MessageWriter, message_type
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
        self._n_goals = 0

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
            self._writers[channel] = MessageWriter(type_, self._compiled.types, f"channel {channel!r}")
        made: Any = self._writers[channel].message({**self._inputs, **values}, items)
        if self._compiled.binding.channel(channel).action == "goal":  # numbered, so that runs are equal
            self._n_goals += 1
            made.goal_id.uuid = list(self._n_goals.to_bytes(16, "big"))
        return self._compiled.types.packed(made)

    def of_the_environment(self, channel: str, now: int, call: ServiceCall | None = None) -> bytes:
        """Return what the environment of an abstract case says at `now` [ns since it began]: the robot is at its start.

        Args:
            channel: of the binding.
            now: see above.
            call: that it answers.

        Raises:
            HostFailure: as `message`, or the request cannot be read.
        """
        system = self._compiled.binding.system
        radius = (LIMITS | dict(system.robot) if system else LIMITS)["radius"]
        values = {
            **robot_values(*START, 0.0, 0.0, radius),
            "time": now * 1e-9,
            "wall_time": time.time(),
            "obstacles": 1,
        }
        writer = self._writers.get(channel)
        if writer is not None and (writer.asked or writer.each):
            asked, items = writer.of_request(self._request(channel, call))
            return self.message(channel, {**values, **asked}, items)
        is_each = system is not None and channel in system.each
        return self.message(channel, {**values, **_OBSTACLE} if is_each else values, [_OBSTACLE])

    def _request(self, channel: str, call: ServiceCall | None) -> object:
        bound, types = self._compiled.binding.channel(channel), self._compiled.types
        if call is None or not call.request:
            return types.create(f"{bound.type}Request")
        try:
            return types.unpacked(f"{bound.type}Request", call.request)
        except Exception as error:  # whatever the generated code raises
            where = f"{self._compiled.binding.source}:{bound.line}: channel {channel!r}"
            rule = f"a request must be a {bound.type}, but these {len(call.request)} bytes are not one: {error}"
            raise HostFailure(where, rule, "look at its sender", slug="message-size") from error

    def answer(self, relay: Relay, message: RawMessage) -> None:
        """Answer a request in the place of a node: as the binding's `inject` says, or with an empty message."""
        if message.call is None:
            return
        if not message.channel or relay.binding.channel(message.channel).action:
            self._answer_action(relay, message)
            return
        service = relay.binding.channel(message.channel).address
        halves = {one.part: one for one in reversed(relay.binding.channels) if one.address == service}
        if "response" in halves:
            name = halves["response"].name
            relay.answer(message.call, relay.made(name, self.of_the_environment(name, 0, message.call)))
            return
        with contextlib.suppress(KeyError):
            empty = self._compiled.types.create(halves["request"].type + "Response")
            relay.finish(message.call, self._compiled.types.packed(empty))

    def _answer_action(self, relay: Relay, message: RawMessage) -> None:
        """Accept a goal, or a cancellation; give a result as `inject` says."""
        assert message.call is not None
        if message.channel:
            answer: Any = self._compiled.types.create(relay.binding.channel(message.channel).type + "Response")
            if relay.binding.channel(message.channel).action == "goal":
                answer.accepted = True
            relay.finish(message.call, self._compiled.types.packed(answer))
            return
        service = message.call.service.rpartition("/_action/")[0]
        for one in relay.binding.channels:
            if one.action == "result" and service.endswith(one.address.rpartition("/_action/")[0]):
                relay.answer(message.call, relay.made(one.name, self.of_the_environment(one.name, 0)))
