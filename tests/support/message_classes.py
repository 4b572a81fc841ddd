"""Message classes as ROS 1 generates them, made of the texts of .msg and .srv files: tests of bindings need no ROS."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from parcours.run.binding.message_types import FieldType, MessageTypes, slot_of

_FIELD = re.compile(r"(?P<type>[\w/]+)(?P<array>\[\d*\])?\s+(?P<name>\w+)\s*(?P<constant>=.*)?")


class Time:
    __slots__ = ("nsecs", "secs")
    _slot_types = ("int32", "int32")

    def __init__(self) -> None:
        self.secs = self.nsecs = 0


def defined_types(definitions: Mapping[str, str]) -> MessageTypes:
    """Return what is known of the types that texts define; a line `---` parts the halves of a service."""
    texts: dict[str, str] = {}
    for name, text in definitions.items():
        request, service, response = text.partition("---\n")
        if service:
            texts.update({f"{name}Request": request, f"{name}Response": response})
    # A message called PlanRequest comes before the half of a service called Plan.
    texts |= {name: text for name, text in definitions.items() if "---\n" not in text}
    classes: dict[str, type] = {"time": Time, "duration": Time}

    def find(name: str) -> type | None:
        if name in texts and name not in classes:
            fields = dict(_fields(name.partition("/")[0], texts[name]))
            classes[name] = _class(name, fields)
        return classes.get(name)

    def start(slot: FieldType) -> object:
        if slot.length is not None:
            return [start(FieldType(slot.item)) for _ in range(slot.length)]
        if slot.is_message:
            kind = find(slot.item)
            return kind() if kind else None
        return {"bool": False, "real": 0.0, "text": ""}.get(slot.type.name, 0)

    def _class(name: str, fields: dict[str, str]) -> type:
        def begin(message: object) -> None:
            for field, type_ in fields.items():
                setattr(message, field, start(slot_of(type_)))

        body = {"__slots__": tuple(fields), "_slot_types": tuple(fields.values()), "__init__": begin}
        return type(name.rpartition("/")[2], (), body)

    return MessageTypes(find)


def _fields(package: str, text: str) -> Iterator[tuple[str, str]]:
    for line in text.splitlines():
        match = _FIELD.fullmatch(line.partition("#")[0].strip())
        if match is None or match["constant"]:
            continue
        type_ = "std_msgs/Header" if match["type"] == "Header" else match["type"]
        if type_[0].isupper():  # no type of the language: a message of the same package
            type_ = f"{package}/{type_}"
        yield match["name"], type_ + (match["array"] or "")
