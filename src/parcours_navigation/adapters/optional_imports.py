"""Imports a package that is only installed with the extra `adapters`, or says how to get it."""

from __future__ import annotations

import importlib
from typing import Any

from parcours.errors import BadRequest


def imported(module: str, package: str) -> Any:
    """Return a module of a package.

    Raises BadRequest if it is not installed.

    >>> imported("no_such.thing", "no-such")
    Traceback (most recent call last):
    parcours.errors.BadRequest: no_such.thing: it needs the package no-such, which is not installed; \
pip install 'parcours[adapters]' [no-adapter]
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        rule = f"it needs the package {package}, which is not installed"
        raise BadRequest(module, rule, "pip install 'parcours[adapters]'", slug="no-adapter") from error
