"""Converts the values of a channel's flat form to the bytes of its ROS 1 message and back, without message objects.

ROS 1 writes fields one after the other, little-endian and unpadded, and before an array how many items follow.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np

from parcours.errors import BadRequest, require_known
from parcours.run.hosts.node_program import NodeProgram
from parcours.run.hosts.ros1.interfaces import FieldOfForm

_SCALARS = {"float": "d", "int": "q", "bool": "?"}
_ARRAYS = {"floats": np.dtype("<f8"), "ints": np.dtype("<i8")}
_ITEM = 8


class MessagePacking:
    """One channel's message.

    >>> class Speed:
    ...     name, kind, doc = "speed", "float", "m/s"
    >>> class Legs:
    ...     name, kind, doc = "legs", "ints", "numbers of legs"
    >>> packing = MessagePacking("news", [Speed(), Legs()])
    >>> packing.unpack(packing.pack((0.5, [3, 4])))
    (0.5, array([3, 4]))
    """

    def __init__(self, channel: str, form: Sequence[FieldOfForm]) -> None:
        self._channel, self._n_fields = channel, len(form)
        self._runs: list[tuple[struct.Struct, int, np.dtype[Any] | None]] = []
        scalars = ""
        for field in form:
            if field.kind in _ARRAYS:
                self._runs.append((struct.Struct(f"<{scalars}I"), len(scalars), _ARRAYS[field.kind]))
                scalars = ""
            else:
                scalars += _SCALARS[field.kind]
        if scalars or not self._runs:
            self._runs.append((struct.Struct(f"<{scalars}"), len(scalars), None))

    def pack(self, values: Sequence[Any]) -> bytes:
        """Return the message's bytes. Raises BadRequest if there are too few or too many, or one is of another kind."""
        if len(values) != self._n_fields:
            self._refuse(f"has {self._n_fields} fields, but {len(values)} values were given")
        parts: list[bytes] = []
        at = 0
        try:
            for layout, n, kind in self._runs:
                if kind is None:
                    parts.append(layout.pack(*values[at : at + n]))
                    break
                array = np.ascontiguousarray(values[at + n], kind)
                parts.append(layout.pack(*values[at : at + n], array.size))
                parts.append(array.tobytes())
                at += n + 1
        except (struct.error, TypeError, ValueError, OverflowError) as error:
            self._refuse(f"carries its fields' kinds, but: {error}")
        return b"".join(parts)

    def unpack(self, data: bytes) -> tuple[object, ...]:
        """Return the values; arrays are numpy's, of shape (n,), with memory of their own.

        Raises BadRequest if the bytes are too few or too many.
        """
        values: list[object] = []
        at = 0
        try:
            for layout, _, kind in self._runs:
                values += layout.unpack_from(data, at)
                at += layout.size
                if kind is not None:
                    size = values.pop()
                    assert isinstance(size, int)
                    values.append(np.frombuffer(data, kind, size, at).copy() if size else np.empty(0, kind))
                    at += _ITEM * size
        except (struct.error, ValueError) as error:
            self._refuse(f"{len(data)} bytes are no such message: {error}")
        if at != len(data):
            self._refuse(f"{len(data)} bytes are no such message: it ends after {at}")
        return tuple(values)

    def _refuse(self, rule: str) -> NoReturn:
        raise BadRequest(f"channel {self._channel!r}", rule, "compare it with the channel's flat form",
                         slug="ros1-bytes")  # fmt: skip


class Ros1Codec:
    """Payloads <-> the bytes of ROS 1 messages, for both the tester and its nodes; what is between forwards bytes.

    Args:
        forms: channel -> fields of its flat form.
        flatten: (channel, payload) -> values of the form.
        restore: (channel, values) -> payload; raises BadRequest if they make none.
    """

    def __init__(self, forms: Mapping[str, Sequence[FieldOfForm]], flatten: Callable[[str, Any], Sequence[object]],
                 restore: Callable[[str, Sequence[Any]], object]) -> None:  # fmt: skip
        self.forms = forms
        self._packings = {channel: MessagePacking(channel, form) for channel, form in forms.items()}
        self._flatten, self._restore = flatten, restore

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the message's bytes. Raises BadRequest if the channel carries something else."""
        return self._packing(channel).pack(self._flatten(channel, payload))

    def decode(self, channel: str, data: bytes) -> object:
        """Return the payload. Raises BadRequest, naming the channel, if these bytes are not one."""
        return self._restore(channel, self._packing(channel).unpack(data))

    def flatten(self, channel: str, payload: object) -> tuple[object, ...]:
        """Return the payload's values."""
        return tuple(self._flatten(channel, payload))

    def restore(self, channel: str, values: Sequence[Any]) -> object:
        """Return the payload of these values. Raises BadRequest if they make none."""
        return self._restore(channel, values)

    def _packing(self, channel: str) -> MessagePacking:
        require_known(channel, tuple(self._packings), "channel", slug="unknown-channel")
        return self._packings[channel]


class Ros1NodeProgram:
    """A node_program whose messages travel on ROS 1."""

    def __init__(self, node_program: NodeProgram, codec: Ros1Codec) -> None:
        self.instance, self.prompt, self.view = node_program.instance, node_program.prompt, node_program.view
        self.encode, self.decode = codec.encode, codec.decode
