"""Says where results come from: when they were made, from which commit, on what machine, with which versions."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("parcours", "numpy", "numba", "scipy")
_PATIENCE = 5.0  # for git [s]
_LONGEST = 200  # characters of a value that are kept


def provenance(where: Path | None = None) -> dict[str, str]:
    """Return what a reader needs to judge results by, made now: date, commit, machine, versions.

    Args:
        where: a file or folder of what is tested; the current folder if None. Outside git it has no commit.
    """
    found = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": _commit(where or Path.cwd()),
        "machine": _machine(),
        "versions": ", ".join(f"{name} {found}" for name in _PACKAGES if (found := _version(name)))
        + f", Python {platform.python_version()}",
    }
    return {name: text for name, text in found.items() if text}


def texts(kept: object) -> dict[str, str]:
    """Return what was kept of `provenance`, whatever a file holds in its place.

    >>> texts({"date": "2026-01-01", "machine": 3}), texts(None)
    ({'date': '2026-01-01'}, {})
    """
    if not isinstance(kept, Mapping):
        return {}
    return {
        name: kept[name][:_LONGEST]
        for name in ("date", "commit", "machine", "versions")
        if isinstance(kept.get(name), str)
    }


def _commit(where: Path) -> str:
    """Return the commit of a folder's working tree, with `-dirty` if it has changes; empty if there is none."""
    folder = where if where.is_dir() else where.parent
    command = ["git", "-C", str(folder), "-c", "core.fsmonitor=false", "describe", "--always", "--dirty", "--exclude=*"]
    try:
        ran = subprocess.run(
            command, capture_output=True, timeout=_PATIENCE, check=True, text=True, env=os.environ | {"LC_ALL": "C"}
        )
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return ""
    return ran.stdout.strip()


def _machine() -> str:
    processor = platform.machine()
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as file:
            named = (line.partition(":")[2].strip() for line in file if line.startswith("model name"))
            processor = next(named, processor)
    except OSError:
        pass
    return f"{processor}, {os.cpu_count()} processors, {platform.system()} {platform.release()}"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
