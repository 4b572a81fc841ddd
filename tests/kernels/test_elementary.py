"""The elementary functions: near the mathematics library's, and the same bits whatever processor is compiled for."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.elementary import PI, TAU, atan2, exp, log, sin_cos, wrap

ABSOLUTE = 2.3e-16
"""One unit in the last place of 1: the most by which sin and cos may miss the library's."""

angles = st.floats(-1e5, 1e5, allow_nan=False)
edges = st.integers(-60_000, 60_000).map(lambda k: k * math.pi / 2)


@given(angles | edges)
def test_sine_and_cosine_are_the_library_s_to_the_last_place_of_one(x: float) -> None:
    s, c = sin_cos(x)
    assert abs(s - math.sin(x)) <= ABSOLUTE
    assert abs(c - math.cos(x)) <= ABSOLUTE


@given(st.floats(-1e-3, 1e-3, allow_nan=False))
def test_sine_of_small_angles_keeps_its_relative_precision(x: float) -> None:
    assert math.isclose(sin_cos(x)[0], math.sin(x), rel_tol=4e-16, abs_tol=5e-324)


sides = st.floats(1e-150, 1e150) | st.floats(-1e150, -1e-150)


@given(sides, sides)
def test_atan2_is_the_library_s_to_a_relative_4e_16(y: float, x: float) -> None:
    assert math.isclose(atan2(y, x), math.atan2(y, x), rel_tol=4e-16)


@pytest.mark.parametrize(
    ("y", "x", "angle"),
    [
        (0.0, 1.0, 0.0),
        (1.0, 0.0, PI / 2),
        (-1.0, 0.0, -PI / 2),
        (0.0, -1.0, PI),
        (-0.0, -1.0, PI),
        (0.0, 0.0, 0.0),
    ],
)
def test_atan2_on_the_axes_is_exact_and_never_minus_pi(y: float, x: float, angle: float) -> None:
    assert atan2(y, x) == angle


@given(st.floats(-690.0, 690.0))
def test_exp_is_the_library_s_to_a_relative_4e_16(x: float) -> None:
    assert math.isclose(exp(x), math.exp(x), rel_tol=4e-16)


@given(st.floats(1e-290, 1e290))
def test_log_is_the_library_s_to_a_relative_4e_16(x: float) -> None:
    assert math.isclose(log(x), math.log(x), rel_tol=4e-16, abs_tol=1e-17)


@given(st.floats(-300.0, 300.0))
def test_log_undoes_exp(x: float) -> None:
    assert math.isclose(log(exp(x)), x, rel_tol=1e-15, abs_tol=4e-16)


@given(angles)
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(x: float) -> None:
    wrapped = wrap(x)
    assert abs(wrapped) <= PI + 1e-11
    assert abs(math.remainder(wrapped - x, TAU)) < 2e-11


def test_wrap_takes_the_half_turn_to_its_lower_end_and_leaves_small_angles_alone() -> None:
    assert wrap(PI) == -PI
    assert wrap(-PI) == -PI
    assert [wrap(x) for x in (-3.0, -0.25, 0.0, 0.25, 3.0)] == [-3.0, -0.25, 0.0, 0.25, 3.0]


_PROGRAM = """
import hashlib, json, struct
from numba.core.registry import cpu_target
from parcours.elementary import atan2, exp, log, sin_cos, wrap
values = []
for k in range(-400, 400):
    x = k * 0.37 + 1e-3 * k * k
    values += [*sin_cos(x), atan2(x, 1.0 - k), exp(0.1 * k), log(1e-3 + abs(x)), wrap(x)]
digest = hashlib.sha256(struct.pack(f"<{len(values)}d", *values)).hexdigest()
_, name, features = cpu_target.target_context.codegen().magic_tuple()
print(json.dumps([digest, name, "+fma" in features]))
"""


def _digest(cache: Path, **environment: str) -> list[object]:
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        env={**os.environ, "PARCOURS_CACHE_DIR": str(cache), **environment},
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    answer: list[object] = json.loads(done.stdout)
    return answer


def test_every_processor_gives_the_same_bits(tmp_path: Path) -> None:
    here = _digest(tmp_path)
    # A processor's name alone keeps this machine's instruction sets: they are named too.
    generic = _digest(tmp_path, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    plain = _digest(tmp_path, NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="+sse2,-avx,-fma")
    haswell = _digest(tmp_path, NUMBA_CPU_NAME="haswell", NUMBA_CPU_FEATURES="+sse4.2,+avx,+avx2,+fma")
    assert [run[1:] for run in (generic, plain, haswell)] == [
        ["generic", False], ["x86-64", False], ["haswell", True],
    ]  # fmt: skip
    assert here[0] == generic[0] == plain[0] == haswell[0]
