"""Two modules of kernels run through NVIDIA Warp's CPU backend: the same bytes, so a port to a GPU is possible."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import warp as wp

from parcours import elementary
from parcours_navigation.others import half_planes
from warp_port import ported

N, PLANES = 20_000, 12

FUNCTIONS = """
@wp.kernel
def functions(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), out: wp.array2d(dtype=wp.float64)):
    i = wp.tid()
    s, c = sin_cos(x[i])
    out[i, 0] = s
    out[i, 1] = c
    out[i, 2] = atan2(y[i], x[i])
    out[i, 3] = wrap(x[i])
    out[i, 4] = exp(y[i])
    out[i, 5] = log(wp.abs(x[i]) + wp.float64(1e-9))
"""

VELOCITIES = """
@wp.kernel
def velocities(
    given: wp.array3d(dtype=wp.float64), want: wp.array2d(dtype=wp.float64), planes: wp.array3d(dtype=wp.float64),
    scratch: wp.array3d(dtype=wp.float64), out: wp.array2d(dtype=wp.float64)
):
    i = wp.tid()
    n = given.shape[1]
    for k in range(n):
        row = given[i, k]
        if k < 3:
            nx, ny, b = wall_plane(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7])
            planes[i, k, 0] = nx
            planes[i, k, 1] = ny
            planes[i, k, 2] = b
        else:
            ux, uy, mx, my = half_plane(row[0], row[1], row[2], row[3], row[4], row[5], row[6])
            planes[i, k, 0] = mx
            planes[i, k, 1] = my
            planes[i, k, 2] = (row[6] + ux) * mx + (row[7] + uy) * my
    x, y = new_velocity(planes[i], scratch[i], n, 3, want[i, 0], want[i, 1], want[i, 2])
    out[i, 0] = x
    out[i, 1] = y
"""


def _angles() -> tuple[np.ndarray, np.ndarray]:
    """Return numbers over the ranges of the functions, with zeros, ends of quadrants and very small ones among them."""
    draw = np.random.default_rng(1)
    x, y = draw.uniform(-1e3, 1e3, N), draw.uniform(-50.0, 50.0, N)
    x[:4], y[:4] = (0.0, -0.0, np.pi, 1e-300), (0.0, 1.0, -np.pi / 2, -1e-300)
    x[4:5000] = draw.integers(-400, 400, 4996) * (np.pi / 8)
    return x, y


def _scenes() -> tuple[np.ndarray, np.ndarray]:
    """Return bodies and walls round a robot, and what it wants: many overlap it, so that no velocity is permitted."""
    draw = np.random.default_rng(2)
    given = draw.uniform(-2.0, 2.0, (N, PLANES, 8))
    given[..., 4] = draw.uniform(0.05, 0.8, (N, PLANES))
    given[..., 5:7] = draw.uniform(0.2, 5.0, (N, PLANES, 2))
    want = draw.uniform(-1.0, 1.0, (N, 3))
    want[:, 2] = draw.uniform(0.1, 1.5, N)
    return given, want


def _ours(given: np.ndarray, want: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the velocities that our kernels choose, and how often none is permitted."""
    planes, scratch, out, none = np.empty((PLANES, 3)), np.empty((PLANES, 3)), np.empty((N, 2)), 0
    for i in range(N):
        for k, row in enumerate(given[i]):
            if k < 3:
                planes[k] = half_planes.wall_plane(*row)
            else:
                ux, uy, mx, my = half_planes.half_plane(*row[:7])
                planes[k] = mx, my, (row[6] + ux) * mx + (row[7] + uy) * my
        x, y, top = want[i]
        none += half_planes.nearest_permitted(planes, PLANES, top, x, y, False)[0] < PLANES
        out[i] = half_planes.new_velocity(planes, scratch, PLANES, 3, x, y, top)
    return out, none


def _launch(kernel: object, given: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    arrays: list[object] = [wp.array(each, dtype=wp.float64, device="cpu") for each in given]
    out = wp.zeros(shape, dtype=wp.float64, device="cpu")
    wp.launch(kernel, dim=shape[0], inputs=[*arrays, out], device="cpu")
    return np.asarray(out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("warp")
    wp.config.kernel_cache_dir = str(made / "cache")
    return made


@pytest.fixture(scope="module")
def plain(folder: Path) -> ModuleType:
    return ported([elementary, half_planes], FUNCTIONS + VELOCITIES, folder / "plain.py")


def test_elementary_functions_have_the_same_bits(plain: ModuleType) -> None:
    x, y = _angles()
    ours = np.array([
        (*elementary.sin_cos(a), elementary.atan2(b, a), elementary.wrap(a), elementary.exp(b),
         elementary.log(abs(a) + 1e-9))
        for a, b in zip(x.tolist(), y.tolist(), strict=True)
    ])  # fmt: skip
    assert _launch(plain.functions, [x, y], ours.shape).tobytes() == ours.tobytes()


def test_velocities_among_bodies_and_walls_have_the_same_bits(plain: ModuleType) -> None:
    given, want = _scenes()
    ours, none = _ours(given, want)
    memory = [np.zeros((N, PLANES, 3)), np.zeros((N, PLANES, 3))]
    assert _launch(plain.velocities, [given, want, *memory], ours.shape).tobytes() == ours.tobytes()
    assert 0.1 * N < none < 0.99 * N  # both programs, of two and of three dimensions, were run


def test_a_product_and_a_sum_that_are_rounded_once_would_be_seen(folder: Path) -> None:
    x, y = _angles()
    fused, plain = (
        ported([elementary], FUNCTIONS, folder / f"{name}.py", fused=name == "fused") for name in ("fused", "apart")
    )
    assert _launch(fused.functions, [x, y], (N, 6)).tobytes() != _launch(plain.functions, [x, y], (N, 6)).tobytes()
