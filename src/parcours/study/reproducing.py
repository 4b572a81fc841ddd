"""Runs the failing cases of a campaign again, wherever it was made: how many give the same facts, byte by byte?"""

from __future__ import annotations

import dataclasses
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

from parcours.errors import BadRequest, BadResults
from parcours.run.atomic import write_atomically
from parcours.run.manifest import differences
from parcours.run.store import Store, open_results
from parcours.study.finding import study_of
from parcours.study.journal import RUN, read_question
from parcours.study.parameters import settings_of
from parcours.study.protocol import Progress, Request
from parcours.verdict.judgement import Verdict

FILE = "reproduced.json"
SAMPLE = 5
"""Mutants, or cases under faults, that are run again for a page."""

_NAMED = 20
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Reruns:
    """How many of a sample gave the same verdict and facts when they were run again.

    >>> str(Reruns("noticed mutants", 5, 5, 37))
    '5 of 5 gave the same verdict and facts (5 of 37 noticed mutants were run again)'
    """

    what: str  # plural
    equal: int = 0
    tried: int = 0
    among: int = 0  # how many the sample was drawn from

    @property
    def differing(self) -> int:
        """How many came out otherwise."""
        return self.tried - self.equal

    def __str__(self) -> str:
        if not self.tried:
            return f"there were no {self.what} to run again"
        said = f"{self.equal} of {self.tried} gave the same verdict and facts"
        return f"{said} ({self.tried} of {self.among} {self.what} were run again)"

    def warning(self) -> tuple[str, ...]:
        """Return a sentence on what came out otherwise; none if nothing did."""
        if not self.differing:
            return ()
        return (f"Not reproducible: {self.differing} of {self.tried} {self.what} came out otherwise when run again.",)


def spread(items: Sequence[T], most: int = SAMPLE) -> list[T]:
    """Return at most that many of the items, evenly spaced.

    >>> spread("abcdefgh", 3)
    ['a', 'c', 'f']
    """
    n = min(most, len(items))
    return [items[k * len(items) // n] for k in range(n)]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What became of the failing cases of a campaign when they were run again."""

    failing: int  # cases that had failed, or ended in an error
    equal: int  # of these, whose facts are the same bytes
    differing: tuple[str, ...] = ()  # ids of the first of the others
    changed: tuple[str, ...] = ()  # what the campaign depends on and is no more what it was, in words
    campaign: str = ""  # digest of the campaign

    def __str__(self) -> str:
        if not self.failing:
            return "no case failed, so there is nothing to reproduce"
        said = f"{self.equal} of {self.failing} failing cases reproduced, equal to the byte"
        return f"{said}; others: {', '.join(self.differing)}" if self.differing else said


def reproduce(folder: Path, progress: Progress, *, given: str = "", workers: int | None = None) -> Reproduction:
    """Run every failing case of a campaign again, and compare its facts with those that were kept.

    Args:
        folder: of results, also made elsewhere.
        progress: reports how far it is.
        given: where the study is, if not where it was.
        workers: processes; one a processor if None.

    Raises:
        BadRequest: the study is not found.
        BadResults: there is no campaign in the folder, or it does not say what was asked.
    """
    study, store = study_of(folder, given), open_results(folder)
    results = study.read(folder)
    rows = {int(row["number"]): row.tobytes() for row in store.load(partial=True)}
    ids = {one.id: one.verdict for one in results.cases()}
    failing = [
        id
        for id, verdict in ids.items()
        if verdict in (Verdict.FAIL, Verdict.ERROR) and id.rpartition("/")[0] not in ids
    ]  # a part of another case is no case
    if not failing:
        return Reproduction(0, 0, campaign=store.campaign.digest)
    if not (folder / RUN).exists():
        raise BadResults(str(folder), f"must say what was asked in {RUN}, but has none", "run the study again",
                         slug="results-manifest")  # fmt: skip
    question = cast("Mapping[str, object]", read_question(folder)["question"])
    known = {one.name for one in study.parameters}
    asked = {name: value for name, value in cast("Mapping[str, object]", question["settings"]).items() if name in known}
    if workers is not None and "workers" in known:
        asked["workers"] = workers
    settings = settings_of(study.parameters, asked, f"study {study.name}")
    with tempfile.TemporaryDirectory(prefix="parcours-") as again:
        run = study.run(Request(settings, store.campaign.seed, Path(again), chosen=tuple(failing)), progress)
        if run.interrupted:
            raise KeyboardInterrupt
        return _compared(store, rows, open_results(Path(again)), failing)


def _compared(store: Store, rows: Mapping[int, bytes], again: Store, failing: list[str]) -> Reproduction:
    found = again.load()
    if found.dtype != store.campaign.dtype or len(found) != len(failing):
        rule = f"{len(failing)} cases with the facts that were kept are expected, but {len(found)} of another form came"
        raise BadResults(str(store.folder), rule, "use the version of Parcours that wrote it", slug="results-version")
    numbers = [int(number) for number in found["number"]]
    equal = {number for number, row in zip(numbers, found, strict=True) if rows.get(number) == row.tobytes()}
    chosen = set(numbers)
    ids = dict(zip([number for number in rows if number in chosen], failing, strict=True))  # both in its order
    differing = tuple(ids[number] for number in numbers if number not in equal)
    ours, theirs = (
        {key: value for key, value in one.campaign.parameters.items() if key != "chosen"} for one in (again, store)
    )
    return Reproduction(
        len(failing), len(equal), differing[:_NAMED], tuple(differences(ours, theirs)), store.campaign.digest
    )


def note(folder: Path, found: Reproduction) -> None:
    """Keep what was found beside the results, for reports. Raises BadRequest: the folder cannot be written to."""
    content = json.dumps(dataclasses.asdict(found), indent=1, ensure_ascii=False) + "\n"
    write_atomically(folder / FILE, content.encode())


def noted(folder: Path) -> Reproduction | None:
    """Return what was kept of these very results; None if nothing was, or of others."""
    try:
        document = json.loads((folder / FILE).read_bytes())
        found = Reproduction(
            int(document["failing"]), int(document["equal"]), tuple(map(str, document["differing"])),
            tuple(map(str, document["changed"])), str(document["campaign"]),
        )  # fmt: skip
        return found if found.campaign == open_results(folder).campaign.digest else None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError, BadRequest, BadResults):
        return None
