"""Bindings of files, with a change here and there."""

from __future__ import annotations

from pathlib import Path

from parcours.run.binding import Binding, parse_binding


def edited(path: Path, *changes: tuple[str, str]) -> str:
    """Return the text of a file in which each change has been made."""
    text = path.read_text(encoding="utf-8")
    for given, instead in changes:
        assert given in text
        text = text.replace(given, instead)
    return text


def bound(path: Path, *changes: tuple[str, str]) -> Binding:
    """Return the binding of that text."""
    return parse_binding(edited(path, *changes), str(path))
