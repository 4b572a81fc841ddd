"""Lets one run at a time write in a folder: a lock on the folder itself, which ends with its process."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from parcours.errors import BadResults
from parcours.run.atomic import unwritable
from parcours.run.locations import is_bucket

_held: set[int] = set()  # descriptors of the locks of this process


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Let no other run write in a folder while the block lasts.

    The lock is an `flock` on the folder itself, so no file is left behind. Processes forked meanwhile do not hold it:
    it ends with this process, however that ends. On a file system without such locks, and in a bucket,
    nothing is locked: two runs of one campaign then write the same bytes twice.

    Raises:
        BadResults: another run is writing there.
        BadRequest: the folder cannot be opened.
    """
    if is_bucket(folder):
        yield
        return
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise unwritable(folder, error) from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        by = _holder(handle)
        os.close(handle)
        rule = f"only one run at a time may write there, but {by} is writing"
        raise BadResults(str(folder), rule, "wait until it ends, or name another folder",
                         slug="results-busy") from None  # fmt: skip
    except OSError:  # a network file system, say
        pass
    _held.add(handle)
    try:
        yield
    finally:
        if handle in _held:  # not in a process forked meanwhile
            _held.discard(handle)
            os.close(handle)


def _holder(handle: int) -> str:
    """Return who holds the lock, according to Linux's list of all locks."""
    inode = str(os.fstat(handle).st_ino)
    with contextlib.suppress(OSError, IndexError):
        for line in Path("/proc/locks").read_text().splitlines():
            fields = line.split()  # 1: FLOCK ADVISORY WRITE 4711 fe:00:131074 0 EOF
            if fields[1] == "FLOCK" and fields[5].rpartition(":")[2] == inode and int(fields[4]) > 0:
                return f"process {fields[4]}"
    return "another process"


def _leave_to_parent() -> None:
    """Close the parent's locks in a process just forked, which must not hold them when the parent has ended."""
    for handle in _held:
        with contextlib.suppress(OSError):
            os.close(handle)
    _held.clear()


os.register_at_fork(after_in_child=_leave_to_parent)
