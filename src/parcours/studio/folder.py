"""Serves the text files of one folder and nothing outside it: no link is followed, no special file opened.

Each part of a path is opened in the folder before it, so what is checked is what is read:

    root ──openat──► examples ──openat──► lift ──openat──► model.yaml      a link at any place: refused
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import stat
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from parcours.errors import BadRequest
from parcours.model.documents import MAX_BYTES
from parcours.run.atomic import write_atomically
from parcours.run.store import MANIFEST
from parcours.study.components.results import FILE as COMPONENTS
from parcours.study.journal import RUN

SUFFIXES = (".yaml", ".yml")
RESULTS = (RUN, MANIFEST, COMPONENTS)
_KIND = re.compile(r"(?m)^parcours:\s*[\"']?([a-z]{1,20})/[0-9]")
_SKIPPED = ("node_modules", "__pycache__")
_HEAD = 4096  # a file says in its first bytes what it is
_DEPTH, _MOST_SEEN, _MOST_LISTED = 8, 20_000, 2000


@dataclass(frozen=True, slots=True)
class FolderEntry:
    """Something in the folder: its path from there, and what it is."""

    path: str
    kind: str  # what a YAML file says of itself (model, study, data ...), else `file`; `run` for a folder of results


@dataclass(frozen=True, slots=True)
class FileText:
    """The text of a file, and the version that a change of it must name."""

    text: str
    version: str


class Folder:
    """A folder whose files are shown and changed."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self._saving = threading.Lock()

    def entries(self) -> tuple[list[FolderEntry], bool]:
        """Return the YAML files and folders of results, by path, and whether that is all of them."""
        found: list[FolderEntry] = []
        left = _MOST_SEEN
        waiting = [("", 0)]
        while waiting and left > 0 and len(found) < _MOST_LISTED:
            place, depth = waiting.pop()
            with contextlib.suppress(OSError), os.scandir(self.root / place) as scan:
                inside = sorted((one for one in scan if _is_shown(one.name)), key=lambda one: one.name)
                left -= len(inside)
                if place and any(one.name in RESULTS and one.is_file(follow_symlinks=False) for one in inside):
                    found.append(FolderEntry(place, "run"))
                    continue
                for one in inside:
                    path = f"{place}/{one.name}" if place else one.name
                    if one.is_dir(follow_symlinks=False) and depth < _DEPTH and one.name not in _SKIPPED:
                        waiting.append((path, depth + 1))
                    elif one.name.endswith(SUFFIXES) and one.is_file(follow_symlinks=False):
                        with contextlib.suppress(BadRequest):
                            head = self.read(path, _HEAD, cut=True).decode(errors="replace")
                            found.append(FolderEntry(path, kind_of(head)))
        return sorted(found, key=lambda one: one.path)[:_MOST_LISTED], not waiting and len(found) <= _MOST_LISTED

    def text(self, path: str) -> FileText:
        """Return the text of a YAML file.

        Raises BadRequest: there is none of that path in the folder, it is too large, or no UTF-8.
        """
        if not path.endswith(SUFFIXES):
            raise _absent(path)
        content = self.read(path, MAX_BYTES)
        try:
            return FileText(content.decode(), _version(content))
        except UnicodeDecodeError:
            raise BadRequest(path, "a file must be UTF-8 text, but is not", slug="studio-file") from None

    def save(self, path: str, text: str, version: str) -> str:
        """Replace the text of a file whose version is the one given, as a whole; return its new version.

        Raises BadRequest: there is no such file, its version is another by now, or the text is too large.
        """
        with self._saving:
            before = self.text(path)
            if before.version != version:
                rule = "a file must not have changed since it was opened, but this one has"
                raise BadRequest(path, rule, "copy your text, and open the file again", slug="studio-changed")
            # A browser's text field knows only \n as the end of a line.
            content = (text.replace("\n", "\r\n") if "\r\n" in before.text else text).encode(errors="replace")
            if len(content) > MAX_BYTES:
                raise _large(path, MAX_BYTES)
            write_atomically(self.root / path, content)
            return _version(content)

    def read(self, path: str, most: int, *, begin: int = 0, cut: bool = False) -> bytes:
        """Return the bytes of a regular file from `begin` on; at most `most` of a longer one, if it may be cut.

        Raises BadRequest: there is none of that path in the folder, or it is larger.
        """
        with self._opened(path) as handle:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise _absent(path)
            with os.fdopen(os.dup(handle), "rb") as file:
                file.seek(begin)
                content = file.read(most + 1)
        if len(content) > most and not cut:
            raise _large(path, most)
        return content[:most]

    def directory(self, path: str) -> Path:
        """Return where a folder inside lies. Raises BadRequest: there is none of that path, or a link leads there."""
        with self._opened(path) as handle:
            if not stat.S_ISDIR(os.fstat(handle).st_mode):
                raise _absent(path)
        return self.root / path

    def inside(self, path: Path) -> str | None:
        """Return the path from the folder of something that lies there, links resolved; None if it lies elsewhere."""
        real = path.resolve()
        return real.relative_to(self.root).as_posix() if real.is_relative_to(self.root) else None

    @contextlib.contextmanager
    def _opened(self, path: str) -> Iterator[int]:
        parts = PurePosixPath(path).parts
        if not parts or path.startswith("/") or not all(map(_is_shown, parts)) or "\0" in path:
            raise _absent(path)
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        at = os.open(self.root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            for part in parts:
                inner = os.open(part, flags, dir_fd=at)
                os.close(at)
                at = inner
            yield at
        except (OSError, UnicodeEncodeError):
            raise _absent(path) from None
        finally:
            os.close(at)


def kind_of(text: str) -> str:
    """Return what a YAML file says it is: `model` of a file with the line `parcours: model/1`, `file` without one.

    >>> kind_of("# a lift\\nparcours: model/1\\n"), kind_of("name: lift")
    ('model', 'file')
    """
    found = _KIND.search(text, 0, _HEAD)
    return found[1] if found else "file"


def _is_shown(name: str) -> bool:
    """Return whether a name is not hidden (`..` is) and can be shown: it may be any bytes."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return not name.startswith(".")


def _version(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _absent(path: str) -> BadRequest:
    rule = "a path must lead to a file or folder inside the studio's folder, without links, but this one does not"
    return BadRequest(path[:200], rule, "choose one of the list", slug="studio-file")


def _large(path: str, most: int) -> BadRequest:
    return BadRequest(path, f"a file has at most {most} bytes, but this one has more", "split it", slug="studio-size")
