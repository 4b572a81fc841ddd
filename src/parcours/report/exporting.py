"""Turns the replay on a page into files for other tools, and pages on one case into one page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from parcours.errors import BadRequest
from parcours.report.pieces import Animation, Figure, Page, Section
from parcours.report.writing import write_text
from parcours.run.atomic import replacing

_VARIABLE = re.compile(r"var\(--[\w-]+, (#[0-9a-fA-F]{3,8})\)")


def export(page: Page, path: Path) -> None:
    """Write what a page plays or draws first: a still picture (.svg), or a format that its recording offers.

    Raises BadRequest: the page has nothing of that kind, or the file cannot be written.
    """
    pieces = [piece for section in page.sections for piece in section.pieces]
    found = next((one for one in pieces if isinstance(one, Animation)), None)
    drawing = found.still if found else next((one.svg for one in pieces if isinstance(one, Figure)), "")
    exports = found.exports if found else {}
    kind = path.suffix.lower()
    if kind == ".svg" and drawing:
        write_text(path, _VARIABLE.sub(r"\1", drawing))  # colours of the page's theme mean nothing elsewhere
    elif kind in exports:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            exports[kind](partial)
    else:
        offered = sorted([*([".svg"] if drawing else []), *exports])
        rule = f"the name must end in {' or '.join(offered)}" if offered else "this case has no picture to write"
        raise BadRequest(str(path), f"{rule}, but ends in {kind!r}", "see docs/report.md", slug="replay-export")


def together(pages: Sequence[Page]) -> Page:
    """Return one page whose recordings play side by side, at one time; other pieces follow in order.

    Raises BadRequest: a page has no recording.
    """
    shown: list[Animation] = []
    for page in pages:
        found = [one for section in page.sections for one in section.pieces if isinstance(one, Animation)]
        if not found:
            rule = "cases beside each other must have a replay that plays, but this one has none"
            raise BadRequest(page.title, rule, "replay it alone", slug="replay-export")
        shown.append(replace(found[0], together=True))
    first = pages[0]
    lead = "The same case, side by side; what moves one moves all."
    facts = (*first.facts, *(("beside", page.subtitle) for page in pages[1:]))
    return Page(first.title, first.subtitle, facts, (Section("Replay", lead, tuple(shown)),))
