"""What campaigns have covered together, and what is missing: blocks of test data, t-wise, and what became of cases."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import HeldCombinations, InputModel, cover, measure
from parcours.errors import BadRequest
from parcours.report.pieces import Column, Page, Section, Table
from parcours.study.protocol import Request, Results
from parcours.study.stopping import MOST_CASES, pairs_wanted

Marks = Mapping[str, tuple[Sequence[str], NDArray[np.bool_]]]


@dataclass(frozen=True, slots=True)
class Drawn:
    """What some cases were made of and what became of them."""

    inputs: InputModel
    values: NDArray[np.float64]  # shape (n_cases, n_inputs)
    # name -> its classes, and the place of each case's among them, shape (n_cases,): start vectors, outcomes, verdicts
    classes: Mapping[str, tuple[Sequence[str], NDArray[np.int64]]]
    crossed: str = ""  # of these classes that of which each is to meet every block; none if empty
    # name -> what cases may meet, several at once, and whether cases met it, shape (n, n_words): transitions
    # that were taken, requirements that were violated, rules that held
    marks: Marks = field(default_factory=dict)


@runtime_checkable
class Covering(Protocol):
    """Results that know what their cases were made of."""

    def drawn(self) -> Iterator[Drawn]:
        """Yield it, some thousand cases after the other; once at least."""


_WINDOW = 4096
_TOGETHER = {2: "pairs"}


@dataclass(frozen=True, slots=True)
class CoverageGoal:
    """One thing to cover."""

    name: str
    wanted: int
    held: int
    missing: tuple[str, ...]  # the first of what is missing, in words


def coverage(results: Mapping[str, Results], strength: int = 2) -> list[CoverageGoal]:
    """Return what the cases of several results, by folder, cover together.

    Args:
        results: of campaigns.
        strength: how many blocks at most are looked for together, alone and with each class that is crossed with them.

    Raises BadRequest: some know nothing of their inputs, or they are of different inputs.
    """
    covered: _Covered | None = None
    for folder, one in results.items():
        if not isinstance(one, Covering):
            rule = "it is of campaigns, whose test data have blocks, but these results are of another kind"
            raise BadRequest(folder, rule, "see `parcours run` of component studies for theirs", slug="coverage-kind")
        for drawn in one.drawn():
            if covered is None:
                covered = _Covered(drawn, strength)
            elif not covered.fits(drawn):
                rule = "folders must be of the same test inputs, but these are not"
                raise BadRequest(" and ".join(results), rule, "ask of each by itself", slug="coverage-kind")
            covered.add(drawn)
    return covered.goals() if covered is not None else []


class _Covered:
    """What cases cover, some thousand of them after the other.

    Args:
        first: some of them, which say what there is to cover; they are not looked at.
        strength: how many blocks at most are looked for together.
    """

    def __init__(self, first: Drawn, strength: int) -> None:
        self._first, inputs = first, first.inputs
        self._groups: Sequence[str] = first.classes[first.crossed][0] if first.crossed else ("",)
        self._blocks = [cover(inputs, np.zeros((0, len(inputs.domains)))) for _ in self._groups]
        sizes = range(2, min(strength, len(inputs.domains)) + 1)
        self._together = {t: HeldCombinations(inputs, t, len(self._groups)) for t in sizes}
        self._seen = {name: np.zeros(len(words), bool) for name, (words, _) in first.classes.items()}
        self._met: dict[str, dict[str, bool]] = {}

    def fits(self, drawn: Drawn) -> bool:
        """Return whether cases are of the same inputs and classes."""
        return drawn.inputs == self._first.inputs and {name: words for name, (words, _) in drawn.classes.items()} == {
            name: words for name, (words, _) in self._first.classes.items()
        }

    def add(self, drawn: Drawn) -> None:
        """Take note of cases."""
        of = drawn.classes[drawn.crossed][1] if drawn.crossed else np.zeros(len(drawn.values), np.int64)
        for group in np.unique(of):
            self._blocks[group] += cover(drawn.inputs, drawn.values[of == group])
        for together in self._together.values():
            together.add(drawn.values, of)
        for name, (_, codes) in drawn.classes.items():
            self._seen[name][codes] = True
        for name, (words, by_case) in drawn.marks.items():  # folders may have different ones
            met = self._met.setdefault(name, {})
            for k, word in enumerate(words):
                met[word] = met.get(word, False) or bool(by_case[:, k].any())

    def goals(self) -> list[CoverageGoal]:
        """Return what is covered."""
        whole = functools.reduce(operator.add, self._blocks)
        goals = [CoverageGoal("blocks, each", whole.n_blocks, whole.n_hit, whole.uncovered)]
        for t, found in self._together.items():
            held, missing = found.held()
            goals.append(CoverageGoal(f"blocks, {_TOGETHER.get(t, f'{t}-wise')}", found.n_wanted, held, missing))
        for name, (words, _) in self._first.classes.items():
            goals.append(_of_words(f"{name}, each", dict(zip(words, self._seen[name].tolist(), strict=True))))
            if name == self._first.crossed:
                goals += self._crossed(name)
        return goals + [_of_words(name, met) for name, met in self._met.items()]

    def _crossed(self, name: str) -> Iterator[CoverageGoal]:
        """Yield which blocks each class has met."""
        words, every = self._groups, self._blocks
        missing = tuple(f"{word}: {one}" for word, of in zip(words, every, strict=True) for one in of.uncovered)
        yield CoverageGoal(f"{name} x blocks", sum(of.n_blocks for of in every), sum(of.n_hit for of in every), missing)
        for t, found in self._together.items():
            parts = [found.held(group) for group in range(len(words))]
            missing = tuple(f"{word}: {one}" for word, part in zip(words, parts, strict=True) for one in part[1])
            wanted, held = found.n_wanted * len(words), sum(part[0] for part in parts)
            yield CoverageGoal(f"{name} x {_TOGETHER.get(t, f'{t}-wise')}", wanted, held, missing)


def _of_words(name: str, met: Mapping[str, bool]) -> CoverageGoal:
    return CoverageGoal(name, len(met), sum(met.values()), tuple(word for word, is_met in met.items() if not is_met))


def coverage_page(goals: Sequence[CoverageGoal], folders: Sequence[str]) -> Page:
    """Return a page on what is covered, drawn, and what is missing."""
    from parcours.report.rates import shares

    parts = {one.name: [one.held, one.wanted - one.held] for one in goals if one.wanted}
    chart = shares("Covered and missing", ("covered", "missing"), parts, ("good", "bad"))
    rows = tuple((one.name, one.held, one.wanted, one.held / max(one.wanted, 1)) for one in goals)
    counted = Table(
        "Coverage", (Column("of"), Column("covered", ",d"), Column("wanted", ",d"), Column("share", ".1%")), rows
    )
    absent = tuple((one.name, missing) for one in goals for missing in one.missing)
    pieces = (chart, counted, Table("Missing", (Column("of"), Column("first of what no case has")), absent))
    section = Section("Coverage", "Of all cases in these folders together.", pieces if absent else pieces[:2])
    return Page("Coverage", ", ".join(folders), tuple(("folder", one) for one in folders), (section,))


def closing(
    request: Request, inputs: InputModel, values: Callable[[NDArray[np.int64]], NDArray[np.float64]],
    classes: Callable[[NDArray[np.int64]], Sequence[str]], every: Sequence[str],
) -> tuple[int, ...]:  # fmt: skip
    """Return numbers of cases that hold the pairs of blocks that a request ends with, the most missing pairs first.

    They are those of the campaign without this rule: what each case is stays the same. Nothing is simulated for it.

    Args:
        request: () is returned unless its rules ask for pairs.
        inputs: whose blocks are meant.
        values: gives those of the inputs by the numbers of cases, shape (n, n_inputs).
        classes: gives the class of each case, which is to meet every block: its start vector.
        every: all classes.

    Raises BadRequest: there are no pairs, or the first `request.n_cases` cases do not hold enough.
    """
    wanted = pairs_wanted(request.until)
    if wanted is None:
        return ()
    sizes = [len(every), *inputs.sizes]
    pairs = list(combinations(range(len(sizes)), 2))
    if len(inputs.domains) < 2:
        raise BadRequest("--until", "pairs need two test inputs at least", "give another rule", slug="until-pairs")
    known = measure(np.zeros((0, len(inputs.domains))), inputs, 2)
    total = known.n_wanted + len(every) * (sum(inputs.sizes) if len(every) > 1 else 0)
    first = np.cumsum([0, *(sizes[a] * sizes[b] for a, b in pairs)])
    held, chosen, most = np.zeros(first[-1], bool), list[int](), request.n_cases or MOST_CASES
    held[: first[len(sizes) - 1]] = len(every) < 2  # one class for all distinguishes nothing
    before = int(held.sum())
    for start in range(0, most, _WINDOW):
        numbers = np.arange(start, min(start + _WINDOW, most))
        of = [every.index(one) for one in classes(numbers)]
        blocks = np.column_stack([of, inputs.blocks_of(values(numbers))])
        tuples = np.stack([first[k] + blocks[:, a] * sizes[b] + blocks[:, b] for k, (a, b) in enumerate(pairs)], axis=1)
        while held.sum() - before < wanted * total:
            gains = (~held[tuples]).sum(axis=1)
            best = int(gains.argmax())
            if not gains[best]:
                break
            chosen.append(int(numbers[best]))
            held[tuples[best]] = True
        else:
            return tuple(chosen)
    rule = f"{100.0 * wanted:g} % of {total} pairs are asked for, but {most} cases hold {held.sum() - before}"
    raise BadRequest("--until", rule, "raise --max-cases, or ask for less", slug="until-pairs")
