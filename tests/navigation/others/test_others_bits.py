"""The same bits on every processor and without a compiler: all kinds of others, all kinds of robots."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_PROGRAM = """
import sys
if sys.argv[1] == "plain":
    sys.modules["numba"] = None
import hashlib
from dataclasses import replace
import numpy as np
from parcours.kernels import is_compiled
from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import (
    ConstantVelocity,
    OrcaPeople,
    RandomWalk,
    Recorded,
    SocialForcePeople,
    Waypoints,
)
from parcours_navigation.others.tracks import Tracks
from parcours_navigation.robots.body import command_body
from parcours_navigation.robots.driving import drive_body
from parcours_navigation.robots.kinds import PRESETS, Odometry

some = {"area": (0.5, 0.5, 8.5, 8.5), "radius": 0.2}
others = [
    Others(SocialForcePeople(), number=10, group=3, **some), Others(OrcaPeople(), number=10, **some),
    Others(RandomWalk(between=(0.1, 0.3)), number=3, **some), Others(ConstantVelocity(), number=9, **some),
    Others(Waypoints(((1.0, 1.0), (2.0, 2.0), (2.0, 1.0))), number=2, radius=0.2),
    Others(Recorded(Tracks(("a",), (np.array([[0.0, 1.0, 1.0], [1.0, 2.0, 2.0]]),)))),
]
walls = np.array([[0, 0, 9, 0], [9, 0, 9, 9], [9, 9, 0, 9], [0, 9, 0, 0], [4, 3, 4, 6]], np.float64)
crowd = drawn(others, 1, 0)
begin_agents(crowd.agents, crowd.ways, crowd.obstacles, walls)
for k in range(1, int(sys.argv[2]) + 1):
    step_agents(crowd.agents, crowd.ways, crowd.obstacles, walls, 4.0, 4.0, 0.3, 0.0, 0.3, k * 10_000_000, 0.01)
digest = hashlib.sha256(crowd.obstacles.tobytes() + crowd.agents.tobytes())
for preset in PRESETS.values():
    body = replace(preset, delay=0.05, odometry=Odometry(0.01, 0.01, 0.02, 0.03, 0.04)).record(0.0, 0.0, 0.3, seed=1)
    for k in range(100):
        command_body(body, 0.2, 0.1, 1.0 - 0.02 * k)
        drive_body(body, 0.01)
    digest.update(body.tobytes())
how = "plain"
if is_compiled():
    from numba.core.registry import cpu_target
    how = cpu_target.target_context.codegen().magic_tuple()[1]
print(digest.hexdigest(), how)
"""


def _digest(how: str, ticks: int, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, how, str(ticks)],
        env={**os.environ, **environment}, capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    return done.stdout.split()


def test_this_processor_one_without_vector_extensions_and_plain_python_give_the_same_bits(tmp_path: Path) -> None:
    # For the other one without the optimiser, as written: nothing fused, nothing reordered.
    other = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2,-avx,-fma", "NUMBA_OPT": "0"}
    other["PARCOURS_CACHE_DIR"] = str(tmp_path)
    [here, named], [there, plain] = _digest("c", 1000), _digest("c", 1000, **other)
    assert here == there and plain == "x86-64" != named
    assert _digest("plain", 60)[0] == _digest("c", 60)[0]
