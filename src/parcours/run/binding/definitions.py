"""Makes message classes of .msg and .srv files, so that a binding is checked without ROS.

The classes have the fields and defaults of those that ROS generates; they cannot be sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from parcours.errors import BadRequest
from parcours.run.binding.message_types import MessageTypes, Slot, slot_of

MAX_DEFINITIONS = 10_000
"""Most files that are read from the folders."""

_FIELD = re.compile(
    r"(?P<type>[A-Za-z][A-Za-z0-9_/]*)(?P<array>\[(?:<=)?[0-9]*\])?\s+(?P<name>[A-Za-z][A-Za-z0-9_]*)(?P<rest>.*)"
)
_BOUND = re.compile(r"<=[0-9]+")
_HALVES = ("Request", "Response")


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


def defined_types(definitions: Mapping[str, str]) -> MessageTypes:
    """Return what is known of the message types that texts define.

    Args:
        definitions: type to the text of its .msg file, or of its .srv file, with a line `---`. Of a type that a text
            uses and none defines, nothing is known.

    Raises:
        BadRequest: when a type is looked up: its text has a line that is no field, or the type holds itself.

    >>> texts = {"a/Pose": "float64 x  # [m]", "a/Path": "Pose[] poses", "a/Plan": "Pose to\\n---\\nPath way"}
    >>> types = defined_types(texts)
    >>> types.fields("a/PlanResponse")["way"], types.fields("a/Path")["poses"]
    (Slot(item='a/Path', length=None), Slot(item='a/Pose', length=0))
    >>> types.create("a/Pose").x
    0.0
    """
    return MessageTypes(_Defining(definitions).find)


class Time:
    """A time or duration [s, ns]."""

    __slots__ = ("nsecs", "secs")
    _slot_types = ("int32", "int32")

    def __init__(self) -> None:
        self.secs = self.nsecs = 0


class _Defining:
    def __init__(self, definitions: Mapping[str, str]) -> None:
        self.definitions = definitions
        self.made: dict[str, type | None] = {"time": Time, "duration": Time}
        self.open: list[str] = []

    def find(self, name: str) -> type | None:
        if name not in self.made:
            text = self.text(name)
            self.made[name] = None if text is None else self.defined(name, text)
        return self.made[name]

    def text(self, name: str) -> str | None:
        """A message of this name is meant before the half of a service."""
        if name in self.definitions and not re.search(r"(?m)^---\s*$", self.definitions[name]):
            return self.definitions[name]
        for index, half in enumerate(_HALVES):
            service = self.definitions.get(name.removesuffix(half)) if name.endswith(half) else None
            parts = re.split(r"(?m)^---\s*$", service) if service is not None else []
            if len(parts) == 2:
                return parts[index]
        return None

    def defined(self, name: str, text: str) -> type:
        if name in self.open:
            rule = f"a message must not hold itself, but {name} does, by way of {' and '.join(self.open)}"
            raise BadRequest(name, rule, slug="message-definition")
        self.open.append(name)
        fields = dict(self.fields(name, text))
        starts = {field: self.start(slot_of(type_)) for field, type_ in fields.items()}
        self.open.pop()

        def begin(message: object) -> None:
            for field, start in starts.items():
                setattr(message, field, start())

        body = {"__slots__": tuple(fields), "_slot_types": tuple(fields.values()), "_type": name, "__init__": begin}
        return type(name.rpartition("/")[2], (), body)

    def fields(self, name: str, text: str) -> Iterable[tuple[str, str]]:
        package = name.partition("/")[0]
        for number, line in enumerate(text.splitlines(), start=1):
            plain = _BOUND.sub("", line.partition("#")[0]).strip()
            match = _FIELD.fullmatch(plain)
            if match is None and plain:
                rule = f"a line must be a field, as 'float64 x', but this is {line[:60]!r}"
                raise BadRequest(f"{name}:{number}", rule, slug="message-definition")
            if match is None or match["rest"].strip().startswith("="):
                continue  # nothing, or a constant
            type_ = "std_msgs/Header" if match["type"] == "Header" else match["type"]
            if type_ != "bool" and not slot_of(type_).is_message and slot_of(type_).type.name == type_:
                type_ = f"{package}/{type_}"  # no type of the language: a message of the same package
            yield match["name"], type_ + (match["array"] or "")

    def start(self, slot: Slot) -> Callable[[], object]:
        if slot.length is None:
            return self.single(slot.item)
        single, length = self.single(slot.item), slot.length
        return lambda: [single() for _ in range(length)]

    def single(self, item: str) -> Callable[[], object]:
        if Slot(item).is_message:
            return self.find(item) or (lambda: None)
        default = {"bool": False, "real": 0.0, "text": ""}.get(Slot(item).type.name, 0)
        return lambda: default
