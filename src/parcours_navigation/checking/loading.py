"""Finds the planner that is to be checked by its name, as campaigns find it."""

from __future__ import annotations

import importlib
import sys
from typing import NoReturn

from parcours.errors import BadRequest
from parcours_navigation.checking.subject import Subject
from parcours_navigation.guests.planners import SHIPPED, load_planner, source_digest

_ITS_OWN_FAULT = ("planner-raised", "planner-form")
"""Complaints of the loader that the battery reports as findings."""


def load_subject(name: str) -> Subject:
    """Return the subject of a check. Its module or file is read once, the planner made again each time.

    Args:
        name: a shipped planner's name, "package.module:Name", or "path/to/file.py:Name".

    Raises:
        BadRequest: the name leads nowhere, or the planner has no `observe`.

    >>> load_subject("stand-still").make() is load_subject("stand-still").make()
    False
    """
    try:
        load_planner(name)
    except BadRequest as complaint:
        if complaint.slug in _ITS_OWN_FAULT:
            return Subject(name, lambda complaint=complaint: _raise(complaint))  # type: ignore[misc]
        raise
    where, _, dotted = SHIPPED.get(name, name).rpartition(":")
    kept = sys.modules.get(f"parcours_planner_{source_digest(name)}")
    found: object = kept if kept is not None else importlib.import_module(where)
    for part in dotted.split("."):
        found = getattr(found, part)
    return Subject(name, found if isinstance(found, type) else lambda: found)


def _raise(complaint: BadRequest) -> NoReturn:
    raise complaint
