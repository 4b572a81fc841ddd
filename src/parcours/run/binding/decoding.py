"""Reads the bytes of messages: for what needs fields, never for the relay itself."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

from parcours.errors import HostFailure
from parcours.run.binding.message_formulas import message_type
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.structure import Binding

_REMEMBERED, _PADDING = 64, 3


class Decoder:
    """Reads the messages of a binding's channels.

    Args:
        binding: whose channels.
        types: of the system.
    """

    def __init__(self, binding: Binding, types: MessageTypes) -> None:
        self._binding, self._types = binding, types
        self._known: OrderedDict[tuple[str, bytes], Any] = OrderedDict()

    def message(self, channel: str, data: bytes) -> Any:
        """Return the message that the bytes are.

        Raises:
            HostFailure: they are too few, or of another type.
        """
        key = channel, data
        if key in self._known:
            return self._known[key]
        bound = self._binding.channel(channel)
        kind, is_exact = self._types.class_of(message_type(bound)), self._binding.transport == "ros1"
        where = f"{self._binding.source}:{bound.line}: channel {channel!r}"
        if kind is None:
            raise HostFailure(where, f"its type must be known, but {bound.type} is not", slug="unknown-message-type")
        try:
            made = self._types.unpacked(message_type(bound), data)
        except Exception as error:  # whatever the generated code raises
            rule = f"a message must be a {message_type(bound)}, but these {len(data)} bytes are not one: {error}"
            raise HostFailure(where, rule, "look at its sender", slug="message-size") from error
        # ROS 2 pads messages, and counts more bytes than it writes for lists whose items have gaps.
        needed = len(self._types.packed(made))
        if len(data) != needed if is_exact else len(data) > needed + _PADDING:
            rule = f"a message must be a {message_type(bound)} of {needed} bytes, but has {len(data)}"
            raise HostFailure(where, rule, "look at its sender", slug="message-size")
        self._known[key] = made
        if len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        return made
