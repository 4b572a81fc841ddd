"""What is kept while strangers' code runs is what was written, whoever is forked meanwhile."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np

from parcours.run.folder_backup import Keeping
from parcours.run.store import Campaign, create


def test_results_that_are_removed_are_put_back_though_workers_were_forked_between_two_shards(tmp_path: Path) -> None:
    campaign = Campaign("toy", "plain", 1, 24, np.dtype([("number", "i8"), ("x", "f8", (80,))]), shard_size=3)
    store = create(tmp_path / "results", campaign)
    keeping = Keeping(store)
    for shard in campaign.shards:
        rows = np.zeros(3, campaign.dtype)
        rows["number"] = campaign.cases(shard)
        keeping.write(shard, rows)
        size = os.fstat(keeping._copy.fileno()).st_size
        if not (child := os.fork()):
            os._exit(0)  # it has closed the copy
        os.waitpid(child, 0)
        assert os.fstat(keeping._copy.fileno()).st_size == size, "what was not on the disk yet, the child wrote, too"
    shutil.rmtree(store.folder)
    keeping.put_back()
    assert store.load()["number"].tolist() == list(range(24))
