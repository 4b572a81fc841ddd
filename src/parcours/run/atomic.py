"""Writes files that are either whole or absent, even if the machine stops in the middle."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from parcours.errors import BadRequest
from parcours.run.locations import is_bucket, put

_TAG = f"{socket.gethostname()}-{{pid}}.partial"


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` beside `path`, force it to the disk and rename it into place; an object of a bucket as it is.

    Args:
        path: the file to create or replace; its folder exists.
        content: all of it.

    Raises:
        BadRequest: the folder cannot be written to, or is full.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_atomically(Path(folder, "a"), b"whole")
    ...     [(file.name, file.read_bytes()) for file in Path(folder).iterdir()]
    [('a', b'whole')]
    """
    if is_bucket(path):
        try:
            put(path, content)
        except Exception as error:  # whatever the library of that bucket raises
            raise unwritable(path, error) from error
        return
    with replacing(path) as partial:
        partial.write_bytes(content)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the name of a file beside `path` to be written; then force it to the disk and rename it into place.

    Raises:
        BadRequest: the folder cannot be written to, or is full.
    """
    partial = path.with_name(f".{path.name}.{_TAG.format(pid=os.getpid())}")
    try:
        try:
            yield partial
            _sync(partial)
            partial.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                partial.unlink()
            raise
        _sync(path.parent)
    except OSError as error:
        raise unwritable(path, error) from error


def require_writable(folder: Path) -> None:
    """Make the folder if need be, and make sure that files can be written there; what lies there stays as it is.

    Raises:
        BadRequest: it cannot be made or written to.
    """
    try:
        if not is_bucket(folder):  # where there are no folders
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from error
    write_atomically(folder / ".writable", b"")
    (folder / ".writable").unlink(missing_ok=True)


def unwritable(path: Path, error: Exception) -> BadRequest:
    """Return the complaint that `path` cannot be written.

    >>> print(unwritable(Path("out"), PermissionError(13, "Permission denied")))
    out: must be writable, but: Permission denied; name another folder or free this one [folder-unwritable]
    """
    rule = f"must be writable, but: {getattr(error, 'strerror', None) or error}"
    return BadRequest(str(path), rule, "name another folder or free this one", slug="folder-unwritable")


def sweep(folder: Path) -> None:
    """Remove what writers of this machine left half-written in `folder` when they were killed."""
    if is_bucket(folder):
        return
    for partial in folder.glob(f".*.{_TAG.format(pid='*')}"):
        pid = partial.name.removesuffix(".partial").rpartition("-")[2]
        if pid.isdecimal() and not _alive(int(pid)):
            partial.unlink(missing_ok=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
