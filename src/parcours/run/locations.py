"""Where results lie: a folder, or a URL as of a bucket, which fsspec and universal_pathlib make look like one.

out/lift             a folder: a file is written beside its location, and renamed into it
s3://bucket/lift     objects: each appears whole or not at all, and there is no lock
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, cast

from parcours.errors import BadRequest

if TYPE_CHECKING:
    from upath import UPath


def location(given: str | Path) -> Path:
    """Return where results lie: a path, or what stands for one where a URL is given.

    Raises BadRequest: what the URL needs is not installed.

    >>> location("out/lift"), location("file:///out/lift").as_posix()
    (PosixPath('out/lift'), '/out/lift')
    >>> is_bucket(location("memory://lift"))
    True
    """
    if not isinstance(given, str):
        return given
    scheme, found, rest = given.partition("://")
    if not found:
        return Path(given)
    if scheme == "file":
        return Path(rest)
    try:
        from upath import UPath

        # Without a memory of what was listed: other machines write there, too.
        found_there = UPath(given, use_listings_cache=False)
        _ = found_there.fs
    except (ImportError, ValueError) as error:
        rule = f"what opens {scheme}:// must be installed, but: {error}"
        raise BadRequest(given, rule, "pip install 'parcours[cloud]'", slug="no-cloud-extra") from error
    return cast(Path, found_there)  # it has all that is used of a path here


def is_bucket(folder: object) -> bool:
    """Return whether what lies there are objects, not files."""
    return not isinstance(folder, Path)


def require_folder(given: object) -> None:
    """Do nothing if this lies on this machine.

    Raises BadRequest: it is the URL of a bucket.

    >>> require_folder(Path("out"))
    >>> require_folder("s3://bucket/out")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    BadRequest: s3://bucket/out: must lie on this machine, ...
    """
    if is_bucket(given) and "://" in str(given):
        rule = "must lie on this machine, but is a URL: only campaigns in simulated time lie in buckets"
        raise BadRequest(str(given), rule, "name a folder", slug="location-local")


def names_in(folder: Path) -> list[str]:
    """Return what lies there, by name; nothing if there is no such folder."""
    with contextlib.suppress(FileNotFoundError):
        if not is_bucket(folder):
            return os.listdir(folder)  # noqa: PTH208 -- a million names, not paths
        there = cast("UPath", folder)
        return [str(one).rstrip("/").rpartition("/")[2] for one in there.fs.ls(there.path, detail=False)]
    return []


def put(path: Path, content: bytes) -> None:
    """Write an object of a bucket. Raises OSError, or what the bucket's own library does."""
    there = cast("UPath", path)
    there.fs.pipe_file(there.path, content)
