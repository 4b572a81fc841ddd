"""The messages of RAMP into MessagePack, and back: an array of version, channel and the values of the channel's form.

Arrays travel as raw bytes, little-endian. What is read is held to the form of the channel that it came on.
"""

from __future__ import annotations

import sys
from functools import cache
from typing import Any, NoReturn

import msgspec
import numpy as np
from numpy.typing import NDArray

from parcours.errors import require_known
from parcours_ramp.planner.flat import FormField, refusal
from parcours_ramp.planner.flattening import flatten, restore
from parcours_ramp.planner.forms import FORMS

__all__ = ["FORMS", "VERSION", "FormField", "decode", "encode", "flatten", "restore"]

VERSION = 1  # Version of the forms; every message begins with it


def encode(channel: str, payload: object) -> bytes:
    """Return the payload in MessagePack: an array of VERSION, channel and the values of its form.

    Arrays travel as raw bytes, little-endian.

    Raises BadRequest: the channel is unknown, or the payload is not one of its.
    """
    values = flatten(channel, payload)
    return msgspec.msgpack.encode([VERSION, channel, *(_raw(v) if isinstance(v, np.ndarray) else v for v in values)])


def _raw(values: NDArray[Any]) -> memoryview:
    return values.data if sys.byteorder == "little" else values.byteswap().data


_TYPES = {"float": int | float, "int": int, "bool": bool, "floats": memoryview, "ints": memoryview}
"""What each kind of field travels as; a whole number for a float is read, to be refused by its name."""

_ITEMS = msgspec.msgpack.Decoder(list[msgspec.Raw])
_UNREADABLE = msgspec.MsgspecError, ValueError, RecursionError


@cache
def _decoder(channel: str) -> Any:
    return msgspec.msgpack.Decoder(tuple[(int, str, *(_TYPES[field.kind] for field in FORMS[channel]))])  # type: ignore[misc]


def decode(channel: str, data: bytes) -> Any:
    """Return the payload that `encode` made the bytes from.

    Args:
        data: from anybody; whatever they are, nothing but BadRequest is raised.

    Raises BadRequest: the bytes are no message of this channel, or hold what no component can be given.
    """
    require_known(channel, tuple(FORMS), "channel of RAMP", slug="wire-channel")
    try:
        version, given, *values = _decoder(channel).decode(data)
    except _UNREADABLE as error:
        _explain(channel, data, error)
    _check_head(channel, version, given)
    return restore(channel, values)


def _check_head(channel: str, version: object, given: object) -> None:
    if version != VERSION:
        raise refusal(channel, "", f"begins with the version {VERSION}, but {version} was given", "wire-version")
    if given != channel:
        raise refusal(channel, "", f"names its channel, but {given!r:.60} was given", "wire-channel")


def _explain(channel: str, data: bytes, error: Exception) -> NoReturn:
    """Raise BadRequest about what is wrong with bytes that could not be read."""
    form, what = FORMS[channel], "version"
    try:
        items = _ITEMS.decode(data)
        if len(items) > 1:
            version = msgspec.msgpack.decode(items[0], type=int)
            what = "channel"
            _check_head(channel, version, msgspec.msgpack.decode(items[1], type=str))
        if len(items) != len(form) + 2:
            rule = f"has {len(form)} fields after version and channel, but {len(items)} in all were given"
            raise refusal(channel, "", rule, "wire-fields")
        for field, item in zip(form, items[2:], strict=True):
            what = field.name
            msgspec.msgpack.decode(item, type=_TYPES[field.kind])
    except msgspec.ValidationError as wrong:
        raise refusal(channel, what, f"must be of its kind, but: {wrong}", "wire-kind") from wrong
    except _UNREADABLE:
        pass
    raise refusal(channel, "", f"is an array in MessagePack, but the {len(data)} bytes are not: {error}", "wire-bytes")
