"""Where machine code is kept: a folder of exactly these sources, under the folder that was asked for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
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
    shutil.copytree(Path(parcours.__file__).parent, package / "parcours")
    before = _cache_of(package, tmp_path)
    assert before.parent == tmp_path
    assert _cache_of(package, tmp_path / "other").name == before.name
    plain = package / "parcours" / "filenames.py"
    plain.write_text(plain.read_text() + "# a remark\n")
    assert _cache_of(package, tmp_path) == before
    source = package / "parcours" / "streams.py"
    source.write_text(source.read_text() + "# a remark\n")
    assert _cache_of(package, tmp_path) != before


DRAWN = """
import warnings, numpy as np
from parcours import elementary, kernels, streams
warnings.simplefilter("error")

@kernels.kernel
def quotient(a, b):
    return a / b

stream = np.zeros(1, np.uint64)
streams.start(stream, np.uint64(2**64 - 5), np.uint64(3), np.uint64(9))
print(streams.lognormal(stream, 2.0, 0.3), streams.below(stream, 7), elementary.atan2(1.0, -3.0), elementary.log(10.0))
print(quotient(1.0, 0.0))
"""


def test_without_numba_kernels_give_the_same_results_and_nothing_is_to_be_compiled(tmp_path: Path) -> None:
    (tmp_path / "numba.py").write_text("raise ImportError('not here')\n")
    source = str(Path(parcours.__file__).parent.parent)
    said = []
    for path, is_compiled in ((source, True), (f"{tmp_path}{os.pathsep}{source}", False)):
        code = DRAWN + f"assert kernels.is_compiled() == {is_compiled} and (kernels.is_compiled() or kernels.is_warm())"
        script = tmp_path / "apart" / "script.py"  # whose folder comes first on the path
        script.parent.mkdir(exist_ok=True)
        script.write_text(code)
        done = subprocess.run(
            [sys.executable, str(script)], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True,
            check=True, timeout=300,
        )  # fmt: skip
        said.append(done.stdout)
    assert said[0] == said[1] and said[0].endswith("inf\n")


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


COLD = """
import numpy as np
from parcours import kernels, streams
told = []
kernels.tell_of_compiling(lambda: told.append("compiling"))
stream = np.zeros(1, np.uint64)
streams.start(stream, np.uint64(1), np.uint64(3), np.uint64(9))
streams.below(stream, 7)
print(kernels.is_warm(), told)
"""


def test_compiling_is_told_once_by_a_process_that_compiles_and_by_no_later_one(tmp_path: Path) -> None:
    assert [_run(COLD, tmp_path) for _ in range(2)] == ["True ['compiling']\n", "True []\n"]


def _run(code: str, home: Path) -> str:
    environment = {**os.environ, "PARCOURS_CACHE_DIR": str(home)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True, timeout=300
    )
    return done.stdout


WEEK = 7 * 24 * 3600
CALLED = "from parcours import kernels; print(kernels.is_compiled())"


def _made(folder: Path, age: float) -> Path:
    (folder / "streams_1").mkdir(parents=True)
    (folder / "streams_1" / "below.nbc").write_bytes(b"code")
    os.utime(folder, (time.time() - age,) * 2)
    return folder


def test_a_new_version_removes_what_others_have_kept_once_nobody_has_used_it_for_a_week(tmp_path: Path) -> None:
    old, recent = _made(tmp_path / f"kernels-{'0a' * 8}", WEEK + 60), _made(tmp_path / f"kernels-{'1b' * 8}", WEEK - 60)
    others = [_made(tmp_path / name, 9 * WEEK) for name in ("ros2", "kernels-of-mine", f"kernels-{'0a' * 9}")]
    (tmp_path / f"kernels-{'2c' * 8}").symlink_to(others[0])
    assert _run(CALLED, tmp_path) == "True\n"
    assert not old.exists()
    assert all(any(folder.rglob("*.nbc")) for folder in (recent, *others))


def test_what_is_used_now_counts_as_used_and_removes_nothing(tmp_path: Path) -> None:
    mine = _cache_of(Path(parcours.__file__).parent.parent, tmp_path)
    _made(mine, 2 * WEEK)
    old = _made(tmp_path / f"kernels-{'0a' * 8}", 2 * WEEK)
    assert _run(CALLED, tmp_path) == "True\n"
    assert time.time() - mine.stat().st_mtime < WEEK
    assert old.exists()


LATE = """
import shutil, numpy as np
from parcours import kernels, streams
stream = np.zeros(1, np.uint64)
streams.start(stream, np.uint64(1), np.uint64(3), np.uint64(9))
shutil.rmtree(kernels.kernel_cache())
print(streams.below(stream, 7), kernels.is_warm())
"""


def test_a_process_whose_folder_is_removed_compiles_again_what_it_misses(tmp_path: Path) -> None:
    kept, removed = _run(LATE.replace("shutil.rmtree", "print"), tmp_path / "a"), _run(LATE, tmp_path / "b")
    assert kept.splitlines()[-1] == removed.splitlines()[-1]
    assert removed.endswith("True\n")
    assert _run(LATE, tmp_path / "a") == removed, "a warm one, too"


def test_a_folder_that_cannot_be_made_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert _run(CALLED, tmp_path / "file" / "cache") == "True\n"
