"""Finds the classes of ROS 2 types, building what is not installed, and writes definitions for recordings."""

from __future__ import annotations

import importlib
import re
import sys
from typing import Any

from parcours.run.binding import Binding, MessageTypes
from parcours.run.binding.message_types import slot_of
from parcours.run.hosts.foreign.graph import installed_type
from parcours.run.hosts.ros2.building import built
from parcours.run.hosts.ros2.participant import require_rclpy
from parcours.run.recording import Raw

_OF_ACTION = re.compile(r"(?P<action>.+?)_?(?P<part>Goal|Result|Feedback|FeedbackMessage)")
"""A part of an action: of its class, `a_msgs/Go_Goal` as definitions name it, `a_msgs/GoGoal` as bindings do."""

_HALVES = ("Request", "Response")
_WORDS = {"float": "float32", "double": "float64", "boolean": "bool", "octet": "byte"}
"""Types whose names in generated classes are those of IDL, as .msg files name them."""

_BOUND = re.compile(r"<([0-9]+)>")
_SEQUENCE = re.compile(r"sequence<(?P<item>.+?)(?:, ?(?P<bound>[0-9]+))?>")
_DUMMY = "structure_needs_at_least_one_member"
_SEPARATOR = "=" * 80


class Ros2Types:
    """The types of a foreign system: of installed packages, and of those that `interfaces` of the binding define.

    Attributes:
        built: the folder of the latter; None if there is none.

    Raises:
        HostFailure: there is no rclpy.
        BadRequest: a definition cannot be built.
    """

    def __init__(self, binding: Binding) -> None:
        require_rclpy()
        folders = [folder.resolve() for folder in binding.python_paths]
        for folder in folders:
            if str(folder) not in sys.path:
                sys.path.append(str(folder))
        self.built = built(binding.interfaces) if binding.interfaces else None
        if self.built is not None and str(self.built) not in sys.path:
            sys.path.append(str(self.built))
        importlib.invalidate_caches()
        from rclpy.serialization import deserialize_message, serialize_message

        self.types = MessageTypes(self.find, serialize_message, lambda kind, data: deserialize_message(data, kind))
        self._kinds: dict[str, Raw] = {}

    def find(self, name: str) -> Any:
        """Return the class of a message, of half a service (`nav_msgs/GetPlanRequest`) or an action's goal, or None."""
        found = installed_type(name, "msg")
        action = _OF_ACTION.fullmatch(name)
        if found is None and action is not None:
            kind = self.action(action["action"])
            of_impl = action["part"] == "FeedbackMessage"
            found = getattr(kind and kind.Impl if of_impl else kind, action["part"], None)
        for half in _HALVES:
            if found is None and name.endswith(half):
                found = getattr(self.service(name.removesuffix(half)), half, None)
        return found

    def service(self, name: str) -> Any:
        """Return the class of a service; None if it is unknown."""
        action, _, part = name.rpartition("_")
        if part in ("SendGoal", "GetResult"):
            kind = self.action(action)
            return kind and getattr(kind.Impl, f"{part}Service")
        return installed_type(name, "srv")

    def action(self, name: str) -> Any:
        """Return the class of an action; None if it is unknown."""
        return installed_type(name, "action")

    def kind(self, name: str) -> Raw | None:
        """Return an empty message of a type, with its definition; None if the type is unknown."""
        if name not in self._kinds:
            found = self.find(name)
            if found is None:
                return None
            package, _, base = name.partition("/")
            said = f"{package}/msg/{base}"
            if found.__module__.startswith(f"{package}.action"):
                said = f"{package}/action/{found.__name__}"
            elif found.__module__.startswith(f"{package}.srv"):
                half = next(one for one in _HALVES if base.endswith(one))
                said = f"{package}/srv/{base.removesuffix(half)}_{half}"
            self._kinds[name] = Raw(said, "", self._definition(name), b"", "cdr")
        return self._kinds[name]

    def _definition(self, name: str) -> str:
        """Return the definition of a type with those of all that it uses, as ROS appends them."""
        used = {name: ""}
        text = self._own(name, used)
        while (missing := next((one for one, body in used.items() if not body and one != name), None)) is not None:
            used[missing] = self._own(missing, used) or "\n"
        del used[name]
        return text + "".join(f"{_SEPARATOR}\nMSG: {one}\n{body}" for one, body in used.items())

    def _own(self, name: str, used: dict[str, str]) -> str:
        lines = []
        for field, text in self.find(name).get_fields_and_field_types().items():
            item = slot_of(text).item
            if "/" in item:
                used.setdefault(item, "")
            if field != _DUMMY:
                lines.append(f"{_in_words(text)} {field}\n")
        return "".join(lines)


def _in_words(text: str) -> str:
    """Return the type of a field as .msg files write it.

    >>> [_in_words(text) for text in ("sequence<double, 4>", "float[3]", "string<8>", "sequence<a_msgs/B>")]
    ['float64[<=4]', 'float32[3]', 'string<=8', 'a_msgs/B[]']
    """
    listed = _SEQUENCE.fullmatch(text)
    if listed:
        bound = listed["bound"]
        return _in_words(listed["item"]) + (f"[<={bound}]" if bound else "[]")
    base, bracket, length = text.partition("[")
    return _BOUND.sub(r"<=\1", _WORDS.get(base, base)) + bracket + length
