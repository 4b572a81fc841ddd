"""The messages of a model as plain values: checked, filled with defaults, and turned into bytes.

A message is a mapping from the fields of its class to plain values, the same on every host. Channels whose class the
model does not declare carry any plain value.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import msgspec
import numpy as np

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Field, MessageClass

Plain = None | bool | int | float | str | list["Plain"] | dict[str, "Plain"]  # what a message may hold

_FLAT = {"bool": "bool", "int": "int", "real": "float"}
_LISTED = {"int": "ints", "real": "floats"}
_INT = 2**63
_DEEP = 4  # levels of classes within classes that a specimen has
INPUTS = "parcours inputs"  # the channel of input variables to nodes; no channel of a model has a blank in its name


@dataclass(frozen=True, slots=True)
class FlatField:
    """One field as it travels where messages are flat (recordings, ROS): kinds as in `ros1.interfaces.TYPES`."""

    name: str
    kind: str
    doc: str


class ModelMessages:
    """The messages of one model, channel by channel.

    >>> from parcours.model import parse_model
    >>> text = '''
    ... parcours: model/1
    ... name: m
    ... messages: {Call: {fields: {floor: {type: int}, doors: {type: bool, shape: [2]}}}}
    ... channels: {call: {from: environment, to: Lift, message: Call}}
    ... components: {Lift: {machines: {m: {initial: s, transitions: {l1: {from: s, to: s, event: call}}}}}}
    ... '''
    >>> messages = ModelMessages(parse_model(text, "m.yaml"))
    >>> messages.default("call")
    {'floor': 0, 'doors': [False, False]}
    >>> messages.decode("call", messages.encode("call", {"floor": 3, "doors": (True, False)}))
    {'floor': 3, 'doors': [True, False]}
    >>> messages.checked("call", {"floor": "third", "doors": [True, False]})
    Traceback (most recent call last):
    parcours.errors.BadRequest: message on 'call', field 'floor': must be int, but is 'third' [message-field]
    """

    def __init__(self, cefsm: Cefsm) -> None:
        self.classes = {message.name: message for message in cefsm.messages}
        self._class = {channel.name: self.classes.get(channel.message) for channel in cefsm.channels}
        self._class[INPUTS] = None

    @property
    def channels(self) -> tuple[str, ...]:
        """All channels, and that of input variables to nodes."""
        return tuple(self._class)

    def class_of(self, channel: str) -> MessageClass | None:
        """Return the class of a channel's messages; None if the model does not declare it."""
        return self._class.get(channel)

    def default(self, channel: str) -> Plain:
        """Return a message whose fields are false, 0, empty or, where the shape is fixed, lists of these."""
        declared = self._class.get(channel)
        return {} if declared is None else self._default(declared)

    def specimens(self) -> Iterator[tuple[str, Plain]]:
        """Yield a message for each channel whose class is declared, of values that are not those of `default`."""
        for channel, declared in self._class.items():
            if declared is not None:
                yield channel, self._specimen(declared, 1)

    def _specimen(self, declared: MessageClass, depth: int) -> dict[str, Plain]:
        return {field.name: self._specimen_field(field, field.shape, depth) for field in declared.fields}

    def _specimen_field(self, field: Field, shape: tuple[int | str, ...], depth: int) -> Plain:
        if shape:
            n = shape[0] if isinstance(shape[0], int) else 2 * (depth < _DEEP)  # a class may hold lists of itself
            return [self._specimen_field(field, shape[1:], depth) for _ in range(n)]
        if field.type in self.classes:
            return cast(Plain, self._specimen(self.classes[field.type], depth + 1))
        return {"bool": True, "int": -_INT, "real": 0.1}.get(field.type, "\u00e9")

    def checked(self, channel: str, payload: object) -> Plain:
        """Return the payload as plain values.

        Dataclasses, msgspec structures, tuples and NumPy values are turned into mappings, lists and numbers.

        Raises BadRequest: it holds something else, or does not have the fields of the channel's class.
        """
        where = f"message on {channel!r}"
        try:
            value = _listed_plain(msgspec.to_builtins(payload, enc_hook=_unpacked, str_keys=True))
        except (TypeError, ValueError, RecursionError, OverflowError, msgspec.MsgspecError) as error:
            rule = f"a message holds plain values (numbers, texts, lists, mappings), but: {error}"
            raise BadRequest(where, rule, slug="message-plain") from error
        declared = self._class.get(channel)
        if declared is not None:
            return self._checked(declared, value, where)
        return cast(Plain, value)

    # What recorders and ROS hosts need: messages as flat rows of values.

    def form(self, channel: str) -> Sequence[FlatField] | None:
        """Return the fields in which the channel's messages travel flat; None if there is no such channel."""
        if channel not in self._class:
            return None
        declared = self._class[channel]
        if declared is None:
            return (FlatField("content", "ints", "JSON, as bytes of UTF-8"),)
        return tuple(_flat(field) for field in declared.fields)

    def flatten(self, channel: str, payload: object) -> tuple[object, ...]:
        """Return the values of a message's flat form. Raises BadRequest as `checked` does."""
        message = self.checked(channel, payload)
        declared = self._class[channel]
        if declared is None:
            return (_bytes_of(message),)
        assert isinstance(message, dict)
        return tuple(_flattened(_flat(field).kind, field, message[field.name]) for field in declared.fields)

    def restore(self, channel: str, values: Sequence[object]) -> Plain:
        """Return the message of these values. Raises BadRequest if they make none."""
        declared = self._class[channel]
        if declared is None:
            return cast(Plain, _read(values[0], channel))
        fields = zip(declared.fields, values, strict=True)
        return self._checked(
            declared,
            {field.name: _restored(field, value, channel) for field, value in fields},
            f"message on {channel!r}",
        )

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the message's bytes, MessagePack. Raises BadRequest as `checked` does."""
        return msgspec.msgpack.encode(self.checked(channel, payload))

    def decode(self, channel: str, data: bytes) -> Plain:
        """Return the message. Raises BadRequest if these bytes are not one of the channel's."""
        try:
            return self.checked(channel, msgspec.msgpack.decode(data))
        except msgspec.DecodeError as error:
            raise BadRequest(
                f"message on {channel!r}", f"must be MessagePack, but: {error}", slug="wire-fields"
            ) from error

    def _default(self, declared: MessageClass) -> dict[str, Plain]:
        return {field.name: self._default_field(field, field.shape) for field in declared.fields}

    def _default_field(self, field: Field, shape: tuple[int | str, ...]) -> Plain:
        if shape:
            n = shape[0] if isinstance(shape[0], int) else 0
            return [self._default_field(field, shape[1:]) for _ in range(n)]
        if field.type in self.classes:
            return cast(Plain, self._default(self.classes[field.type]))
        return {"bool": False, "int": 0, "real": 0.0}.get(field.type, "")

    def _checked(self, declared: MessageClass, value: object, where: str) -> dict[str, Plain]:
        if not isinstance(value, dict):
            rule = f"must be a mapping with the fields of {declared.name}, but is {_brief(value)}"
            raise BadRequest(where, rule, slug="message-fields")
        names = [field.name for field in declared.fields]
        absent, strange = [name for name in names if name not in value], [name for name in value if name not in names]
        if absent or strange:
            said = [f"lacks {', '.join(absent)}"] * bool(absent) + [f"has {', '.join(map(str, strange))}"] * bool(
                strange
            )
            rule = f"must have the fields of {declared.name} ({', '.join(names)}), but {' and '.join(said)}"
            raise BadRequest(where, rule, slug="message-fields")
        return {
            field.name: self._field(field, field.shape, value[field.name], f"{where}, field {field.name!r}")
            for field in declared.fields
        }

    def _field(self, field: Field, shape: tuple[int | str, ...], value: object, where: str) -> Plain:
        if shape:
            if not isinstance(value, list) or (isinstance(shape[0], int) and len(value) != shape[0]):
                rule = f"must be a list of {shape[0]}, but is {_brief(value)}"
                raise BadRequest(where, rule, slug="message-field")
            return [self._field(field, shape[1:], one, f"{where}[{k}]") for k, one in enumerate(value)]
        if field.type in self.classes:
            return cast(Plain, self._checked(self.classes[field.type], value, where))
        fits = {
            "bool": isinstance(value, bool),
            "int": isinstance(value, int) and not isinstance(value, bool) and -_INT <= value < _INT,
            "real": isinstance(value, int | float) and not isinstance(value, bool),
        }.get(field.type, isinstance(value, str))
        if not fits:
            raise BadRequest(where, f"must be {field.type}, but is {_brief(value)}", slug="message-field")
        return float(cast(float, value)) if field.type == "real" else cast(Plain, value)


