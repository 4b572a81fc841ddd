"""Compiling everything ahead of time leaves nothing to compile."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import parcours
from parcours.compiling import compile_all, parts

ROOT = Path(parcours.__file__).parent.parent


def test_the_parts_reach_every_module_that_holds_kernels() -> None:
    with_kernels = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in ROOT.glob("parcours*/**/*.py")
        if "\n@kernel\n" in path.read_text(encoding="utf-8")
    }
    script = "import sys\nfrom parcours.compiling import parts\n"
    script += "for part in parts().values(): part.run()\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert len(with_kernels) > 40
    assert with_kernels <= set(done.stdout.split())


def test_every_part_is_told_once() -> None:
    told: list[tuple[str, int, int]] = []
    compile_all(2, lambda *one: told.append(one))
    assert {part for part, _, _ in told} == {"", *parts()}
    assert [done for _, done, _ in told] == list(range(len(parts()) + 1))
