"""Tells the types of a ROS message's fields from its class, of either generation.

ROS 1 classes have `__slots__` and `_slot_types`, ROS 2 classes `get_fields_and_field_types()`. Nothing of ROS is
imported: who has it gives a function from the name of a type to its class.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from parcours.errors import BadRequest, HostFailure
from parcours.model.expression import BOOL, INT, REAL, TEXT, Type

_SLOT = re.compile(
    r"(?:sequence<(?P<item>[A-Za-z0-9_/<>]+)(?:, ?[0-9]+)?>|(?P<name>[A-Za-z0-9_/]+)(?:<[0-9]+>)?)"
    r"(?P<array>\[(?P<length>[0-9]*)\])?",
    re.ASCII,
)
_INTEGERS = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "byte": (-128, 127),
    "char": (0, 255),
    "octet": (0, 255),
}
_REALS = frozenset(("float32", "float64", "float", "double"))
_BOOLS = frozenset(("bool", "boolean"))
_TEXTS = frozenset(("string", "wstring"))
TIMES = frozenset(("time", "duration", "builtin_interfaces/Time", "builtin_interfaces/Duration"))
"""The types of times: seconds and nanoseconds, under names that differ between the generations."""

MAX_DEFINITIONS = 10_000
"""Most files that are read from the folders of interfaces."""

_TIME_SLOTS = {"secs": "int32", "nsecs": "int32"}


@dataclass(frozen=True, slots=True)
class FieldType:
    """The type of a field: that of one item, and how many: 1 for no list (`length` None), else fixed, or 0 for any."""

    item: str
    length: int | None = None

    @property
    def type(self) -> Type:
        """The type in the guard language; that of a message is its name."""
        rank = 0 if self.length is None else 1
        for known, type_ in ((_INTEGERS, INT), (_REALS, REAL), (_BOOLS, BOOL), (_TEXTS, TEXT)):
            if self.item in known:
                return Type(type_.name, rank=rank)
        return Type(self.item, rank=rank)

    @property
    def is_message(self) -> bool:
        """Whether one item is itself a message."""
        return "/" in self.item or self.item in TIMES

    def __str__(self) -> str:
        return self.item if self.length is None else f"{self.item}[{self.length or ''}]"


def slot_of(text: str) -> FieldType:
    """Return the type that a message class gives as a text, in the words of either generation.

    >>> slot_of("float64[9]"), slot_of("sequence<geometry_msgs/Point>")
    (FieldType(item='float64', length=9), FieldType(item='geometry_msgs/Point', length=0))
    """
    match = _SLOT.fullmatch(text)
    if match is None:
        return FieldType(text)
    if match["item"]:
        return FieldType(slot_of(match["item"]).item, 0)
    return FieldType(match["name"], int(match["length"] or 0) if match["array"] else None)


def limits(item: str) -> tuple[int, int] | None:
    """Return the least and greatest value of an integer type, or None for another type.

    >>> limits("uint8"), limits("float64")
    ((0, 255), None)
    """
    return _INTEGERS.get(item)


def ros1_bytes(message: Any) -> bytes:
    """Return the bytes of a message of ROS 1, whose generated classes know how."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def ros1_message(kind: Any, data: bytes) -> object:
    """Return the message of ROS 1 that the bytes are."""
    made: object = kind()
    made.deserialize(data)  # type: ignore[attr-defined]
    return made


class MessageTypes:
    """What is known of message classes, looked up once each.

    Args:
        find: from a type such as `geometry_msgs/Twist` to its class, or None if there is none. Halves of a service are
            asked for as `nav_msgs/GetPlanRequest` and `nav_msgs/GetPlanResponse`.
        pack: from a message to its bytes.
        unpack: from a class and bytes to the message; it may raise anything.
    """

    def __init__(self, find: Callable[[str], type | None], pack: Callable[[object], bytes] = ros1_bytes,
                 unpack: Callable[[type, bytes], object] = ros1_message) -> None:  # fmt: skip
        self._find, self._pack, self._unpack = find, pack, unpack
        self._classes: dict[str, type] = {}
        self._fields: dict[str, Mapping[str, FieldType]] = {}

    def class_of(self, name: str) -> type | None:
        """Return the class of a type, or None."""
        if name not in self._classes:
            found = self._find(name)
            if found is None:
                return None  # it may become known yet
            self._classes[name] = found
        return self._classes[name]

    def fields(self, name: str) -> Mapping[str, FieldType] | None:
        """Return the fields of a message type in order, or None if the type is not known."""
        if name not in self._fields:
            kind = self.class_of(name)
            if kind is None and name not in TIMES:
                return None
            texts = _fields_of(kind) if kind is not None else _TIME_SLOTS
            slots = {field: slot_of(text) for field, text in texts.items()}
            self._fields[name] = MappingProxyType(slots)
        return self._fields[name]

    def create(self, name: str) -> object:
        """Return a new message of a known type with all fields 0 or empty. Raises KeyError for an unknown one."""
        kind = self.class_of(name)
        if kind is None:
            raise KeyError(name)
        made: object = kind()
        return made

    def packed(self, message: object) -> bytes:
        """Return the bytes of a message. Raises HostFailure if a field holds what cannot be written."""
        try:
            return self._pack(message)
        except Exception as error:  # whatever the generated code raises
            rule = f"a message's fields must hold what their types say, but: {error}"
            raise HostFailure(type(message).__name__, rule, slug="message-value") from error

    def unpacked(self, name: str, data: bytes) -> object:
        """Return the message of a known type that the bytes are; raises whatever the generated code raises."""
        kind = self.class_of(name)
        if kind is None:
            raise KeyError(name)
        return self.unpacked_as(kind, data)

    def unpacked_as(self, kind: type, data: bytes) -> object:
        """Return the message of a class that the bytes are; raises whatever the generated code raises."""
        return self._unpack(kind, data)


def _fields_of(kind: type) -> dict[str, str]:
    """Return the fields of a message class with the texts of their types, in order."""
    listed = getattr(kind, "get_fields_and_field_types", None)
    if listed is not None:
        return dict(listed())
    names, texts = getattr(kind, "__slots__", ()), getattr(kind, "_slot_types", None)
    if texts is None:
        return dict(_TIME_SLOTS) if {"secs", "nsecs"} <= set(dir(kind)) else {}
    return dict(zip(names, texts, strict=True))


def read_definitions(folders: Iterable[Path]) -> dict[str, str]:
    """Return the definitions in some folders: type, such as `nav_msgs/Path`, to the text of its file.

    A file's package is the folder above `msg` or `srv`, and else the folder that it is in.

    Args:
        folders: searched to any depth for .msg and .srv files; links are not followed out of them.

    Raises:
        BadRequest: a file cannot be read, or there are more than MAX_DEFINITIONS.
    """
    found: dict[str, str] = {}
    for folder in folders:
        for path in sorted((*folder.rglob("*.msg"), *folder.rglob("*.srv"))):
            package = path.parent.parent if path.parent.name in ("msg", "srv") else path.parent
            try:
                found[f"{package.resolve().name}/{path.stem}"] = path.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError):
                rule = "a message definition must be a readable text, but this is not"
                raise BadRequest(str(path), rule, slug="message-definition") from None
            if len(found) > MAX_DEFINITIONS:
                rule = f"at most {MAX_DEFINITIONS} definitions are read, but there are more"
                raise BadRequest(str(folder), rule, "name the folders of the packages", slug="message-definition")
    return found
