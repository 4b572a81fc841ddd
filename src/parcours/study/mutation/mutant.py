"""What a mutant is: one small change to a module, a model or a channel, under an id that lasts."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change."""

    id: str  # place:function:ordinal:operator, or what a model or a channel has in their place
    operator: str
    file: str  # where it is; of a channel empty
    line: int  # in that file
    change: str  # what became of what, as `a < b -> a <= b`
    diff: str = ""  # unified

    @property
    def place(self) -> str:
        """The file and line; empty without a file."""
        return f"{Path(self.file).name}:{self.line}" if self.file else ""


def diff_of(file: str, before: str, after: str) -> str:
    """Return the unified diff of two versions of a file, with a line around each change."""
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), file, file, n=1, lineterm="")
    return "\n".join(lines)


def sampled(mutants: Iterable[Mutant], n: int, seed: int) -> list[Mutant]:
    """Return n of the mutants, all if n is 0, in their order; a larger sample of one seed holds the smaller ones."""
    listed = list(mutants)
    if not n or n >= len(listed):
        return listed
    lots = {one.id: hashlib.sha256(f"{seed} {one.id}".encode()).digest() for one in listed}
    drawn = set(sorted(lots, key=lots.__getitem__)[:n])
    return [one for one in listed if one.id in drawn]
