"""Abstract cases on nodes of ROS 2 beside processes that never rest: whatever the load, no verdict may be false.

python bench/bench_load.py --busy 20 --seconds 120

In an interpreter that has rclpy, and in a network of its own (.ci/ros2 shows how). The nodes do what their model says,
so each case is to pass, or to be inconclusive with a reason. Exit code 1 if one fails.
"""

from __future__ import annotations

import argparse
import itertools
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from parcours.errors import HostFailure
from parcours.run.binding import read_binding
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.running import ForeignStudy

BINDING = Path(__file__).parents[1] / "examples" / "ros2_python" / "binding.yaml"


def verdicts(seconds: float, folder: Path) -> Counter[Verdict]:
    """Run case after case for that long, print what did not pass and why, and count the verdicts."""
    binding, found = read_binding(BINDING), Counter[Verdict]()
    ids = [scene.id for scene in itertools.islice(abstract_scenes(binding, 1), 200)]
    until = time.monotonic() + seconds
    for id in itertools.cycle(ids):
        if time.monotonic() > until:
            return found
        try:
            with ForeignHost(binding, folder / "nodes") as host:
                [result] = ForeignStudy(host, ProcessOrder(str(BINDING), str(folder), abstract=(id,))).run()
        except HostFailure as error:  # a node did not come up in its time: no verdict at all
            found[Verdict.INCONCLUSIVE] += 1
            print(f"{id}: not run: {error}"[:200], flush=True)
            continue
        judgement = result.judged.judgement
        found[judgement.verdict] += 1
        if not judgement.passed:
            print(f"{id}: {judgement.verdict}: {judgement.why}"[:200], flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--busy", type=int, default=20, help="processes that never rest")
    parser.add_argument("--seconds", type=float, default=120.0)
    given = parser.parse_args()
    os.environ["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    busy = [subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"]) for _ in range(given.busy)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            found = verdicts(given.seconds, Path(folder))
    finally:
        for process in busy:
            process.kill()
            process.wait()
    print(f"{given.busy} busy processes, load {os.getloadavg()[0]:.1f}: {found.total()} cases, "
          + ", ".join(f"{count} {verdict}" for verdict, count in found.items()))  # fmt: skip
    sys.exit(found[Verdict.FAIL] > 0)


if __name__ == "__main__":
    main()
