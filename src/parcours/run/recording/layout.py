"""Packs flat values into ROS 1 messages and unpacks them, bit for bit, with the text of the message definition.

The serialiser of `rosbags` takes twice as long for an event, and an object of a generated class for each message.
"""

from __future__ import annotations

import functools
import hashlib
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from parcours.errors import BadRequest
from parcours.run.recording.source import damaged

Kind = Literal["float", "int", "bool", "floats", "ints", "text"]

_ROS = {"float": "float64", "int": "int64", "bool": "bool", "floats": "float64[]", "ints": "int64[]", "text": "string"}
_SCALARS = {"float": "d", "int": "q", "bool": "?"}
_ARRAYS = {"floats": "<f8", "ints": "<i8"}
_NAME = re.compile(r"[a-z][a-z0-9_]*\Z")
_LENGTH = struct.Struct("<I")


class FieldForm(Protocol):
    """One field of a flat form."""

    @property
    def name(self) -> str:
        """Lower case, e.g. t_collision."""

    @property
    def kind(self) -> str:
        """float, int, bool, floats, ints (arrays of shape (n,)) or text."""

    @property
    def doc(self) -> str:
        """What it is, with its unit."""


class PayloadCodec(Protocol):
    """Knows which payloads pass on which channel: their flat form, and the way there and back."""

    def form(self, channel: str) -> Sequence[FieldForm] | None:
        """Return the fields of the channel's payloads; None if it knows none."""

    def flatten(self, channel: str, payload: object) -> Sequence[object]:
        """Return the payload's values, one a field."""

    def restore(self, channel: str, values: Sequence[object]) -> object:
        """Return the payload that has these values."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A field of a flat form, plain.

    >>> Entry("x", "float", "east [m]").kind
    'float'
    """

    name: str
    kind: Kind
    doc: str = ""


class MessageLayout:
    """How values of a flat form lie in a ROS 1 message: one after another, little-endian, lengths before arrays.

    Args:
        fields: the form.
        where: what is recorded, for complaints.

    Raises:
        BadRequest: ROS does not know a field's name or kind, or a name occurs twice.

    >>> layout = MessageLayout((Entry("id", "int"), Entry("x", "floats", "east [m]")), "channel 'places'")
    >>> print(layout.definition, end="")
    int64 id
    float64[] x  # east [m]
    >>> layout.unpack(layout.pack((7, [0.5, 1.0])), "run.bag")
    (7, array([0.5, 1. ]))
    """

    def __init__(self, fields: Sequence[FieldForm], where: str) -> None:
        self._where = where
        self._fields = tuple(fields)
        for place, one in enumerate(self._fields):
            twice = any(one.name == other.name for other in self._fields[:place])
            if twice or one.kind not in _ROS or not _NAME.match(one.name):
                given = f"{one.kind!r}{' and its name occurs twice' if twice else ''}"
                rule = f"a field has a lower-case name of its own and one of the kinds {', '.join(_ROS)}"
                said = f"{rule}, but its kind is {given}"
                raise BadRequest(f"{where}, field {one.name!r}", said, slug="recording-form")
        self.definition = "".join(map(_line, self._fields))
        self.md5 = flat_md5(self.definition)
        self._plan = _plan([one.kind for one in self._fields])

    def pack(self, values: Sequence[object]) -> bytes:
        """Return the message.

        Raises:
            BadRequest: there are more or fewer values than fields, or a value is of another kind.
        """
        if len(values) != len(self._fields):
            raise self._refusal(f"{len(values)} values for {len(self._fields)} fields")
        parts: list[bytes] = []
        at = 0
        try:
            for step in self._plan:
                if isinstance(step, struct.Struct):
                    n = len(step.format) - 1
                    parts.append(step.pack(*values[at : at + n]))
                    at += n
                    continue
                value = values[at]
                at += 1
                if step:
                    given = np.asarray(value)
                    if given.ndim != 1:
                        raise TypeError(f"an array of shape (n,) is wanted, but its shape is {given.shape}")
                    array = given.astype(step, casting="safe") if given.size else given
                    parts += (_LENGTH.pack(len(array)), array.tobytes())
                elif isinstance(value, str):
                    parts.append(_text(value))
                else:
                    raise TypeError(f"a text is wanted, but it is {value!r:.60}")
        except (struct.error, TypeError, ValueError, OverflowError) as error:
            raise self._refusal(str(error)) from error
        return b"".join(parts)

    def unpack(self, content: bytes, where: str) -> tuple[object, ...]:
        """Return the values; arrays are fresh, of float64 or int64.

        Raises:
            BadResults: the bytes are too few or too many for the fields.
        """
        values: list[object] = []
        at = 0
        try:
            for step in self._plan:
                if isinstance(step, struct.Struct):
                    values += step.unpack_from(content, at)
                    at += step.size
                    continue
                (n,) = _LENGTH.unpack_from(content, at)
                at += 4
                if step:
                    values.append(np.frombuffer(content, step, n, at).astype(step[1:]))
                    at += 8 * n
                else:
                    values.append(content[at : at + n].decode())
                    at += n
            if at != len(content):
                raise ValueError
        except (struct.error, ValueError) as error:
            raise damaged(where, f"a message of {len(content)} bytes is not {self._where}") from error
        return tuple(values)

    def _refusal(self, what: str) -> BadRequest:
        names = ", ".join(f"{one.name}: {one.kind}" for one in self._fields)
        rule = f"a recorded payload has the values ({names[:200]}), but: {what}"
        return BadRequest(self._where, rule, "make `flatten` agree with `form`", slug="recording-value")


def _line(one: FieldForm) -> str:
    doc = " ".join(one.doc.split())
    return f"{_ROS[one.kind]} {one.name}" + (f"  # {doc}\n" if doc else "\n")


def _plan(kinds: Sequence[str]) -> tuple[struct.Struct | str, ...]:
    """Return the steps of packing: all scalars in a row at once, an array's type, "" for a text."""
    plan: list[struct.Struct | str] = []
    scalars = ""
    for kind in (*kinds, ""):
        if kind in _SCALARS:
            scalars += _SCALARS[kind]
            continue
        if scalars:
            plan.append(struct.Struct(f"<{scalars}"))
            scalars = ""
        if kind:
            plan.append(_ARRAYS.get(kind, ""))
    return tuple(plan)


@functools.lru_cache(maxsize=4096)
def _text(text: str) -> bytes:
    encoded = text.encode(errors="backslashreplace")
    return _LENGTH.pack(len(encoded)) + encoded


def same_definition(one: str, other: str) -> bool:
    """Return whether two definitions name the same fields in the same order; comments do not count.

    >>> same_definition("float64 x  # [m]", "# where it is\\nfloat64   x\\n")
    True
    """
    return _bare(one) == _bare(other)


def flat_md5(definition: str) -> str:
    """Return the md5 sum by which ROS 1 knows a definition of plain fields only.

    >>> flat_md5("string data  # of std_msgs/String")
    '992ce8a1687cec8c8bd883ec73ca41d1'
    """
    return hashlib.md5("\n".join(_bare(definition)).encode(), usedforsecurity=False).hexdigest()


def _bare(definition: str) -> list[str]:
    lines = (" ".join(line.split("#", 1)[0].split()) for line in definition.splitlines())
    return [line for line in lines if line]
