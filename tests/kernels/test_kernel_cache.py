"""Where machine code is kept: a folder of exactly these sources, under the folder that was asked for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import parcours
from parcours.kernels import kernel


def _cache_of(package: Path, home: Path) -> Path:
    done = subprocess.run(
        [sys.executable, "-c", "from parcours.kernels import kernel_cache; print(kernel_cache())"],
        env={**os.environ, "PYTHONPATH": str(package), "PARCOURS_CACHE_DIR": str(home)},
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    return Path(done.stdout.strip())


def test_an_edit_of_any_kernel_source_starts_a_fresh_folder_and_an_edit_elsewhere_does_not(
    tmp_path: Path,
) -> None:
    package = tmp_path / "copy"
    for room in ("parcours", "parcours_ramp"):
        shutil.copytree(Path(parcours.__file__).parents[1] / room, package / room)
    before = _cache_of(package, tmp_path)
    assert before.parent == tmp_path
    assert _cache_of(package, tmp_path / "other").name == before.name
    plain = package / "parcours" / "suite" / "__init__.py"
    plain.write_text(plain.read_text() + "# a remark\n")
    assert _cache_of(package, tmp_path) == before
    source = package / "parcours_ramp" / "planner" / "profile.py"
    source.write_text(source.read_text() + "# a remark\n")
    assert _cache_of(package, tmp_path) != before


@kernel
def _sum_in_order(a: float, b: float, c: float) -> float:
    return (a + b) + c


@kernel
def _product_and_sum(a: float, b: float, c: float) -> float:
    return a * b + c


def test_kernels_neither_reorder_sums_nor_fuse_products_into_them() -> None:
    assert _sum_in_order(1e16, -1e16, 1.0) == 1.0
    assert _sum_in_order(1.0, 1e16, -1e16) == 0.0
    a = 1.0 + 2.0**-30
    assert _product_and_sum(a, a, -(a * a)) == 0.0  # fused, the rounding of a * a would be left over: 2**-60


@kernel
def _quotient(a: float, b: float) -> float:
    return a / b


def test_division_by_zero_in_a_kernel_gives_infinity_as_ieee_754_says() -> None:
    assert _quotient(1.0, 0.0) == float("inf")
