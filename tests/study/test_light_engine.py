"""The engine tests a small study without the heavy libraries: only what needs them loads them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

LIFT = Path(__file__).parents[2] / "examples" / "lift"
HEAVY = ("numba", "llvmlite", "ortools", "matplotlib", "scipy", "pandas", "z3")
BLOCKER = f"""
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {HEAVY!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def _parcours(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program in an interpreter, and all that it starts, that lack the heavy libraries."""
    (folder / "sitecustomize.py").write_text(BLOCKER)
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "parcours", *map(str, arguments)]
    return subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("command", ["model check", "abtc", "suite", "run", "study check"])
def test_a_study_of_components_needs_none_of_them(tmp_path: Path, command: str) -> None:
    out = ["--out", tmp_path / "out"] if command in ("run", "suite") else []
    done = _parcours(tmp_path, *command.split(), LIFT, *out)
    assert done.returncode == 0, done.stdout + done.stderr


def test_its_results_are_shown_and_compared(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for arguments in (("run", LIFT, "--out", out), ("report", out), ("replay", out, "0"), ("compare", out, out)):
        done = _parcours(tmp_path, *arguments)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "arguments",
    [("run", "navigation", "--planner", "orca", "--out", "out"), ("data", "draw", LIFT, "--combine", "pairwise")],
)
def test_what_needs_one_says_so(tmp_path: Path, arguments: tuple[object, ...]) -> None:
    done = _parcours(tmp_path, *arguments)
    assert done.returncode == 2 and "it needs numba" in done.stderr and "[no-numba]" in done.stderr
