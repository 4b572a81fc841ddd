"""What a check found: how grave it is, what was seen, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class OutOfPatience(BaseException):
    """A check took too long; no Exception, so that a planner cannot catch it by mistake."""


class Level(StrEnum):
    """How grave a finding is, gravest first."""

    ERROR = "error"
    """The planner breaks the protocol, or cannot do its task."""
    WARNING = "warning"
    """It can be run, but its results will mislead or surprise."""
    NOTE = "note"
    """Worth knowing; nothing is wrong."""


@dataclass(frozen=True, slots=True)
class Remark:
    """One thing that a check found."""

    slug: str  # names the kind of finding; the same for the same fault
    level: Level  # how grave it is
    seen: str  # what was observed, with numbers
    remedy: str = ""  # what to do; may be empty for a note
    check: str = ""  # name of the check that found it, filled in by the battery


def error(slug: str, seen: str, remedy: str) -> Remark:
    """Return a remark of level error."""
    return Remark(slug, Level.ERROR, seen, remedy)


def warning(slug: str, seen: str, remedy: str) -> Remark:
    """Return a remark of level warning."""
    return Remark(slug, Level.WARNING, seen, remedy)


def note(slug: str, seen: str, remedy: str = "") -> Remark:
    """Return a remark of level note."""
    return Remark(slug, Level.NOTE, seen, remedy)
