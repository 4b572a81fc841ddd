"""Reads and writes input models in files of any known format, with a report of what is lost."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from parcours.data.inputs import InputModel
from parcours.data.schema import read_input_model
from parcours.data.writing import write_input_model
from parcours.errors import BadRequest
from parcours.model.conversion import Loss, Writing
from parcours.model.formats import packaged

GROUP = "parcours.data_formats"
"""Entry points of this group are mappings of names to formats, which packages add."""

_NATIVE = (".yaml", ".yml")


@dataclass(frozen=True, slots=True)
class DataFormat:
    """A file format of input models.

    Args:
        title: its name in prose.
        suffixes: of file names.
        module: has `read(path) -> DataReading` and `write(model) -> Writing`; imported when it is first needed.
    """

    title: str
    suffixes: tuple[str, ...]
    module: str


@dataclass(frozen=True, slots=True)
class DataReading:
    """An input model that was read, what of the file it does not hold, and what the file calls the inputs."""

    model: InputModel
    losses: tuple[Loss, ...] = ()
    titles: tuple[str, ...] = ()


class _Module(Protocol):
    def read(self, path: Path) -> DataReading: ...
    def write(self, model: InputModel) -> Writing: ...


@functools.cache
def data_formats() -> Mapping[str, DataFormat]:
    """Return the formats that packages add, by name."""
    return packaged(GROUP)


def read_data(path: Path) -> DataReading:
    """Return the input model of a file; its suffix tells the format, and without a known one it is our own YAML."""
    module = _module(path)
    return module.read(path) if module is not None else DataReading(read_input_model(path))


def write_data(model: InputModel, path: Path) -> Writing:
    """Return an input model as the text of the format that a file's suffix tells.

    Raises:
        BadRequest: the suffix is unknown.
    """
    module = _module(path)
    if module is not None:
        return module.write(model)
    if path.suffix.lower() in _NATIVE:
        return Writing(write_input_model(model))
    known = ", ".join([*_NATIVE, *(suffix for each in data_formats().values() for suffix in each.suffixes)])
    rule = f"the suffix must tell the format, but {path.suffix!r} does not"
    raise BadRequest(str(path), rule, f"Known: {known}", slug="unknown-format")


def _module(path: Path) -> _Module | None:
    for each in data_formats().values():
        if path.suffix.lower() in each.suffixes:
            return cast(_Module, importlib.import_module(each.module))
    return None
