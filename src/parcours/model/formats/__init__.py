"""Model files of other tools to models and back, each with a report of what is lost (docs/formats.md)."""

from __future__ import annotations

import importlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from parcours.errors import BadModel, BadRequest, require_known
from parcours.model.formats.reading import MAX_BYTES, Loss, Reading, Writing, text_of
from parcours.model.structure import Cefsm

__all__ = ["FORMATS", "Format", "Loss", "Reading", "Writing", "format_of", "read_any", "write_as"]


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: what it is called, which files have it, and what can be done with it.

    Args:
        title: its name in prose.
        suffixes: of file names, the first one for new files.
        mark: what the start of a file's content looks like, where the suffix alone does not tell; else None.
        reads: whether its module has `read(text, origin) -> Reading`.
        writes: whether its module has `write(cefsm) -> Writing`.
        largest: the largest file that is read [bytes].
    """

    title: str
    suffixes: tuple[str, ...]
    mark: str | None = None
    reads: bool = True
    writes: bool = True
    largest: int = MAX_BYTES


_ROOT = r"(?:\s|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>)*<(?:\w+:)?"

FORMATS: dict[str, Format] = {
    "native": Format("Parcours model/1", (".yaml", ".yml")),
    "uppaal": Format("UPPAAL XML", (".xml",), _ROOT + r"nta\b"),
    "scxml": Format("SCXML", (".scxml", ".xml"), _ROOT + r"scxml\b"),
    "graphwalker": Format("GraphWalker JSON", (".json",)),
    "graphml": Format("yEd GraphML", (".graphml", ".xml"), _ROOT + r"graphml\b"),
    "dot": Format("Graphviz DOT", (".dot", ".gv")),
    "aut": Format("Aldebaran .aut", (".aut",), largest=64_000_000),
    "plantuml": Format("PlantUML state diagram", (".puml", ".plantuml"), reads=False),
    "mermaid": Format("Mermaid state diagram", (".mmd", ".mermaid"), reads=False),
}
"""Name -> format; the module of the same name in this package does the work, imported when it is first needed."""


class _Module(Protocol):
    def read(self, text: str, origin: str) -> Reading: ...
    def write(self, cefsm: Cefsm) -> Writing: ...


def _module(name: str) -> _Module:
    return cast(_Module, importlib.import_module(f"{__name__}.{name}"))


def read_any(path: str | Path, name: str = "") -> Reading:
    """Return the model that a file of any known format holds, and what of the file it does not hold.

    Args:
        path: the file; its suffix and, where several formats share that, its content tell the format.
        name: the format, one of FORMATS, if the file does not tell.

    Raises:
        BadModel: the file cannot be read as its format, or its model has errors.
        BadRequest: the format is unknown, or is only written.
    """
    path = Path(path)
    if name:
        require_known(name, [key for key, each in FORMATS.items() if each.reads], "format", slug="unknown-format")
        return _module(name).read(text_of(path, FORMATS[name].largest), str(path))
    among = _with_suffix(path)
    text = text_of(path, max(FORMATS[each].largest for each in among))
    return _module(_told(among, text, path)).read(text, str(path))


def write_as(cefsm: Cefsm, name: str) -> Writing:
    """Return a model as the text of a format, and what of the model that does not hold.

    Args:
        cefsm: a model without errors.
        name: the format, one of FORMATS.

    Raises:
        BadRequest: the format is unknown.
    """
    require_known(name, [key for key, each in FORMATS.items() if each.writes], "format", slug="unknown-format")
    return _module(name).write(cefsm)


def format_of(path: Path) -> str:
    """Return the format in which a new file of that name would be written: the first with its suffix.

    Raises:
        BadRequest: no format has the suffix.

    >>> format_of(Path("train.xml")), format_of(Path("train.gv"))
    ('uppaal', 'dot')
    """
    return _with_suffix(path)[0]


def _with_suffix(path: Path) -> list[str]:
    found = [name for name, each in FORMATS.items() if path.suffix.lower() in each.suffixes]
    if not found:
        known = ", ".join(dict.fromkeys(suffix for each in FORMATS.values() for suffix in each.suffixes))
        rule = f"the suffix must tell the format, but {path.suffix!r} does not"
        raise BadRequest(str(path), rule, f"name the format, or rename the file. Known: {known}", slug="unknown-format")
    return found


def _told(among: list[str], text: str, path: Path) -> str:
    readable = [name for name in among if FORMATS[name].reads]
    if not readable:
        rule = f"{FORMATS[among[0]].title} is only written, but this file was to be read"
        raise BadRequest(str(path), rule, "give the file it was made from", slug="unknown-format")
    if len(readable) == 1:
        return readable[0]
    start = text[:4000].lstrip("\ufeff")
    for name in readable:
        mark = FORMATS[name].mark
        if mark is not None and re.match(mark, start, re.DOTALL):
            return name
    titles = ", ".join(FORMATS[name].title for name in readable)
    raise BadModel(str(path), "must start as one of its formats does, but does not", f"Known: {titles}", slug="format")
