"""Compiling everything ahead of time leaves nothing to compile."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

import parcours
from parcours import compiling
from parcours.compiling import CompiledPart, compile_all, parts

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


def test_a_process_that_compiles_clears_nothing_when_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # What it keeps would write a file if it were cleared.
    part = f"""
import builtins, pathlib
class Kept:
    def __del__(self, write=pathlib.Path.write_text, path=pathlib.Path({str(tmp_path)!r})):
        write(path / "cleared", "")
builtins.kept = Kept()
pathlib.Path({str(tmp_path / "run")!r}).write_text("")
"""
    monkeypatch.setattr(compiling, "parts", lambda: {"one": CompiledPart(partial(exec, part, {}), 0.0)})
    compile_all(1)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
