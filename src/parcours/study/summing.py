"""Sums up the results in a folder: verdicts, the causes of what did not pass with cases of each, what to do next.

Computed once, drawn by `parcours.study.reporting`.
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadResults
from parcours.report.junit import CaseResult
from parcours.run.locations import location
from parcours.study.gate import JudgedResults
from parcours.study.journal import RUN, read_question
from parcours.study.protocol import Measure, Results, Study
from parcours.study.provenance import texts
from parcours.study.reproducing import noted
from parcours.verdict.judgement import Verdict

LISTED = 1000
"""Cases of a folder that a page lists at most."""

_CAUSES, _FIGURES, _LONG = 40, 3, 600  # causes, figures of a case, characters of a reason
_ORDER = {Verdict.FAIL: 0, Verdict.ERROR: 1, Verdict.INCONCLUSIVE: 2}


@runtime_checkable
class Highlighted(Protocol):
    """Results that say what matters about them beside verdicts."""

    def highlights(self) -> Sequence[str]:
        """Return sentences, the most important first."""


@runtime_checkable
class Caused(Protocol):
    """Results that know why their cases did not pass without making a sentence for each of them."""

    def causes(self) -> Sequence[str]:
        """Return for each case, in the order of `cases`, why it did not pass, in words that cases share; or ""."""

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places of `cases`."""


@runtime_checkable
class Figured(Protocol):
    """Results that know which figures say most of a case."""

    @property
    def telling(self) -> Sequence[str]:
        """Names of `measures`; by the first of them cases are worst."""


@runtime_checkable
class Unrepeatable(Protocol):
    """Results whose cases, or some of them, cannot be replayed."""

    def replayable(self, case: str) -> bool:
        """Return whether `replay` can show it."""


@dataclass(frozen=True, slots=True)
class ListedCase:
    """A case that did not pass, with the figures that it has."""

    result: CaseResult
    figures: tuple[float, ...]
    commands: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CauseFound:
    """Why cases did not pass: in words, with which verdict, how many, and the worst of them."""

    words: str
    verdict: Verdict
    count: int
    cases: tuple[ListedCase, ...]


@dataclass(frozen=True, slots=True)
class FolderSummary:
    """What the results in one folder come to."""

    folder: str
    study: str
    doc: str
    label: str
    planned: int
    verdicts: Counter[Verdict]
    causes: tuple[CauseFound, ...]
    figures: tuple[tuple[str, str], ...]  # name and unit of what is known of each case
    seed: int | None
    run: str  # the command that ran it; empty if that is not known
    made: Mapping[str, str]  # date, commit, machine, versions, as far as they were kept
    reproduced: str  # how many failing cases gave the same again; empty if nobody has tried
    highlights: tuple[str, ...] = ()  # what else is worth knowing first, in sentences

    @property
    def n(self) -> int:
        """How many cases are finished."""
        return self.verdicts.total()

    @property
    def failed(self) -> int:
        """How many failed or ended in an error."""
        return self.verdicts[Verdict.FAIL] + self.verdicts[Verdict.ERROR]


def sum_up(study: Study, folder: str, results: Results) -> FolderSummary:
    """Return what the results come to."""
    verdicts = _verdicts(results)
    made, seed, command = _asked(study, location(folder))
    found = noted(location(folder))
    figures = _telling(results, verdicts)
    causes = _causes(results, verdicts, figures, folder, command)
    return FolderSummary(
        folder, study.name, study.doc, results.label, results.planned, Counter(verdicts), causes,
        tuple((name.replace("_", " "), one.unit) for name, one in figures.items()), seed, command, made,
        str(found) if found is not None else "",
        tuple(results.highlights()) if isinstance(results, Highlighted) else (),
    )  # fmt: skip


def worst_cases(results: Results, most: int) -> list[str]:
    """Return the id of the worst case of each of the first causes of failures."""
    verdicts = _verdicts(results)
    found = _causes(results, verdicts, _telling(results, verdicts), "", "")
    return [one.cases[0].result.id for one in found if one.cases and one.verdict is not Verdict.INCONCLUSIVE][:most]


def _verdicts(results: Results) -> list[Verdict]:
    return (
        list(results.case_verdicts())
        if isinstance(results, JudgedResults)
        else [one.verdict for one in results.cases()]
    )


def _asked(study: Study, folder: Path) -> tuple[Mapping[str, str], int | None, str]:
    """Return where results come from, their seed, and the command that ran them, as far as the folder says."""
    if not (folder / RUN).exists():
        return {}, None, ""
    document = read_question(folder)
    question = cast("Mapping[str, object]", document["question"])
    seed, settings = question.get("seed"), question.get("settings")
    words = ["parcours", "run", str(document["where"]) or study.where or study.name]
    if isinstance(seed, int):
        words += ["--seed", str(seed)]
    defaults = {one.name: one for one in study.parameters}
    for name, value in settings.items() if isinstance(settings, Mapping) else ():
        one = defaults.get(name)
        if one is None or value == one.default or name in ("workers", "record", "graph"):
            continue
        words += [one.option] if value is True else [one.option, str(value)]
    return texts(document.get("made")), seed if isinstance(seed, int) else None, shlex.join(words)


