"""Starts an interpreter that does not take a `types.py` of the working folder for Python's own."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from functools import partial

_VARIABLE = "PYTHONSAFEPATH"


@contextlib.contextmanager
def safe_path(run: Callable[..., None]) -> Iterator[Callable[..., None]]:
    """Leave the working folder off the path of interpreters that start meanwhile; yield what runs `run` in one."""
    if _VARIABLE in os.environ:
        yield run
        return
    os.environ[_VARIABLE] = "1"
    try:
        yield partial(_run, run)
    finally:
        del os.environ[_VARIABLE]


def _run(run: Callable[..., None], *arguments: object) -> None:
    os.environ.pop(_VARIABLE, None)  # what the worker starts is not our matter
    run(*arguments)
