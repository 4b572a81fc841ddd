"""Reads and writes model files of any known format, with a report of what is lost (docs/formats.md)."""

from __future__ import annotations

import functools
import pkgutil
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from parcours.errors import BadModel, BadRequest, require_known
from parcours.model.conversion import MAX_FOREIGN_BYTES, ForeignModel, Loss, Writing, text_of
from parcours.model.structure import Cefsm

__all__ = [
    "GROUP",
    "NATIVE",
    "ForeignModel",
    "Format",
    "Loss",
    "Writing",
    "format_of",
    "formats",
    "read_any",
    "write_as",
]


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: what it is called, which files have it, and what can be done with it.

    Args:
        title: its name in prose.
        suffixes: of file names, the first one for new files.
        module: what reads and writes it, a module or `module:name`, imported when it is first needed.
        mark: what the start of a file's content looks like, where the suffix alone does not tell; else None.
        reads: whether its module has `read(text, origin) -> Reading`.
        writes: whether its module has `write(cefsm) -> Writing`.
        largest: the largest file that is read [bytes].
    """

    title: str
    suffixes: tuple[str, ...]
    module: str
    mark: str | None = None
    reads: bool = True
    writes: bool = True
    largest: int = MAX_FOREIGN_BYTES


NATIVE = Format("Parcours model/1", (".yaml", ".yml"), "parcours.model.model_file")
"""Our own format (docs/model-format.md)."""

GROUP = "parcours.formats"
"""Entry points of this group are mappings of names to formats, which packages add."""


def packaged(group: str) -> dict[str, Any]:
    """Return what packages add under a group of entry points, each of which is a mapping by name."""
    found: dict[str, Any] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        found |= entry.load()
    return found


@functools.cache
def formats() -> Mapping[str, Format]:
    """Return all formats by name: our own first, then those that packages add."""
    return {"native": NATIVE} | packaged(GROUP)


def _module(name: str) -> Any:
    return pkgutil.resolve_name(formats()[name].module)  # has read(text, origin) or write(cefsm), as its Format says


def read_any(path: str | Path, name: str = "") -> ForeignModel:
    """Return the model that a file of any known format holds, and what of the file it does not hold.

    Args:
        path: the file; its suffix and, where several formats share that, its content tell the format.
        name: the format, one of `formats()`, if the file does not tell.

    Raises:
        BadModel: the file cannot be read as its format, or its model has errors.
        BadRequest: the format is unknown, or is only written.
    """
    path = Path(path)
    if name:
        require_known(name, [key for key, each in formats().items() if each.reads], "format", slug="unknown-format")
        text = text_of(path, formats()[name].largest)
    else:
        among = _with_suffix(path)
        text = text_of(path, max(formats()[each].largest for each in among))
        name = _marked(among, text, path)
    reading: ForeignModel = _module(name).read(text, str(path))
    return reading


def write_as(cefsm: Cefsm, name: str) -> Writing:
    """Return a model as the text of a format, and what of the model that does not hold.

    Args:
        cefsm: a model without errors.
        name: the format, one of `formats()`.

    Raises:
        BadRequest: the format is unknown.
    """
    require_known(name, [key for key, each in formats().items() if each.writes], "format", slug="unknown-format")
    writing: Writing = _module(name).write(cefsm)
    return writing


def format_of(path: Path) -> str:
    """Return the format in which a new file of that name would be written: the first with its suffix.

    Raises:
        BadRequest: no format has the suffix.
    """
    return _with_suffix(path)[0]


def _with_suffix(path: Path) -> list[str]:
    found = [name for name, each in formats().items() if path.suffix.lower() in each.suffixes]
    if not found:
        known = ", ".join(dict.fromkeys(suffix for each in formats().values() for suffix in each.suffixes))
        rule = f"the suffix must tell the format, but {path.suffix!r} does not"
        raise BadRequest(str(path), rule, f"name the format, or rename the file. Known: {known}", slug="unknown-format")
    return found


def _marked(among: list[str], text: str, path: Path) -> str:
    readable = [name for name in among if formats()[name].reads]
    if not readable:
        rule = f"{formats()[among[0]].title} is only written, but this file was to be read"
        raise BadRequest(str(path), rule, "give the file it was made from", slug="unknown-format")
    if len(readable) == 1:
        return readable[0]
    start = text[:4000].lstrip("\ufeff")
    for name in readable:
        mark = formats()[name].mark
        if mark is not None and re.match(mark, start, re.DOTALL):
            return name
    titles = ", ".join(formats()[name].title for name in readable)
    raise BadModel(str(path), "must start as one of its formats does, but does not", f"Known: {titles}", slug="format")
