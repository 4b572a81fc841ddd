"""Places in a message, such as `poses[0].pose.position.x` or `yaw(pose.orientation)`.

    place := path | lens '(' path ')'          path := name ('.' name | '[' index ']')*          index := integer | '*'

`[-1]` is the last item, `[*]` every item. A lens shows a part of a message as one number, and writes it back:
`yaw` the heading [rad] of a quaternion, `seconds` a time or duration [s].
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from parcours.errors import BadModel

EVERY = "*"
"""The step to every item of a list."""

LENSES = ("yaw", "seconds")
MAX_ITEMS = 10_000
"""Most items that a list is grown to; greatest index."""

PATH = r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*|\[(?:-?[0-9]{1,5}|\*)\])*"
"""A path, as a regular expression."""

_PLACE = re.compile(rf"(?:(?P<lens>{'|'.join(LENSES)})\(\s*)?(?P<path>{PATH})(?(lens)\s*\))", re.ASCII)
_STEP = re.compile(r"\.?(?P<name>[A-Za-z_][A-Za-z0-9_]*)|\[(?P<index>-?[0-9]+|\*)\]", re.ASCII)

Step = str | int
"""The name of a field, the index of an item, or EVERY."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where in a message a value lies, and the lens through which it is seen; empty for none."""

    steps: tuple[Step, ...]
    lens: str = ""

    def __str__(self) -> str:
        path = path_text(self.steps)
        return f"{self.lens}({path})" if self.lens else path

    @property
    def is_each(self) -> bool:
        """Whether it is in every item of a list."""
        return EVERY in self.steps

    def within(self) -> Place:
        """Return the place without its first step: the same place in what that step leads to."""
        return Place(self.steps[1:], self.lens)


def path_text(steps: tuple[Step, ...]) -> str:
    """Return the text of some steps.

    >>> path_text(("points", "*", "x"))
    'points[*].x'
    """
    text = "".join(f"[{step}]" if isinstance(step, int) or step == EVERY else f".{step}" for step in steps)
    return text.removeprefix(".")


def parse_place(text: str, where: str = "place") -> Place:
    """Return the place that a text names.

    Args:
        text: e.g. `data[0]`.
        where: what the text belongs to, for the error message.

    Raises:
        BadModel: the text is no place, or an index is above MAX_ITEMS.

    >>> parse_place("yaw(pose.orientation)")
    Place(steps=('pose', 'orientation'), lens='yaw')
    >>> parse_place("points[0.x")
    Traceback (most recent call last):
    parcours.errors.BadModel: place: a place is a path such as pose.position.x or data[0], or yaw(path) or \
seconds(path), but this is 'points[0.x' [binding-place]
    """
    match = _PLACE.fullmatch(text.strip()) if len(text) <= 400 else None
    if match is None:
        rule = "a place is a path such as pose.position.x or data[0], or yaw(path) or seconds(path)"
        raise BadModel(where, f"{rule}, but this is {text[:60]!r}", slug="binding-place")
    found = ((step["name"], step["index"]) for step in _STEP.finditer(match["path"]))
    steps = tuple(name or (EVERY if index == EVERY else int(index)) for name, index in found)
    if any(isinstance(step, int) and abs(step) > MAX_ITEMS for step in steps):
        raise BadModel(where, f"an index is at most {MAX_ITEMS}, but not in {text[:60]!r}", slug="binding-place")
    return Place(steps, match["lens"] or "")