def _unpacked(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not one of them")


def _listed_plain(value: object) -> object:
    """Return a plain value whose tuples are lists, as they arrive on every host."""
    if isinstance(value, dict):
        return {key: _listed_plain(one) for key, one in value.items()}
    return [_listed_plain(one) for one in value] if isinstance(value, list | tuple) else value


def _brief(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _flat(field: Field) -> FlatField:
    doc = f"{field.doc} [{field.unit}]".strip() if field.unit != "1" else field.doc
    if not field.shape and field.type in _FLAT:
        return FlatField(field.name, _FLAT[field.type], doc)
    if len(field.shape) == 1 and field.type in _LISTED:
        return FlatField(field.name, _LISTED[field.type], doc)
    return FlatField(field.name, "ints", f"{doc} (JSON, as bytes of UTF-8)".strip())


def _flattened(kind: str, field: Field, value: Plain) -> object:
    if kind in ("bool", "int", "float"):
        return value
    if field.type in _LISTED and len(field.shape) == 1:
        return np.array(value, np.int64 if field.type == "int" else np.float64)
    return _bytes_of(value)


def _restored(field: Field, value: object, channel: str) -> object:
    if not field.shape and field.type in _FLAT:
        return value
    if len(field.shape) == 1 and field.type in _LISTED:
        return np.asarray(value).tolist()
    return _read(value, channel)


def _bytes_of(value: Plain) -> np.ndarray:
    return np.frombuffer(json.dumps(value, ensure_ascii=False).encode(), np.uint8).astype(np.int64)


def _read(value: object, channel: str) -> object:
    try:
        return json.loads(np.asarray(value).astype(np.uint8).tobytes())
    except (ValueError, TypeError, RecursionError) as error:
        raise BadRequest(f"message on {channel!r}", f"must be JSON, but: {error}", slug="wire-fields") from error
