"""Changes the content of a message in a way that a seed decides.

Messages are changed in their flat form, a tuple of typed fields (float, int, bool, arrays of numbers), so that what
arrives is still of the right types; a length that is wrong is for the receiver to refuse.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterator, Sequence
from typing import Any, Literal, Protocol, cast, get_args

import numpy as np

from parcours.hashing import hashed

How = Literal["any", "sign", "bit", "scale", "nan", "length"]
"""sign: a number is negated, a flag inverted. bit: one bit of a number is flipped; of whole numbers one of the lower
16, so that it fits every type. scale: a number is 10 to 1000 times as great. nan: a number becomes NaN or infinite.
length: an array has one entry more or less. any: one of those that the message allows."""

HOWS: tuple[How, ...] = get_args(How)


class FlatCodec(Protocol):
    """The flat form of a system's messages: a module or an object with these two functions, inverse to each other."""

    def flatten(self, channel: str, payload: Any) -> tuple[object, ...]:
        """Return the message as typed fields."""

    def restore(self, channel: str, values: tuple[Any, ...]) -> object:
        """Return the message of these fields. Raises what it likes if they make none."""


def corrupted(values: Sequence[object], seed: int, how: How = "any") -> tuple[tuple[object, ...], str]:
    """Return the fields with one of them changed, and in words what was changed.

    Fields are floats, ints, bools, strings, and lists, tuples or numpy arrays of numbers; the given ones are not
    altered. If no field can be changed in the way that is asked for, the message stays as it is.

    >>> corrupted((1.0, [2.0, 3.0], True), 8, "sign")
    ((1.0, [2.0, 3.0], False), 'field 2 inverted')
    """
    words = _words(seed)
    ways = [way for way in HOWS[1:] if how in ("any", way)]
    open_to = [(way, [i for i, value in enumerate(values) if _allows(value, way)]) for way in ways]
    open_to = [(way, fields) for way, fields in open_to if fields]
    if not open_to:
        return tuple(values), "nothing that can be changed"
    way, fields = open_to[next(words) % len(open_to)]
    i = fields[next(words) % len(fields)]
    changed, said = _changed(values[i], way, words)
    return (*values[:i], changed, *values[i + 1 :]), f"field {i}{said}"


def corrupted_bytes(data: bytes, seed: int, how: How = "any") -> bytes:
    """Return the bytes of a message with one byte more or less (`length`, or `any`), or else with one bit flipped.

    >>> corrupted_bytes(b"abc", 1, "bit"), corrupted_bytes(b"", 1, "bit")
    (b'abk', b'')
    """
    words = _words(seed)
    if how == "length" or (how == "any" and next(words) % 2):
        return data[:-1] if data and next(words) % 2 else data + bytes([next(words) % 256])
    if not data:
        return data
    place = next(words) % (8 * len(data))
    changed = bytearray(data)
    changed[place // 8] ^= 1 << (place % 8)
    return bytes(changed)


class BytesCodec(Protocol):
    """Payloads <-> bytes; with a flat form, too, messages are corrupted field by field."""

    def encode(self, channel: str, payload: Any) -> bytes:
        """Return the payload's bytes."""

    def decode(self, channel: str, data: bytes) -> Any:
        """Return the payload."""


def corrupted_message(codec: BytesCodec, channel: str, data: bytes, seed: int, how: How) -> tuple[bytes, str]:
    """Return the bytes of a message with its content changed, and in words what was changed.

    Where the codec also has a flat form, a field is changed; if no message can be made of that any more, or there is no
    such form, bytes are.
    """
    if not hasattr(codec, "flatten"):
        return corrupted_bytes(data, seed, how), "bytes changed"
    flat = cast(FlatCodec, codec)
    changed, said = corrupted(flat.flatten(channel, codec.decode(channel, data)), seed, how)
    try:
        return codec.encode(channel, flat.restore(channel, changed)), said
    except Exception:
        return corrupted_bytes(data, seed, "length"), f"{said}: no message any more, sent as bytes"


def _words(seed: int) -> Iterator[int]:
    return (hashed(b"%d %d" % (seed, k), 1)[0] for k in itertools.count())


def _is_array(value: object) -> bool:
    if isinstance(value, np.ndarray):
        return np.result_type(value).kind in "fiub" and value.ndim > 0
    return isinstance(value, list | tuple) and all(isinstance(one, bool | int | float) for one in value)


def _allows(value: Any, way: How) -> bool:
    """Return whether a field can be changed in this way."""
    if _is_array(value):
        return way == "length" or (
            len(value) > 0 and _allows(value.flat[0] if isinstance(value, np.ndarray) else value[0], way)
        )
    if isinstance(value, bool | np.bool_):
        return way in ("sign", "bit")
    if isinstance(value, int | np.integer):
        return way in ("sign", "bit", "scale")
    return isinstance(value, float | np.floating) and way in ("sign", "bit", "scale", "nan")


def _changed(value: Any, way: How, words: Iterator[int]) -> tuple[object, str]:
    if not _is_array(value):
        return _corrupted(value, way, words)
    if way == "length":
        shorter = len(value) > 0 and next(words) % 2 == 0
        if isinstance(value, np.ndarray):
            tail = value[-1:] if len(value) else np.zeros((1, *value.shape[1:]), np.result_type(value))
            return (value[:-1].copy(), ", one less") if shorter else (np.concatenate([value, tail]), ", one more")
        extra = value[-1:] if len(value) else type(value)([0.0])
        return (value[:-1], ", one less") if shorter else (value + extra, ", one more")
    if isinstance(value, np.ndarray):
        place, array = next(words) % value.size, value.copy()
        changed, said = _corrupted(array.flat[place].item(), way, words)
        kind = np.result_type(array)
        info = np.iinfo(kind) if kind.kind in "iu" else None
        array.flat[place] = changed if info is None else min(max(int(changed), int(info.min)), int(info.max))
        return array, f"[{place}]{said}"
    place = next(words) % len(value)
    changed, said = _corrupted(value[place], way, words)
    return type(value)([*value[:place], changed, *value[place + 1 :]]), f"[{place}]{said}"


def _corrupted(value: Any, way: How, words: Iterator[int]) -> tuple[Any, str]:
    """Return a number that is changed, and how. Zero is its own negative and its own multiple: it is replaced."""
    if isinstance(value, bool | np.bool_):
        return not value, " inverted"
    match way:
        case "sign":
            return (-value, " negated") if value else (type(value)(-1), " made -1")
        case "scale":
            factor = (10, 100, 1000)[next(words) % 3]
            return (value * factor, f" times {factor}") if value else (type(value)(factor), f" made {factor}")
        case "nan":
            drawn = (float("nan"), float("inf"), float("-inf"))[next(words) % 3]
            return drawn, f" made {drawn}"
    if isinstance(value, int | np.integer):
        place = next(words) % 16
        return int(value) ^ (1 << place), f", bit {place} flipped"
    place = next(words) % 64
    (bits,) = struct.unpack("<Q", struct.pack("<d", float(value)))
    return struct.unpack("<d", struct.pack("<Q", bits ^ (1 << place)))[0], f", bit {place} flipped"
