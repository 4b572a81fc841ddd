"""Compiling everything ahead of time leaves nothing to compile."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import parcours
from parcours.studies.compiling import PARTS, compile_all

ROOT = Path(parcours.__file__).parent


def test_the_parts_reach_every_module_that_holds_kernels() -> None:
    with_kernels = {
        "parcours." + ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in ROOT.rglob("*.py")
        if "\n@kernel\n" in path.read_text(encoding="utf-8")
    }
    script = "import sys\nfrom parcours.studies.compiling import PARTS\n"
    script += "for part in PARTS.values(): part()\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert len(with_kernels) > 40
    assert with_kernels <= set(done.stdout.split())


def test_every_part_is_told_once() -> None:
    told: list[tuple[str, int, int]] = []
    compile_all(2, lambda *one: told.append(one))
    assert {part for part, _, _ in told} == {"", *PARTS}
    assert [done for _, done, _ in told] == list(range(len(PARTS) + 1))
