"""A ROS 1 package's folder -> message and service classes, and flat values -> messages and back, arrays as numpy.

The classes are genpy's, with reading and writing replaced: its own goes through tuples of Python numbers, and takes
what is too long.
"""

from __future__ import annotations

import importlib.util
import operator
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from parcours.errors import HostFailure, one_of
from parcours.run.hosts.ros1 import no_ros
from parcours.run.hosts.ros1.interfaces import Interface, read_index

PYTHON = "python"
"""The subfolder with the generated classes; on PYTHONPATH, rostopic and rosbag find them, too."""

_LENGTH = struct.Struct("<I")
_SCALARS = {"float64": struct.Struct("<d"), "int64": struct.Struct("<q"), "bool": struct.Struct("<?")}
_ARRAYS = {"float64[]": "<f8", "int64[]": "<i8"}


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A channel with its classes: `message` is sent on it; `service` is the whole service, None for a topic."""

    interface: Interface
    message: Any
    service: Any


@dataclass(frozen=True, slots=True)
class Messages:
    """All channels of a package."""

    package: str
    endpoints: Mapping[str, Endpoint]

    def __getitem__(self, channel: str) -> Endpoint:
        """Return the channel's classes.

        Raises:
            HostFailure: the package has no such channel.
        """
        try:
            return self.endpoints[channel]
        except KeyError:
            where, remedy = f"ROS package {self.package}", one_of(channel, list(self.endpoints))
            rule = f"has no channel {channel!r}"
            raise HostFailure(where, rule, remedy, slug="unknown-channel") from None

    def to_ros(self, channel: str, values: Sequence[object]) -> Any:
        """Return the message that carries the values of the channel's flat form.

        Args:
            channel: a channel of the model.
            values: one for each field, in order; arrays of shape (n,).

        Raises:
            HostFailure: there are too few or too many, or one is of another kind.
        """
        kind = self[channel].message
        names, types = kind.__slots__, kind._slot_types
        if len(values) != len(names):
            _refuse(channel, f"has {len(names)} fields ({', '.join(names)}), but {len(values)} values were given")
        message = kind.__new__(kind)
        for name, type_, value in zip(names, types, values, strict=True):
            try:
                setattr(message, name, _value(type_, value))
            except (TypeError, ValueError):
                _refuse(channel, f"{name} is {type_}, but {value!r:.60} was given")
        return message

    def from_ros(self, channel: str, message: Any) -> tuple[object, ...]:
        """Return the values of the channel's flat form; arrays are numpy's, of shape (n,).

        Args:
            channel: a channel of the model.
            message: of the channel's class, or of another program's class of that name.

        Raises:
            HostFailure: it lacks a field, or a field is of another kind.
        """
        kind = self[channel].message
        values = []
        for name, type_ in zip(kind.__slots__, kind._slot_types, strict=True):
            try:
                values.append(_value(type_, getattr(message, name)))
            except (AttributeError, TypeError, ValueError):
                _refuse(channel, f"a message has {name} of type {type_}, but {type(message).__name__} has not")
        return tuple(values)


def load(folder: Path) -> Messages:
    """Return the classes of a package's channels; they are generated if nobody has done that yet.

    Nothing is registered: several packages of one name may be loaded.

    Args:
        folder: as `interfaces.write_package` left it.

    Raises:
        HostFailure: there is no such package, or no ROS 1.
    """
    package, channels = read_index(folder)
    if not (folder / PYTHON / package).is_dir():
        write_python(folder)
    modules: dict[str, Any] = {}
    endpoints = {}
    for one in channels:
        kind = "msg" if one.role == "topic" else "srv"
        path = folder / PYTHON / package / kind / f"_{one.type}.py"
        if str(path) not in modules:
            modules[str(path)] = _run(package, kind, one.type, path)
        found = getattr(modules[str(path)], one.type)
        if one.role == "topic":
            endpoints[one.channel] = Endpoint(one, found, None)
        else:
            part = found._request_class if one.role == "request" else found._response_class
            endpoints[one.channel] = Endpoint(one, part, found)
    return Messages(package, endpoints)


def write_python(folder: Path) -> Path:
    """Generate the package's Python classes with genpy and return the folder to put on a Python path.

    Raises:
        HostFailure: there is no genpy, or it refuses a file.
    """
    try:
        from genmsg import MsgContext, MsgGenerationException
        from genpy.generate_initpy import write_modules
        from genpy.generator import MsgGenerator, SrvGenerator
    except ImportError:
        raise no_ros("genpy") from None
    package, _ = read_index(folder)
    target = folder / PYTHON / package
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        (target / kind).mkdir(parents=True, exist_ok=True)
        context = MsgContext.create_default()
        for source in sorted((folder / kind).glob(f"*.{kind}")):
            try:
                generator.generate(context, f"{package}/{source.stem}", str(source), str(target / kind), {})
            except MsgGenerationException as error:
                raise HostFailure(str(source), f"genpy refuses it: {error}", slug="ros1-interface") from error
        write_modules(str(target / kind))
    (target / "__init__.py").touch()
    return target.parent


def _run(package: str, kind: str, name: str, path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(f"{package}.{kind}._{name}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise HostFailure(str(path), "must hold the generated classes, but does not exist",
                          "remove the folder and write the package again", slug="ros1-interface")  # fmt: skip
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except ImportError:
        raise no_ros("genpy") from None
    for part in (name, f"{name}Request", f"{name}Response"):
        found: Any = getattr(module, part, None)
        if hasattr(found, "_slot_types"):
            found.serialize, found.deserialize = _serialize, _deserialize
    return module


def _serialize(self: Any, buff: BytesIO) -> None:
    """Write the message as ROS 1 does: little-endian, without padding, arrays after their length."""
    for name, type_ in zip(self.__slots__, self._slot_types, strict=True):
        value = getattr(self, name)
        try:
            if type_ in _SCALARS:
                buff.write(_SCALARS[type_].pack(value))
            else:
                array = np.ascontiguousarray(value, _ARRAYS[type_])
                buff.write(_LENGTH.pack(array.size))
                buff.write(array.tobytes())
        except (struct.error, TypeError, ValueError, OverflowError) as error:
            from genpy import SerializationError

            raise SerializationError(f"{self._type}: {name} must be {type_}, but {value!r:.60} was given") from error


def _deserialize(self: Any, data: bytes) -> Any:
    """Read the message back and return it; its arrays own their memory."""
    at, name = 0, ""
    try:
        for name, type_ in zip(self.__slots__, self._slot_types, strict=True):
            if type_ in _SCALARS:
                (value,) = _SCALARS[type_].unpack_from(data, at)
                setattr(self, name, value)
                at += _SCALARS[type_].size
            else:
                (size,) = _LENGTH.unpack_from(data, at)
                at += _LENGTH.size
                setattr(self, name, np.frombuffer(data, _ARRAYS[type_], size, at).copy() if size else _empty(type_))
                at += 8 * size
        name = "its end"
        if at != len(data):
            raise ValueError(f"{len(data) - at} bytes follow")
    except (struct.error, ValueError) as error:
        from genpy import DeserializationError

        rule = f"{self._type}: {len(data)} bytes are no such message; at {name}: {error}"
        raise DeserializationError(rule) from error
    return self


def _empty(type_: str) -> Any:
    return np.empty(0, _ARRAYS[type_])


def _value(type_: str, value: Any) -> object:
    if type_ in _ARRAYS:
        array = np.asarray(value)
        if array.ndim != 1:
            raise ValueError
        if not array.size:
            return _empty(type_)
        return np.ascontiguousarray(array.astype(_ARRAYS[type_], casting="same_kind", copy=False))
    if type_ == "int64":
        return operator.index(value)
    if type_ == "bool":
        if value not in (0, 1):
            raise ValueError
        return bool(value)
    if isinstance(value, str | bytes):
        raise TypeError
    return float(value)


def _refuse(channel: str, rule: str) -> NoReturn:
    remedy = "compare it with the channel's flat form"
    raise HostFailure(f"channel {channel!r}", rule, remedy, slug="ros1-message")
