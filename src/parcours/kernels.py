"""The one decorator for compiled inner loops, and the rule for where their machine code is kept.

Numba's disk cache looks only at the file a kernel stands in: it misses an edit in another file whose kernel was
inlined, and a change of compiler flags. So the cache lives in a folder named by a hash of every kernel source and of
the library versions; an edit anywhere starts a fresh folder, and stale machine code can never run.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numba
import numpy

F = TypeVar("F", bound=Callable[..., object])

Record = Any
"""A numpy record (or array of records) of a dtype that the kernel's docstring names; numba reads its fields by name."""

_PACKAGE = Path(__file__).parent


@functools.cache
def kernel_cache() -> Path:
    """Return the folder that holds the machine code of exactly these sources and libraries.

    It lies under PARCOURS_CACHE_DIR if that is set, else under XDG_CACHE_HOME or ~/.cache.
    """
    digest = hashlib.sha256()
    for version in (numba.__version__, llvmlite.__version__, numpy.__version__):
        digest.update(version.encode() + b"\0")
    packages = sorted(_PACKAGE.parent.glob(f"{_PACKAGE.name}*/"))  # those that came with this one
    for source in (path for package in packages for path in sorted(package.rglob("*.py"))):
        text = source.read_bytes()
        if b"kernel" in text or b"dtype" in text:
            digest.update(text + b"\0")
    home = os.environ.get("PARCOURS_CACHE_DIR")
    base = Path(home) if home else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parcours"
    return base / f"kernels-{digest.hexdigest()[:16]}"


numba.config.CACHE_DIR = str(kernel_cache())  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile `function` on first call: IEEE arithmetic only, no reassociation, cached on disk.

    The same inputs give the same bits on every machine: fastmath is off, and kernels take sin, cos, exp and the like
    from `elementary`, not from the machine's mathematics library.
    """
    # Nobody takes a kernel's address, and the wrapper for that is a tenth of compilation.
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": False,
        "cache": True,
        "nogil": True,
        "no_cfunc_wrapper": True,
    }
    return cast(F, numba.njit(**options)(function))


def is_warm() -> bool:
    """Return whether an earlier run has left compiled kernels for these very sources."""
    folder = kernel_cache()
    return folder.is_dir() and any(folder.rglob("*.nbc"))
