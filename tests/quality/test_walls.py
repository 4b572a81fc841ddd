"""Walls that import contracts cannot see: no package names what is built on it, not in a string or a comment either."""

from __future__ import annotations

import re
from importlib.metadata import entry_points
from pathlib import Path

import pytest

import parcours
from parcours_navigation.guests.planners import names

SOURCES = Path(parcours.__file__).parents[1]
ABOVE = {
    "parcours": ("parcours_navigation", "parcours_ramp", "parcours_formats", "ramp", *names()),
    "parcours_formats": ("parcours_navigation", "parcours_ramp", "ramp", *names()),
    "parcours_navigation": ("parcours_ramp", "parcours_formats", "ramp"),
}


@pytest.mark.parametrize("package", ABOVE)
def test_no_package_names_what_is_built_on_it(package: str) -> None:
    studies = [entry.name for entry in entry_points(group="parcours.studies") if not entry.value.startswith(package)]
    words = re.compile(rf"\b({'|'.join(map(re.escape, [*ABOVE[package], *studies]))})\b", re.IGNORECASE)
    named = [
        f"{path.relative_to(SOURCES)}:{number}: {found[0]}"
        for path in sorted((SOURCES / package).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if (found := words.search(line))
    ]
    assert named == []


def test_every_package_is_held_to_it() -> None:
    assert {*ABOVE, "parcours_ramp"} == {
        path.name for path in SOURCES.glob("parcours*") if (path / "py.typed").exists()
    }