def _telling(results: Results, verdicts: Sequence[Verdict]) -> dict[str, Measure]:
    """Return figures of which one way is worse: those that most cases have that did not pass, and that differ there."""
    failing = np.array([one is not Verdict.PASS for one in verdicts], bool)
    if not failing.any():
        return {}
    measures = results.measures()
    found: dict[str, Measure] = {}
    for name in results.telling if isinstance(results, Figured) else measures:
        one = measures.get(name)
        if one is None or one.kind != "quantity" or not one.worse or len(one.values) != len(failing):
            continue
        known = np.asarray(one.values)[failing]
        known = known[np.isfinite(known)]
        if 2 * len(known) > failing.sum() and np.ptp(known) > 0.0:
            found[name] = one
    return dict(list(found.items())[:_FIGURES])


def _causes(
    results: Results, verdicts: Sequence[Verdict], figures: Mapping[str, Measure], folder: str, command: str
) -> tuple[CauseFound, ...]:
    """Return the causes, failures first, the commonest of them before the others, with the worst cases of each."""
    places = [k for k, one in enumerate(verdicts) if one is not Verdict.PASS]
    if not places:
        return ()
    whole = None if isinstance(results, Caused) else results.cases()
    words = results.causes() if isinstance(results, Caused) else [_shared(one.why) for one in whole or ()]
    of: dict[tuple[Verdict, str], list[int]] = {}
    for k in places:
        of.setdefault((verdicts[k], words[k] or "no reason was given"), []).append(k)
    ranked = sorted(of, key=lambda key: (_ORDER[key[0]], -len(of[key]), key[1]))
    kept, rest = ranked[:_CAUSES], ranked[_CAUSES:]
    listed = {key: _worst(of[key], figures) for key in kept}
    room = LISTED
    for k, key in enumerate(sorted(kept, key=lambda key: len(listed[key]))):
        listed[key] = listed[key][: max(room // (len(kept) - k), 1)]
        room -= len(listed[key])
    found = []
    for key in kept:
        mine = results.some_cases(listed[key]) if isinstance(results, Caused) else [whole[k] for k in listed[key]]  # type: ignore[index]
        cases = tuple(
            ListedCase(_short(one), tuple(float(each.values[k]) for each in figures.values()),
                       _commands(results, folder, command, one.id))
            for k, one in zip(listed[key], mine, strict=True)
        )  # fmt: skip
        found.append(CauseFound(key[1], key[0], len(of[key]), cases))
    if rest:
        more = f"{len(rest)} rarer causes"
        found.append(CauseFound(more, rest[0][0], sum(len(of[key]) for key in rest), ()))
    return tuple(found)


def _worst(places: list[int], figures: Mapping[str, Measure]) -> list[int]:
    """Return the places, the worst by the first figure first; in their order without any, or where two are equal."""
    if not figures:
        return places
    first = next(iter(figures.values()))
    values: NDArray[np.float64] = np.asarray(first.values)[places]
    order = np.argsort(np.where(np.isnan(values), np.inf, values if first.worse == "less" else -values), kind="stable")
    return [places[k] for k in order]


_NUMBER = re.compile(r"(?<![\w#])\(?[-+−]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?(?:, ?[-+−]?\d+(?:\.\d+)?\))?")


def _shared(why: str) -> str:
    """Return a reason without what is of one case only: numbers, and what stands behind the first line.

    >>> _shared("x is 3.5 m at (1.2, 0.3) m, not 4 m"), _shared("raised KeyError: 'a'")
    ('x is … m at … m, not … m', "raised KeyError: 'a'")
    """
    return _NUMBER.sub("…", why.strip().partition("\n")[0])[:_LONG]


def _short(one: CaseResult) -> CaseResult:
    why = " ".join(one.why.split())
    return one if len(why) <= _LONG else CaseResult(one.id, one.verdict, one.seconds, f"{why[: _LONG - 1]}…")


def _commands(results: Results, folder: str, run: str, case: str) -> tuple[str, ...]:
    """Return what runs a case again, most useful first."""
    plain = case.partition("/")[2] if case.startswith(("functional/", "timing/")) else case
    shows = results.replayable(case) if isinstance(results, Unrepeatable) else True
    found = (shlex.join(["parcours", "replay", folder, plain]),) if shows else ()
    return (*found, f"{run} --case {shlex.quote(plain)} --out {shlex.quote(folder + '-again')}") if run else found


def repeats(folder: Path) -> bool:
    """Return whether `parcours reproduce` is for these results: those of a campaign."""
    try:
        from parcours.run.store import open_results

        open_results(folder)
    except BadResults:
        return False
    return True
