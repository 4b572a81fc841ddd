"""Results that an earlier version wrote -> the same results as this version keeps them, in their folder."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np

from parcours.errors import BadResults
from parcours.run.manifest import FORMER, read_manifest, write_manifest
from parcours.run.stops import STOP, Stop
from parcours.run.store import Rows, Store, open_results
from parcours.run.sums import damaged, summed


def convert(folder: Path) -> Store:
    """Write the shards of a folder as this version does, remove the former ones, and return the store.

    Killed at any time, it goes on where it was when it is called again.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds no campaign, or a shard of it is damaged.
    """
    # former manifest, former shards ─► new shards beside them ─► new manifest ─► former shards removed
    try:
        store = Store(folder, read_manifest(folder, FORMER))
    except BadResults as error:
        if error.slug != "results-version":
            raise
        store = open_results(folder)
    else:
        for shard in store.campaign.shards:
            former = _former(store, shard)
            if _noted(former).exists():
                store.write(shard, _read(store, shard, former))
        if (folder / STOP).exists():
            noted = json.loads((folder / STOP).read_bytes())
            Stop(tuple(noted["rules"]), noted["first"], noted["cases"]).write(folder, store.campaign)
        write_manifest(folder, store.campaign)
    for shard in store.campaign.shards:
        former = _former(store, shard)
        for path in (_noted(former), former):
            path.unlink(missing_ok=True)
    return store


def _former(store: Store, shard: int) -> Path:
    return store.path(shard).with_suffix(".npy")


def _noted(path: Path) -> Path:
    return path.with_name(path.name + ".sha256")


def _read(store: Store, shard: int, path: Path) -> Rows:
    rule = f"must hold {len(store.campaign.cases(shard))} records of the manifest's dtype"
    try:
        rows: Rows = np.load(io.BytesIO(summed(path)), allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise damaged(path, f"{rule}, but: {error}") from error
    if rows.shape != (len(store.campaign.cases(shard)),) or rows.dtype != store.campaign.dtype:
        raise damaged(path, f"{rule}, but holds {rows.shape}")
    return rows
