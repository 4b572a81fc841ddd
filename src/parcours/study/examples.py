"""The examples that ship with Parcours: of a checkout its folder `examples`, else what its wheel has packed.

An example may take files from its neighbours, as `model: ../lift/model.yaml` does. A copy has them beside the others.
"""

from __future__ import annotations

import posixpath
import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath

import parcours
from parcours.study.copying import tree

_REFERENCE = re.compile(r"\.\./[\w./-]*\w")
_SOURCES = "../src/"
_ENDS = re.compile(r"(?<=[^.])\.(?:\s|$)")


def _root() -> Traversable:
    packed = files("parcours") / "examples"
    return packed if packed.is_dir() else Path(parcours.__file__).absolute().parents[2] / "examples"


def examples() -> dict[str, Traversable]:
    """Return the folder or file of each example, by name; none where they were not installed."""
    root = _root()
    if not root.is_dir():
        return {}
    found = {place.parts[0]: root / place.parts[0] for place in tree(root)}
    return {name.removesuffix(".yaml"): one for name, one in sorted(found.items())}


def about(example: Traversable) -> str:
    """Return a sentence about an example: what its study says of itself, its README, or the head of its binding."""
    if not example.is_dir():
        return _head(example)
    places = {str(place): file for place, file in tree(example).items()}
    if "study.yaml" in places:
        said = re.search(r"(?m)^doc:\s*(.+)$", _text(places["study.yaml"]))
        return said[1].strip("\"' ") if said else _head(places["study.yaml"])
    if "README.md" in places:
        return _sentence(_text(places["README.md"]).partition("\n\n")[2])
    return _head(places["binding.yaml"]) if "binding.yaml" in places else ""


def contents_of(example: Traversable) -> dict[PurePosixPath, bytes]:
    """Return the files of an example by place, with those that it takes from elsewhere beside them."""
    alone = not example.is_dir()
    taken = {PurePosixPath(example.name): example} if alone else tree(example)
    home = "" if alone else example.name
    found = {place: file.read_bytes() for place, file in taken.items()}
    for place in [one for one in found if one.suffix in (".yaml", ".yml")]:
        lines = found[place].decode().splitlines(keepends=True)
        for number, line in enumerate(lines):
            for reference in [] if line.lstrip().startswith("#") else _REFERENCE.findall(line):
                file = _elsewhere(posixpath.normpath(posixpath.join(home, place.parent, reference)))
                if file is not None:
                    found[place.parent / file.name] = file.read_bytes()
                    lines[number] = lines[number].replace(reference, file.name)
        found[place] = "".join(lines).encode()
    return dict(sorted(found.items()))


def _elsewhere(place: str) -> Traversable | None:
    """Return the file at a place that counts from the folder of all examples; None if there is none."""
    inside = place.startswith(_SOURCES)
    file: Traversable = (
        Path(parcours.__file__).absolute().parents[1].joinpath(place.removeprefix(_SOURCES))
        if inside
        else _root().joinpath(place)
    )
    return file if (inside or not place.startswith("..")) and file.is_file() else None


def _text(file: Traversable) -> str:
    return file.read_text(encoding="utf-8")


def _head(file: Traversable) -> str:
    lines = []
    for line in _text(file).splitlines():
        if not line.startswith("# "):
            break
        lines.append(line[2:])
    return _sentence(" ".join(lines))


def _sentence(text: str) -> str:
    return _ENDS.split(" ".join(text.split()), maxsplit=1)[0].rstrip(".")
