"""The one decorator for compiled inner loops, and the rule for where their machine code is kept.

Numba's disk cache looks only at the file a kernel stands in: it misses an edit in another file whose kernel was
inlined, and a change of compiler flags. So the cache lives in a folder named by a hash of every kernel source and of
the library versions; an edit anywhere starts a fresh folder, and stale machine code can never run.

Without numba, kernels run as plain Python: the same results, slowly.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from parcours.errors import BadRequest

try:
    import numba
except ImportError:
    numba = None  # type: ignore[assignment]

F = TypeVar("F", bound=Callable[..., object])

Record = Any
"""A numpy record (or array of records) of a dtype that the kernel's docstring names; numba reads its fields by name."""

IS_COMPILED = numba is not None
"""Whether kernels are compiled on this machine."""

_PACKAGE = Path(__file__).parent


@functools.cache
def kernel_cache() -> Path:
    """Return the folder that holds the machine code of exactly these sources and libraries; nothing without numba.

    It lies under PARCOURS_CACHE_DIR if that is set, else under XDG_CACHE_HOME or ~/.cache.
    """
    digest = hashlib.sha256()
    for library in ("numba", "llvmlite", "numpy") if IS_COMPILED else ():
        digest.update(version(library).encode() + b"\0")
    packages = sorted(_PACKAGE.parent.glob(f"{_PACKAGE.name}*/"))  # those that came with this one
    for source in (path for package in packages for path in sorted(package.rglob("*.py"))):
        text = source.read_bytes()
        if b"kernel" in text or b"dtype" in text:
            digest.update(text + b"\0")
    home = os.environ.get("PARCOURS_CACHE_DIR")
    base = Path(home) if home else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parcours"
    return base / f"kernels-{digest.hexdigest()[:16]}"


if IS_COMPILED:
    numba.config.CACHE_DIR = str(kernel_cache())  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile `function` on first call: IEEE arithmetic only, no reassociation, cached on disk.

    The same inputs give the same bits on every machine: fastmath is off, and kernels take sin, cos, exp and the like
    from `elementary`, not from the machine's mathematics library.
    """
    if not IS_COMPILED:
        return _plain(function)
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "cache": True, "nogil": True}
    options["no_cfunc_wrapper"] = True  # nobody takes a kernel's address, and that wrapper is a tenth of compilation
    return cast(F, numba.njit(**options)(function))


def _plain(function: F) -> F:
    """Return the function with the arithmetic of compiled code: words wrap, and x / 0 is infinite."""

    @functools.wraps(function)
    def run(*arguments: object) -> object:
        # Floats of Python would raise where IEEE 754 has a value.
        given = (np.float64(each) if type(each) is float else each for each in arguments)
        with np.errstate(all="ignore"):
            return _own(function(*given))

    return cast(F, run)


def _own(result: object) -> object:
    """Return Python's own numbers in place of those of numpy, as compiled code does; words of 64 bits stay."""
    if isinstance(result, tuple) and type(result) is tuple:
        return tuple(map(_own, result))
    return result.item() if isinstance(result, np.generic) and not isinstance(result, np.uint64) else result


def require_numba(what: str) -> None:
    """Raise BadRequest unless kernels are compiled: for what plain Python cannot do, or not in time."""
    if not IS_COMPILED:
        raise BadRequest(what, "it needs numba, which is not installed", "pip install numba", slug="no-numba")


def is_warm() -> bool:
    """Return whether an earlier run has compiled these very sources, or there is no numba to compile them."""
    folder = kernel_cache()
    return not IS_COMPILED or (folder.is_dir() and any(folder.rglob("*.nbc")))
