"""Runs components as nodes of a ROS 1 graph, and tests foreign nodes there; imports ROS packages late."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from functools import cache

from parcours.errors import HostFailure

_DISTRIBUTION = "/usr/bin/python3"
PACKAGES = "/usr/lib/python3/dist-packages"
"""Where Debian and Ubuntu keep Python packages; ROS's are among them, all of plain Python."""

if importlib.util.find_spec("genpy") is None and PACKAGES not in sys.path:
    sys.path.append(PACKAGES)  # behind all that this interpreter has itself


@cache
def interpreter_with(module: str) -> str:
    """Return a Python that imports `module` of ROS 1: this one, or else the distribution's own.

    Raises HostFailure if neither has it.

    >>> interpreter_with("json") == sys.executable
    True
    """
    found = importlib.util.find_spec(module)
    if found is not None and not (found.origin or "").startswith(PACKAGES):
        return sys.executable
    probe = [_DISTRIBUTION, "-c", f"import {module}"]
    try:
        if subprocess.run(probe, stderr=subprocess.DEVNULL, timeout=5.0, check=False).returncode == 0:
            return _DISTRIBUTION
    except (OSError, subprocess.TimeoutExpired):
        pass
    raise no_ros(module)


def no_ros(module: str) -> HostFailure:
    """Return the complaint that `module` of ROS 1 cannot be imported."""
    rule = f"must be importable, but neither {sys.executable} nor {_DISTRIBUTION} finds it"
    remedy = f"install python3-{module} (Debian, Ubuntu), and use an interpreter that sees it: .ci/ros1 makes one"
    return HostFailure(f"ROS 1 module {module!r}", rule, remedy, slug="no-ros1")
