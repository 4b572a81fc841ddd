"""Prints how long after a shard's rename the studio's page has its event, over campaigns of small and of large shards.

python bench/bench_studio.py [--study ramp_system] [--cases 256]
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/support"))

from parcours.run.manifest import MANIFEST
from parcours.run.store import create, open_results
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from studio_server import Server, events, start

SIZES = ((64, 40), (1024, 40), (8192, 20))  # cases a shard, shards


def watched(server: Server, seen: Path, size: int, shards: int) -> tuple[list[float], float]:
    """Return how long each shard took from its rename to the client [s], and the server's processor time a shard [s].

    The campaign has the cases of a short run over and over.
    """
    rows = open_results(seen).load()
    campaign = replace(open_results(seen).campaign, n_cases=size * shards, shard_size=size)
    whole, name = create(server.root / f"whole-{size}", campaign), f"growing-{size}"
    for shard in range(shards):
        tiled = np.resize(rows, size)
        tiled["number"] = campaign.cases(shard)
        whole.write(shard, tiled)
    growing = create(server.root / name, campaign)
    (growing.folder / "run.json").write_bytes((seen / "run.json").read_bytes())
    (growing.folder / MANIFEST).write_bytes((whole.folder / MANIFEST).read_bytes())
    rng, took = np.random.default_rng(1), []
    stream = events(server, name)
    next(stream)
    before = _processor_time(server.process.pid)
    for shard in range(shards):
        path = growing.path(shard)
        os.link(whole.path(shard), path)
        ready = path.with_name(".ready")
        os.link(f"{whole.path(shard)}.sha256", ready)
        time.sleep(rng.uniform(0.0, 0.15))
        ready.rename(f"{path}.sha256")
        since = time.perf_counter()
        told = next(stream)
        assert told.get("finished") == (shard + 1) * size, told
        took.append(time.perf_counter() - since)
    spent = (_processor_time(server.process.pid) - before) / shards
    stream.close()
    return took, spent


def _processor_time(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--study", default="ramp_system", help="a registered study that keeps its cases in shards")
    parser.add_argument("--cases", type=int, default=256, help="cases of it that are run")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as root:
        study, seen = find(given.study), Path(root, "seen")
        study.run(Request(settings_of(study.parameters, {}, given.study), 1, seen, given.cases), lambda *_: None)
        server = start(Path(root))
        try:
            print("cases a shard  shards  kB a shard  median [ms]  p99 [ms]  largest [ms]  processor [ms a shard]")
            for size, shards in SIZES:
                took, spent = watched(server, seen, size, shards)
                weight = (Path(root) / f"whole-{size}" / "shard-000000.parquet").stat().st_size / 1e3
                median, p99, most = 1e3 * np.quantile(took, [0.5, 0.99, 1.0])
                print(f"{size:13} {shards:7} {weight:11.0f} {median:12.0f} {p99:9.0f} {most:13.0f} {1e3 * spent:23.0f}")
        finally:
            server.process.send_signal(signal.SIGTERM)
            server.process.wait(10)


if __name__ == "__main__":
    main()
