"""Prints how many bytes a case of RAMP takes in a campaign's folder, and whether a bucket holds the bytes of a folder.

python bench/bench_storage.py [--cases 16384] [--bucket]

The bytes are those of shards and sums, beside the same records in one file of xz at its strongest. With --bucket, a
server that speaks S3 (pip install 'moto[server]' s3fs 'parcours[cloud]') gets the parking example from one run, from
two runs at once, and from a run that is killed and given again.
"""

from __future__ import annotations

import argparse
import lzma
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from parcours.run.campaign import run_campaign
from parcours.run.locations import location
from parcours_ramp.system.study import system_study

PARKING = Path(__file__).parents[1] / "examples" / "parking" / "study.yaml"
KEYS = {"AWS_ACCESS_KEY_ID": "none", "AWS_SECRET_ACCESS_KEY": "none", "AWS_DEFAULT_REGION": "us-east-1"}


def print_sizes(folder: Path, n_cases: int) -> None:
    study = system_study("original", seed=1)
    for size in (16, 64, 256, 1024, 4096):
        store = run_campaign(study, study.campaign(n_cases, size), folder / str(size), workers=2).store
        n_bytes = sum(path.stat().st_size for path in (folder / str(size)).glob("shard-*"))
        print(f"shards of {size:5d} cases: {n_bytes / n_cases:6.1f} bytes a case", flush=True)
    packed = lzma.compress(store.load().tobytes(), preset=9 | lzma.PRESET_EXTREME)
    print(f"all records in one file of xz -9e: {len(packed) / n_cases:.1f} bytes a case")


def shards(place: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in place.iterdir() if path.name.startswith("shard-")}


def print_bucket(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as line:
        port = line.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    os.environ |= KEYS | {"AWS_ENDPOINT_URL": address}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    server = subprocess.Popen([sys.executable, "-m", "moto.server", "-p", str(port)], **quiet)  # type: ignore[call-overload]
    try:
        _make_bucket(address)

        def run(out: str) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-m", "parcours", "run", str(PARKING), "--cases", "3000", "--out", out]
            return subprocess.Popen(command, start_new_session=True, **quiet)  # type: ignore[call-overload,no-any-return]

        run(str(folder / "home")).wait()
        at_home = shards(folder / "home")
        run("s3://parcours/one").wait()
        for process in [run("s3://parcours/two") for _ in range(2)]:
            process.wait()
        killed = run("s3://parcours/killed")
        while killed.poll() is None and not _begun("s3://parcours/killed"):
            time.sleep(0.05)
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
        found = len(shards(location("s3://parcours/killed")))
        run("s3://parcours/killed").wait()
        for name, words in ("one", "one run"), ("two", "two runs at once"), ("killed", f"killed at {found} files"):
            equal = "the bytes" if shards(location(f"s3://parcours/{name}")) == at_home else "NOT the bytes"
            print(f"{words}: {equal} of a folder, {len(at_home)} files", flush=True)
    finally:
        server.kill()
        server.wait()


def _make_bucket(address: str) -> None:
    import s3fs  # type: ignore[import-not-found,unused-ignore]

    for _ in range(600):
        try:
            s3fs.S3FileSystem(endpoint_url=address).mkdir("parcours")
            return
        except OSError:
            time.sleep(0.1)
    raise SystemExit("moto did not start: python -m moto.server")


def _begun(url: str) -> bool:
    place = location(url)
    return place.exists() and bool(shards(place))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=16384)
    parser.add_argument("--bucket", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.bucket:
            print_bucket(Path(folder))
        else:
            print_sizes(Path(folder), given.cases)


if __name__ == "__main__":
    main()
