"""Finds the classes and checksums of message types that a foreign system uses.

They are looked for in this order: generated packages under `python_paths` and those installed, then the .msg and .srv
files of `interfaces`, then what a publisher says of its own type when it is connected.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from parcours.errors import BadRequest, HostFailure
from parcours.run.binding.message_types import read_definitions
from parcours.run.hosts.foreign.graph import installed_type
from parcours.run.hosts.ros1 import PACKAGES, interpreter_with, no_ros
from parcours.run.hosts.ros1.endpoints import ANY, Kind

_HALVES = {"Request": "_request_class", "Response": "_response_class"}
_SEPARATOR = "=" * 80
_PARTS = re.compile(r"(?m)^---\s*$")
_NESTED = re.compile(r"(?m)^=+\s*\nMSG: *(\S+)[ \t]*\n")


def see_ros() -> None:
    """Make the distribution's ROS packages importable, behind everything else, if genpy is not there.

    Raises HostFailure if there is no genpy.
    """
    if importlib.util.find_spec("genpy") is None and (Path(PACKAGES) / "genpy").is_dir():
        with contextlib.suppress(HostFailure):
            interpreter_with("rosmaster")  # remembered: this interpreter sees the packages only from here on
        sys.path.append(PACKAGES)
        importlib.invalidate_caches()
    if importlib.util.find_spec("genpy") is None:
        raise no_ros("genpy")


class ForeignTypes:
    """What is known of the message types of a foreign system.

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

    def learn(self, kind: Kind) -> None:
        """Take note of what a publisher says of its type."""
        if kind.type not in (ANY, "", *self._learned) and kind.definition:
            self._learned[kind.type] = kind
            for name in [name for name, found in self._classes.items() if found is None]:
                del self._classes[name]

    def find(self, name: str) -> Any:
        """Return the class of a message, or of a service's half such as `nav_msgs/GetPlanRequest`; None if unknown."""
        if name not in self._classes:
            self._classes[name] = self._found(name)
        return self._classes[name]

    def kind(self, name: str) -> Kind | None:
        """Return what a message type is called in headers and recordings; None if the type is unknown."""
        found = self.find(name)
        return None if found is None else Kind(name, found._md5sum, getattr(found, "_full_text", ""))

    def service(self, name: str) -> Kind | None:
        """Return what a service type is called in headers; None if it is unknown."""
        found = installed_type(name, "srv")
        if found is not None:
            return Kind(name, found._md5sum)
        halves = _PARTS.split(self._texts.get(name, ""))
        if len(halves) != 2:
            return None
        from genmsg import MsgContext
        from genmsg.gentools import compute_md5_text

        md5 = hashlib.md5(usedforsecurity=False)
        with _refusing(name):
            for half, text in zip(_HALVES, halves, strict=True):
                context = MsgContext.create_default()
                md5.update(compute_md5_text(context, self._specification(context, name + half, text, {})).encode())
        return Kind(name, md5.hexdigest())

    def _found(self, name: str) -> Any:
        if name in ("time", "duration"):
            import genpy

            return genpy.Time if name == "time" else genpy.Duration
        found = installed_type(name, "msg")
        for half, attribute in _HALVES.items():
            if found is None and name.endswith(half):
                found = getattr(installed_type(name.removesuffix(half), "srv"), attribute, None)
        if found is None and (text := self._text(name)) is not None:
            found = _generated(name, self._whole(name, text))
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

    def _whole(self, name: str, text: str) -> str:
        """Return the text with the definitions of all types that it uses, as ROS appends them."""
        from genmsg import MsgContext

        used: dict[str, str] = {}
        with _refusing(name):
            self._specification(MsgContext.create_default(), name, text, used)
        return text.rstrip() + "\n" + "".join(f"{_SEPARATOR}\nMSG: {one}\n{body}\n" for one, body in used.items())

    def _specification(self, context: Any, name: str, text: str, used: dict[str, str]) -> Any:
        """Return what genmsg reads in a definition, after that of the types it uses, which `used` gets."""
        from genmsg.msg_loader import load_msg_from_string

        specification = load_msg_from_string(context, text, name)
        for field in specification.parsed_fields():
            if not field.is_builtin and not context.is_registered(field.base_type):
                used[field.base_type] = self._definition(field.base_type, name)
                self._specification(context, field.base_type, used[field.base_type], used)
        return specification

    def _definition(self, name: str, owner: str) -> str:
        text = self._text(name)
        if text is None:
            whole = getattr(self.find(name), "_full_text", None)
            if whole is None:
                rule = f"uses {name}, which is neither installed nor in the folders of 'interfaces'"
                raise BadRequest(owner, rule, "name the folder of its package, too", slug="unknown-message-type")
            text = _NESTED.split(whole)[0]
        return text


def _generated(name: str, definition: str) -> Any:
    """Return the class that genpy makes of a whole definition."""
    from genpy.dynamic import generate_dynamic

    with _refusing(name):
        classes: Mapping[str, Any] = generate_dynamic(name, definition)
        return classes[name]


@contextlib.contextmanager
def _refusing(name: str) -> Iterator[None]:
    """Refuse a definition that genpy cannot read: it raises all that its parser and the generated code raise."""
    try:
        yield
    except BadRequest:
        raise
    except Exception as error:
        rule = f"must have a definition that genpy reads, but: {error!r:.200}"
        raise BadRequest(f"message type {name}", rule, slug="message-definition") from error
