"""Compares two runs: case by case where they share cases, as separate samples where they do not.

Only what is compared is read of a run (`Outline`): a campaign of a million cases takes some tenths of a second.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.report.pieces import Cell, Column, Table
from parcours.study.protocol import Measure, Results
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import RateComparison, compare_with_published, holm, rate_difference

_SIGNIFICANT = 0.05
_NAMED = 20  # cases that are named where they flipped

Places = NDArray[np.intp] | slice
Worse = Literal["more", "less", ""]
OutlinePart = tuple[NDArray[np.int64], NDArray[np.bool_], Mapping[str, NDArray[np.int8]]]
"""Of some cases: their numbers, which passed, and what they count for each rate, all of shape (n,)."""


@dataclass(frozen=True, slots=True)
class Counted:
    """What each case counts for one rate."""

    values: NDArray[np.int8]  # shape (n_cases,): 1 or 0; -1 where it is not known
    worse: Worse = "more"  # which way is worse; "" where neither is

    @staticmethod
    def of(measure: Measure) -> Counted:
        """Return a rate of `Results.measures` in this form."""
        return Counted(np.nan_to_num(measure.values, nan=-1.0).astype(np.int8), measure.worse)


@dataclass(frozen=True, slots=True)
class Outline:
    """What a comparison reads of a run: which cases it has, which of them passed, and their rates."""

    numbers: NDArray[np.int64]  # of the cases, each once, shape (n_cases,)
    id: Callable[[int], str]  # number -> id
    passed: NDArray[np.bool_]
    rates: Mapping[str, Counted]
    # whether an id follows from its number alone, and case 0 shows how: runs that give the same id to case 0 give the
    # same to every other. If not, only ids say which cases are the same
    numbered: bool = True


def outline_in_parts(parts: Iterable[OutlinePart], id: Callable[[int], str], worse: Callable[[str], Worse]) -> Outline:
    """Return the outline of a run of numbered cases from those of some of its cases after the other."""
    numbers, passed, rates = zip(*parts, strict=True)
    found = {name: Counted(np.concatenate([one[name] for one in rates]), worse(name)) for name in rates[0]}
    return Outline(np.concatenate(numbers), id, np.concatenate(passed), found)


@runtime_checkable
class Outlined(Protocol):
    """Results that can be compared without reading all that is kept of their cases."""

    def outline(self) -> Outline:
        """Return what a comparison needs."""


def outline_of(results: Results) -> Outline:
    """Return what a comparison needs of any results."""
    if isinstance(results, Outlined):
        return results.outline()
    cases = results.cases()
    ids, passed = [one.id for one in cases], [one.verdict is Verdict.PASS for one in cases]
    rates = {name: Counted.of(one) for name, one in results.measures().items() if one.kind == "rate"}
    return Outline(np.arange(len(ids)), ids.__getitem__, np.array(passed, bool), rates, numbered=False)


@dataclass(frozen=True, slots=True)
class CaseIds:
    """The ids of some cases, worded when they are asked for: they may be hundreds of thousands."""

    id: Callable[[int], str]
    numbers: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[str]:
        return map(self.id, self.numbers.tolist())


@dataclass(frozen=True, slots=True)
class Compared:
    """One rate beside its earlier self."""

    name: str  # of the rate
    before: float  # its share in the baseline
    now: float  # its share now
    only_before: int  # cases that counted in the baseline only
    only_now: int  # cases that count now only
    low: float  # 95 % interval of its growth, now less before (Newcombe's, of pairs)
    high: float
    p_value: float  # of McNemar's test, by Holm's method
    worse: bool  # whether it got significantly worse
    flipped: CaseIds  # the cases that made it worse


@dataclass(frozen=True, slots=True)
class Baseline:
    """A run beside an earlier one, on the cases that both have."""

    shared: int  # how many cases both have
    rows: tuple[Compared, ...]  # the rates
    flipped: CaseIds  # the cases that passed earlier and do not now
    repaired: CaseIds  # those that did not pass earlier and do now

    @property
    def failed(self) -> bool:
        """Whether some rate got significantly worse."""
        return any(row.worse for row in self.rows)

    def table(self) -> Table:
        """Return the rates side by side."""
        columns = (Column("rate"), Column("baseline", ".2%"), Column("now", ".2%"), Column("difference"),
                   Column("only in baseline", ",d"), Column("only now", ",d"), Column("p (Holm)", ".2g"),
                   Column("worse"))  # fmt: skip
        rows = tuple(
            (
                one.name,
                one.before,
                one.now,
                f"{one.now - one.before:+.2%} [{one.low:+.2%}, {one.high:+.2%}]",
                one.only_before,
                one.only_now,
                one.p_value,
                "yes" if one.worse else "no",
            )
            for one in self.rows
        )
        note = (
            f"{self.shared} cases that both have; McNemar's exact test on the pairs, corrected for {len(rows)} rates;"
            " Newcombe's 95 % interval of the difference."
        )
        return Table("Compared with the baseline", columns, rows, note)

    def lines(self) -> list[str]:
        """Return the cases that flipped, in words."""
        listed = [("no longer pass", self.flipped), ("now pass", self.repaired)]
        listed += [(f"made {one.name} worse", one.flipped) for one in self.rows if one.worse and one.name != "failed"]
        lines = []
        for what, ids in listed:
            if len(ids):
                more = f" and {len(ids) - _NAMED} more" if len(ids) > _NAMED else ""
                named = ", ".join(itertools.islice(ids, _NAMED))
                lines.append(f"{len(ids)} case{'s' * (len(ids) != 1)} {what}: {named}{more}")
        return lines

    def document(self) -> dict[str, object]:
        """Return all of it as JSON values, with the id of every case that flipped."""
        rows = [
            {one.name: getattr(row, one.name) for one in fields(row)} | {"flipped": list(row.flipped)}
            for row in self.rows
        ]
        return {"shared": self.shared, "rows": rows, "flipped": list(self.flipped), "repaired": list(self.repaired)}


def share_cases(now: Outline, earlier: Outline) -> bool:
    """Return whether two runs have a case in common, by their ids."""
    return _shared(now, earlier)[0] > 0


def compare_with_baseline(now: Outline, earlier: Outline) -> Baseline:
    """Return the comparison of two runs on the cases that both have, by their ids.

    Raises BadRequest: there are none.
    """
    n, here, there = _shared(now, earlier)
    if not n:
        raise BadRequest("--baseline", "both runs must have cases in common, but have none",
                         "run the same study with the same seed", slug="baseline-cases")  # fmt: skip
    numbers = now.numbers[here]

    def ids(chosen: NDArray[np.bool_]) -> CaseIds:
        return CaseIds(now.id, numbers[chosen])

    found = []
    for name, rate in now.rates.items():
        if not rate.worse or name not in earlier.rates:
            continue
        new, old = rate.values[here] == 1, earlier.rates[name].values[there] == 1
        differ = rate_difference(new, old)
        only_new, only_old = differ.pairs.first_only, differ.pairs.second_only
        grew = only_new > only_old if rate.worse == "more" else only_old > only_new
        flipped = ids(new & ~old if rate.worse == "more" else old & ~new)
        shares = (differ.pairs.both + only_old) / n, (differ.pairs.both + only_new) / n
        found.append(
            ((name, *shares, only_old, only_new, differ.low, differ.high), differ.pairs.p_value, grew, flipped)
        )
    adjusted = zip(found, holm([row[1] for row in found]), strict=True)
    rows = tuple(Compared(*row[0], p, row[2] and p < _SIGNIFICANT, row[3]) for row, p in adjusted)
    passes, passed = now.passed[here], earlier.passed[there]
    return Baseline(n, rows, ids(passed & ~passes), ids(passes & ~passed))


def _shared(now: Outline, earlier: Outline) -> tuple[int, Places, Places]:
    """Return how many cases two runs share, and their places in the one and in the other."""
    if now.numbered and earlier.numbered:
        if now.id(0) != earlier.id(0):
            return 0, slice(0), slice(0)
        if np.array_equal(now.numbers, earlier.numbers):
            return len(now.numbers), slice(None), slice(None)
        _, here, there = np.intersect1d(now.numbers, earlier.numbers, assume_unique=True, return_indices=True)
        return len(here), here, there
    places = {earlier.id(number): k for k, number in enumerate(earlier.numbers.tolist())}
    pairs = [(k, place) for k, number in enumerate(now.numbers.tolist())
             if (place := places.get(now.id(number))) is not None]  # fmt: skip
    return len(pairs), *np.array(pairs, np.intp).reshape(-1, 2).T


def compare_apart(now: Outline, earlier: Outline) -> Table:
    """Return the rates of two runs that have no cases in common, side by side, each with its interval."""
    rows: list[tuple[str, RateComparison]] = []
    for name, rate in now.rates.items():
        if name in earlier.rates:
            counts = [
                (int((one == 1).sum()), int((one >= 0).sum())) for one in (rate.values, earlier.rates[name].values)
            ]
            rows.append((name, compare_with_published(*counts[0], *counts[1])))
    shown: list[tuple[Cell, ...]] = [
        (name, *(f"{of.share:.2%} [{of.low:.2%}, {of.high:.2%}]" for of in (one.published, one.ours)), p)
        for (name, one), p in zip(rows, holm([one.p_value for _, one in rows]), strict=True)
    ]
    columns = (Column("rate"), Column("baseline"), Column("now"), Column("p (Holm)", ".2g"))
    note = "No case is in both, so they count as separate samples: Wilson 95 % intervals, Fisher's exact test."
    return Table("Compared with the baseline", columns, tuple(shown), note)
