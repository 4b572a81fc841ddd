"""A failing case of a campaign into a small one that fails for the same cause, kept as files: data, a test, a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from parcours.errors import BadRequest, BadResults
from parcours.study.finding import study_of
from parcours.study.protocol import Progress
from parcours.study.reducing import CaseShape, Data, reduce

BUDGET = 199
"""Most re-runs of a case."""


class WrittenCase(Protocol):
    """A failing case as data, which can be changed and run again."""

    @property
    def id(self) -> str:
        """Of the case as it was drawn."""

    @property
    def cause(self) -> str:
        """Why it failed, in words that do not depend on numbers."""

    @property
    def data(self) -> Data:
        """The case."""

    @property
    def shape(self) -> CaseShape:
        """What of it may change."""

    def causes(self, data: Data) -> Sequence[str]:
        """Run a case, and return why it fails; () if it does not. Raises ParcoursError, before, if it is not a case."""

    def sizes(self, data: Data) -> Mapping[str, float]:
        """Return what is made small, by name with its unit: how many obstacles there are, how long it lasts."""

    def write(self, data: Data, out: Path) -> Sequence[Path]:
        """Write a case, a test that fails as long as it does, and a run of it for replays; return what was written."""


@runtime_checkable
class Shrinkable(Protocol):
    """A study whose cases can be written as data."""

    def written(self, folder: Path, case: str) -> WrittenCase:
        """Return a failing case of the results in a folder. Raises BadRequest: there is no such case, or it passed."""


@dataclass(frozen=True, slots=True)
class Shrunk:
    """What became of a case."""

    case: str
    cause: str
    runs: int  # re-runs, that of the unchanged case among them
    complete: bool  # whether nothing more could be left out or rounded; else the budget was used up
    before: Mapping[str, float]
    after: Mapping[str, float]
    files: tuple[str, ...]

    def __str__(self) -> str:
        sizes = ", ".join(f"{name} {self.before[name]:g} -> {self.after[name]:g}" for name in self.after)
        end = "" if self.complete else "; the budget is used up"
        return f"{self.case}: {self.cause}; {sizes}; {self.runs} re-runs{end}"


def shrink(folder: Path, case: str, out: Path, progress: Progress, *, given: str = "", budget: int = BUDGET) -> Shrunk:
    """Make a failing case small, and write it.

    Args:
        folder: results of a campaign.
        case: its id, or its number.
        out: folder for what is written.
        progress: reports how many re-runs there were.
        given: where the study is, if not where it was.
        budget: most re-runs.

    Raises:
        BadRequest: the study's cases cannot be written as data, there is no such case, or it did not fail.
        BadResults: written as data it does not fail for the same cause.
    """
    study = study_of(folder, given)
    if not isinstance(study, Shrinkable):
        rule = "its cases must be ones that can be written as data, but this study has no such form for them"
        raise BadRequest(f"study {study.name!r}", rule, "replay the case instead", slug="shrink-study")
    written = study.written(folder, case)
    done = 0

    def fails(data: Data) -> bool:
        nonlocal done
        found = written.cause in written.causes(data)
        done += 1
        progress(f"re-runs of {written.id}", done, budget)
        return found

    if not fails(written.data):
        rule = f"written as data it must fail as it did ({written.cause}), but it does not"
        raise BadResults(written.id, rule, "replay the case instead", slug="shrink-differs")
    reduced = reduce(written.data, fails, written.shape, budget - 1)
    files = written.write(reduced.data, out)
    return Shrunk(
        written.id, written.cause, done, reduced.complete, dict(written.sizes(written.data)),
        dict(written.sizes(reduced.data)), tuple(map(str, files)),
    )  # fmt: skip
