"""Writes a finished report, so that the file is whole or absent."""

from __future__ import annotations

from pathlib import Path

from parcours.run.atomic import unwritable, write_atomically


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 to `path`, all of it or nothing, making its folder if need be.

    Args:
        path: the file to create or replace.
        text: what it will hold; characters that UTF-8 cannot hold (lone surrogates) become question marks.

    Raises:
        BadRequest: the folder cannot be made or written to, or `path` is a folder.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path.parent, error) from error
    write_atomically(path, text.encode("utf-8", errors="replace"))
