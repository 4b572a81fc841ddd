"""Copies packaged files into a folder of the user's: all of them or none, and nothing there is overwritten."""

from __future__ import annotations

import contextlib
import os
import re
import unicodedata
from collections.abc import Mapping
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath

from parcours.errors import BadRequest
from parcours.run.atomic import unwritable

# Entry points of this group bring templates of further kinds of study: `kind = package:FOLDER`, FOLDER lying in it
GROUP = "parcours.templates"
SUFFIX = ".template"  # ending of template files that tools must not take for source code of Parcours; the copy lacks it
NAME = b"STUDY_NAME"  # what a template writes where the name of the study belongs
_LEFT_OUT = re.compile(r"__pycache__|build|\..*|.*\.(?:py[co]|o)")
_BUILT = b"\x7fELF"
_OTHER = re.compile(r"[^A-Za-z0-9_.+@=,-]+")
_PLAIN = re.compile(r"(?!(?:true|false|null|yes|no|on|off|y|n)$)[A-Za-z_][A-Za-z0-9_.-]*", re.IGNORECASE)
_LONGEST = 60


def templates() -> dict[str, Traversable]:
    """Return the folder of each kind's template, those of add-ons after those that are always there."""
    own = files("parcours.study") / "templates"
    found = {one.name: one for one in sorted(own.iterdir(), key=lambda one: one.name) if one.is_dir()}
    found.pop("__pycache__", None)
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        found.setdefault(point.name, files(point.module).joinpath(point.attr))
    return found


def study_name(folder: Path) -> str:
    """Return the name of a study that lies in a folder: the folder's own, made fit for the ids of cases.

    >>> study_name(Path("out/my crossing")), study_name(Path("Größe")), study_name(Path("...")), study_name(Path("42"))
    ('my_crossing', 'Groe', 'study', '42')
    """
    plain = unicodedata.normalize("NFKD", folder.resolve().name).encode("ascii", "ignore").decode()
    name = _OTHER.sub("_", plain).strip("._-")[:_LONGEST]
    return name or "study"


def in_yaml(name: str) -> str:
    """Return a name as YAML writes it: in quotes if it would not be read as a text without.

    >>> in_yaml("crossing"), in_yaml("42"), in_yaml("no")
    ('crossing', '"42"', '"no"')
    """
    return name if _PLAIN.fullmatch(name) else f'"{name}"'


def tree(root: Traversable) -> dict[PurePosixPath, Traversable]:
    """Return the files below a folder by their place in it; hidden ones and those that were built are left out."""
    found: dict[PurePosixPath, Traversable] = {}
    for one in sorted(root.iterdir(), key=lambda one: one.name):
        if _LEFT_OUT.fullmatch(one.name):
            continue
        if one.is_dir():
            found |= {PurePosixPath(one.name) / place: file for place, file in tree(one).items()}
        elif one.is_file():
            with one.open("rb") as opened:
                if opened.read(len(_BUILT)) != _BUILT:
                    found[PurePosixPath(one.name)] = one
    return found


def runnable(contents: Mapping[PurePosixPath, bytes]) -> frozenset[PurePosixPath]:
    """Return the places of the files that say what runs them."""
    return frozenset(place for place, content in contents.items() if content.startswith(b"#!"))


def from_template(root: Traversable, name: str) -> dict[PurePosixPath, bytes]:
    """Return the files of a study that a template makes, by their place."""
    made = {}
    for place, file in tree(root).items():
        written = in_yaml(name) if place.suffix in (".yaml", ".yml") else name
        made[place.with_name(place.name.removesuffix(SUFFIX))] = file.read_bytes().replace(NAME, written.encode())
    return made


def write_new(folder: Path, contents: Mapping[PurePosixPath, bytes], runnable: frozenset[PurePosixPath]) -> None:
    """Write files into a folder, which is made if need be: all of them, or none."""
    there = [place for place in contents if os.path.lexists(folder / place)]
    if there:
        named = ", ".join(map(str, there[:5])) + ("" if len(there) <= 5 else f" and {len(there) - 5} more")
        rule = f"nothing that is there is overwritten, but it holds {named}"
        raise BadRequest(str(folder), rule, "name another folder, or move these files away", slug="file-there")
    written: list[Path] = []
    made: list[Path] = []
    try:
        for place, content in contents.items():
            path = folder / place
            _make(path.parent, made)
            with path.open("xb") as file:  # refuses what somebody else has put there meanwhile
                written.append(path)
                file.write(content)
            if place in runnable:
                path.chmod(path.stat().st_mode | 0o111)
    except BaseException as error:
        for path in reversed(written):
            with contextlib.suppress(OSError):
                path.unlink()
        for path in reversed(made):
            with contextlib.suppress(OSError):
                path.rmdir()
        if isinstance(error, OSError):
            raise unwritable(folder, error) from error
        raise


def _make(folder: Path, made: list[Path]) -> None:
    """Make a folder and those above it, and note each that was not there."""
    if folder.is_dir():
        return
    _make(folder.parent, made)
    folder.mkdir()
    made.append(folder)
