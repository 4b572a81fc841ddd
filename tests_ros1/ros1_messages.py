"""The classes that ROS's own generator makes of a package: what the bytes of Parcours are compared with."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from parcours.run.hosts.ros1.interfaces import read_index, write_python


@dataclass(frozen=True)
class Endpoint:
    """A channel's message class; `service` is the whole service, None for a topic."""

    topic: str
    message: Any
    service: Any


def load(folder: Path) -> Mapping[str, Endpoint]:
    """Return the classes of a package's channels."""
    package, channels = read_index(folder)
    python = write_python(folder)
    found = {}
    for one in channels:
        kind = "msg" if one.role == "topic" else "srv"
        path = python / package / kind / f"_{one.type}.py"
        spec = importlib.util.spec_from_file_location(f"{package}_{one.type}", path)
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        whole = getattr(module, one.type)
        if one.role == "topic":
            found[one.channel] = Endpoint(one.topic, whole, None)
        else:
            half = whole._request_class if one.role == "request" else whole._response_class
            found[one.channel] = Endpoint(one.topic, half, whole)
    return found


def message(kind: Any, values: Sequence[Any]) -> Any:
    """Return a message of these values."""
    return kind(*(value.tolist() if isinstance(value, np.ndarray) else value for value in values))


def fields(one: Any) -> tuple[Any, ...]:
    """Return the values of a message."""
    return tuple(getattr(one, name) for name in one.__slots__)


def written(kind: Any, values: Sequence[Any]) -> bytes:
    """Return the bytes that ROS writes."""
    buffer = BytesIO()
    message(kind, values).serialize(buffer)
    return buffer.getvalue()
