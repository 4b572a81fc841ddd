"""Keeps a copy of what is written into a folder of results while strangers' code runs, and puts it back in the end."""

from __future__ import annotations

import io
import os
import tempfile
import weakref
from typing import IO

import numpy as np

from parcours.errors import BadRequest, BadResults
from parcours.run.atomic import write_atomically
from parcours.run.locations import is_bucket
from parcours.run.store import Rows, Store

_copies: weakref.WeakSet[IO[bytes]] = weakref.WeakSet()


def _close_copies() -> None:
    """Let no worker reach them."""
    for copy in list(_copies):
        copy.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_copies)


_GONE = (FileNotFoundError, NotADirectoryError, FileExistsError)  # what writing into a folder raises that is removed


class Keeping:
    """Keeps what is written while strangers' code runs, who may delete or change it, and puts it back in the end."""

    def __init__(self, store: Store) -> None:
        self._store = store
        whole = [
            path for path in store.folder.iterdir() if path.is_file() and not path.name.startswith((".", "shard-"))
        ]
        self._whole = {path.name: path.read_bytes() for path in whole}  # the manifest, and what was run
        # Without a buffer: a worker that is forked and closes it would write what is in there once more.
        where = None if is_bucket(store.folder) else store.folder
        self._copy: IO[bytes] = tempfile.TemporaryFile(dir=where, buffering=0)  # noqa: SIM115 -- closed by put_back; has no name there
        self._rows: dict[int, int] = {}
        _copies.add(self._copy)

    def write(self, shard: int, rows: Rows) -> None:
        """Write a shard as `Store.write` does; where somebody removes the folder meanwhile, in the end."""
        self._rows[shard] = self._copy.seek(0, os.SEEK_END)
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, rows, allow_pickle=False)
        left = buffer.getbuffer()
        while left:
            left = left[self._copy.write(left) :]
        try:
            self._make_folder()
            self._store.write(shard, rows)
        except BadRequest as error:
            if not isinstance(error.__cause__, _GONE):
                raise
        except _GONE:
            pass

    def put_back(self) -> None:
        """Write again what is not there any more as it was written."""
        store = self._store
        self._make_folder()
        for name, content in self._whole.items():
            path = store.folder / name
            if not path.is_file() or path.read_bytes() != content:
                write_atomically(path, content)
        for shard, at in self._rows.items():
            try:
                store.read(shard)
            except BadResults:
                self._copy.seek(at)
                store.write(shard, np.lib.format.read_array(self._copy, allow_pickle=False))
        self._copy.close()

    def _make_folder(self) -> None:
        folder = self._store.folder
        if is_bucket(folder):  # where there are no folders
            return
        if folder.exists() and not folder.is_dir():
            folder.unlink()
        folder.mkdir(parents=True, exist_ok=True)
