"""The name of a ROS 1 type -> its class and what goes into connection headers: installed, from folders, or from a peer.

Types of other people are looked for in this order: generated packages under `python_paths` and those installed, then
the .msg and .srv files of `interfaces`, then what a publisher says of its own type when it is connected.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from parcours.errors import BadRequest, HostFailure
from parcours.run.binding.definitions import read_definitions
from parcours.run.hosts.ros1 import interpreter_with, no_ros
from parcours.run.hosts.ros1.ends import ANY, Kind

_DISTRIBUTION = "/usr/lib/python3/dist-packages"
_HALVES = {"Request": "_request_class", "Response": "_response_class"}
_SEPARATOR = "=" * 80
_PARTS = re.compile(r"(?m)^---\s*$")
_NESTED = re.compile(r"(?m)^=+\s*\nMSG: *(\S+)[ \t]*\n")
_BASE = {"bool", "byte", "char", "string", "time", "duration", "float32", "float64"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}


def see_ros() -> None:
    """Make the distribution's ROS packages importable, behind everything else, if genpy is not there.

    Raises:
        HostFailure: there is no genpy.
    """
    if importlib.util.find_spec("genpy") is None and (Path(_DISTRIBUTION) / "genpy").is_dir():
        with contextlib.suppress(HostFailure):
            interpreter_with("rosmaster")  # remembered: this interpreter sees the packages only from here on
        sys.path.append(_DISTRIBUTION)
        importlib.invalidate_caches()
    if importlib.util.find_spec("genpy") is None:
        raise no_ros("genpy")


class ForeignTypes:
    """What is known of the message types of a system that somebody else wrote.

    Args:
        python_paths: folders with packages of generated classes.
        interfaces: folders with .msg and .srv files.

    Raises:
        HostFailure: there is no genpy.
        BadRequest: a file of the interfaces cannot be read.
    """

    def __init__(self, python_paths: Sequence[Path] = (), interfaces: Sequence[Path] = ()) -> None:
        see_ros()
        for folder in python_paths:
            if str(folder.resolve()) not in sys.path:
                sys.path.append(str(folder.resolve()))
        importlib.invalidate_caches()
        self._texts = read_definitions(interfaces)
        self._learned: dict[str, Kind] = {}
        self._classes: dict[str, Any] = {}

    def learn(self, kind: Kind) -> bool:
        """Take note of what a publisher says of its type; return whether that was new."""
        if kind.type in (ANY, "") or not kind.definition or kind.type in self._learned:
            return False
        self._learned[kind.type] = kind
        for name in [name for name, found in self._classes.items() if found is None]:
            del self._classes[name]
        return True

    def find(self, name: str) -> Any:
        """Return the class of a message, or of a service's half such as `nav_msgs/GetPlanRequest`; None if unknown."""
        if name not in self._classes:
            self._classes[name] = self._found(name)
        return self._classes[name]

    def kind(self, name: str) -> Kind | None:
        """Return what a message type is called in headers and recordings; None if the type is unknown."""
        found = self.find(name)
        if found is None:
            return None
        return Kind(name, found._md5sum, getattr(found, "_full_text", ""))

    def service(self, name: str) -> Kind | None:
        """Return what a service type is called in headers; None if it is unknown."""
        found = _imported(name, "srv")
        if found is not None:
            return Kind(name, found._md5sum)
        text = self._texts.get(name)
        if text is None or len(_PARTS.split(text)) != 2:
            return None
        both = "".join(self._md5_text(name, part) for part in _PARTS.split(text))
        return Kind(name, hashlib.md5(both.encode(), usedforsecurity=False).hexdigest())

    def _found(self, name: str) -> Any:
        if name in ("time", "duration"):
            import genpy

            return genpy.Time if name == "time" else genpy.Duration
        found = _imported(name, "msg")
        for half, attribute in _HALVES.items():
            if found is None and name.endswith(half):
                service = _imported(name.removesuffix(half), "srv")
                found = getattr(service, attribute, None)
        if found is None:
            text = self._text(name)
            found = None if text is None else self._generated(name, text)
        if found is None and name in self._learned:
            found = _generated(name, self._learned[name].definition)
        return found

    def _text(self, name: str) -> str | None:
        """Return the definition in the folders, of a message or of a service's half."""
        text = self._texts.get(name)
        if text is not None and len(_PARTS.split(text)) == 1:
            return text
        for index, half in enumerate(_HALVES):
            parts = _PARTS.split(self._texts.get(name.removesuffix(half), "")) if name.endswith(half) else []
            if len(parts) == 2:
                return parts[index]
        return None

    def _generated(self, name: str, text: str) -> Any:
        return _generated(name, self._whole(name, text))

    def _whole(self, name: str, text: str) -> str:
        """Return the text with the definitions of all types that it uses, as ROS appends them."""
        parts: dict[str, str] = {}
        waiting = [(name, text)]
        while waiting:
            owner, body = waiting.pop()
            for used in _used(owner, body):
                if used not in parts and used != name:
                    parts[used] = self._definition(used, owner)
                    waiting.append((used, parts[used]))
        return text.rstrip() + "\n" + "".join(f"{_SEPARATOR}\nMSG: {used}\n{body}\n" for used, body in parts.items())

    def _definition(self, name: str, owner: str) -> str:
        text = self._text(name)
        if text is None:
            found = self.find(name)
            whole = getattr(found, "_full_text", None)
            if whole is None:
                rule = f"uses {name}, which is neither installed nor in the folders of 'interfaces'"
                raise BadRequest(owner, rule, "name the folder of its package, too", slug="unknown-message-type")
            text = _NESTED.split(whole)[0]
        return text

    def _md5_text(self, name: str, text: str) -> str:
        """Return what the md5 sum of a message is made of; a service's is of both halves' together."""
        constants, fields = [], []
        for line in text.splitlines():
            plain = line.partition("#")[0].strip()
            type_, _, rest = plain.partition(" ")
            bare = type_.partition("[")[0]
            if type_ == "string" and "=" in plain:
                constants.append(f"string {rest.partition('=')[0].strip()}={line.partition('=')[2].strip()}")
            elif "=" in plain:
                left, _, value = rest.partition("=")
                constants.append(f"{type_} {left.strip()}={value.strip()}")
            elif plain and bare in _BASE:
                fields.append(f"{type_} {rest.strip()}")
            elif plain:
                (used,) = _used(name, f"{bare} x")
                found = self.find(used)
                if found is None:
                    self._definition(used, name)
                fields.append(f"{found._md5sum} {rest.strip()}")
        return "\n".join(constants + fields)


def _imported(name: str, kind: str) -> Any:
    """Return the class of an installed type, or None."""
    package, _, base = name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), base, None)
    except ImportError:
        return None


def _used(owner: str, text: str) -> list[str]:
    """Return the types of other messages that a definition uses, with their packages."""
    found = []
    for line in text.splitlines():
        plain = line.partition("#")[0].strip()
        bare = plain.partition(" ")[0].partition("[")[0]
        if not bare or bare in _BASE:
            continue
        if bare == "Header":
            bare = "std_msgs/Header"
        found.append(bare if "/" in bare else f"{owner.partition('/')[0]}/{bare}")
    return found


def _generated(name: str, definition: str) -> Any:
    """Return the class that genpy makes of a whole definition.

    Raises:
        BadRequest: it is none.
    """
    from genpy.dynamic import generate_dynamic

    try:
        classes: Mapping[str, Any] = generate_dynamic(name, definition)
        return classes[name]
    except Exception as error:  # genpy raises whatever its parser and the generated code raise
        rule = f"must have a definition that genpy reads, but: {error!r:.200}"
        raise BadRequest(f"message type {name}", rule, slug="message-definition") from error
