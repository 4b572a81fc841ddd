"""A finished campaign in many small shards -> the same results in few large ones, in a folder of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from parcours.errors import BadRequest
from parcours.run.atomic import write_atomically
from parcours.run.claiming import claimed
from parcours.run.locations import names_in
from parcours.run.manifest import MANIFEST
from parcours.run.stops import STOP
from parcours.run.store import Store, create, open_results

LEAST = 122_880  # rows of a shard: those of a row group of DuckDB's own files


def merge(folder: Path, out: Path) -> Store:
    """Write what a campaign's folder holds into another one, in shards of at least LEAST cases.

    Whatever else lies in the folder comes with them. A campaign that a rule has ended becomes one of as many cases.
    Killed at any time, it goes on where it was when it is called again.

    Raises:
        BadRequest: the folder cannot be written to, or both are the same.
        BadResults: shards are missing or damaged, or the other folder holds something else.
    """
    # shard 0 │ shard 1 │ ... │ shard 479   of 256 cases each  ─►  shard 0   of 122 880
    store = open_results(folder)
    store.require_finished()
    if folder.absolute() == out.absolute():
        raise BadRequest(
            "--merge", "a campaign is merged into another folder, but its own is given", slug="merge-folder"
        )
    small = store.campaign
    together = -(-LEAST // small.shard_size)
    merged = create(out, replace(small, n_cases=store.planned, shard_size=together * small.shard_size))
    with claimed(out):
        _fill(store, merged, together)
    return merged


def _fill(store: Store, merged: Store, together: int) -> None:
    for shard in merged.missing():
        parts = range(shard * together, min((shard + 1) * together, len(store.shards)))
        merged.write(shard, np.concatenate([store.read(part) for part in parts]))
    for name in names_in(store.folder):
        path = store.folder / name
        if not name.startswith(("shard-", ".")) and name not in (MANIFEST, STOP) and path.is_file():
            write_atomically(merged.folder / name, path.read_bytes())
