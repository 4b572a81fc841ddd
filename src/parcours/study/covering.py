"""What campaigns have covered together, and what is missing: blocks of test data, t-wise, and what became of cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel, cover, measure
from parcours.errors import BadRequest
from parcours.report.pieces import Column, Page, Section, Table
from parcours.study.protocol import Request, Results
from parcours.study.stopping import MOST_CASES, pairs_wanted

Marks = Mapping[str, tuple[Sequence[str], NDArray[np.bool_]]]


@dataclass(frozen=True, slots=True)
class Drawn:
    """What the cases of results were made of and what became of them."""

    inputs: InputModel
    values: NDArray[np.float64]  # shape (n_cases, n_inputs)
    # name -> its classes, and that of each case, shape (n_cases,): start vectors, outcomes, verdicts
    classes: Mapping[str, tuple[Sequence[str], NDArray[np.str_]]]
    crossed: str = ""  # of these classes that of which each is to meet every block; none if empty
    # name -> what cases may meet, several at once, and whether cases met it, shape (n, n_words): transitions
    # that were taken, requirements that were violated, rules that held
    marks: Marks = field(default_factory=dict)


@runtime_checkable
class Covering(Protocol):
    """Results that know what their cases were made of."""

    def drawn(self) -> Drawn:
        """Return it."""


_WINDOW = 4096
_TOGETHER = {1: "blocks", 2: "pairs"}


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
    found = {}
    for folder, one in results.items():
        if not isinstance(one, Covering):
            rule = "it is of campaigns, whose test data have blocks, but these results are of another kind"
            raise BadRequest(folder, rule, "see `parcours run` of component studies for theirs", slug="coverage-kind")
        found[folder] = one.drawn()
    first, *others = found.values()
    if any(other.inputs != first.inputs or other.classes.keys() != first.classes.keys() for other in others):
        rule = "folders must be of the same test inputs, but these are not"
        raise BadRequest(" and ".join(found), rule, "ask of each by itself", slug="coverage-kind")
    every = list(found.values())
    values = np.concatenate([one.values for one in every])
    sizes = range(1, min(strength, len(first.inputs.domains)) + 1)
    goals = []
    for t in sizes:
        what = "each" if t == 1 else _TOGETHER.get(t, f"{t}-wise")
        goals.append(CoverageGoal(f"blocks, {what}", *_held(first.inputs, values, t)))
    for name, (words, _) in first.classes.items():
        seen = np.concatenate([one.classes[name][1] for one in every])
        absent = tuple(word for word in words if word not in set(seen.tolist()))
        goals.append(CoverageGoal(f"{name}, each", len(words), len(words) - len(absent), absent))
        for t in sizes if name == first.crossed else ():
            parts = {word: _held(first.inputs, values[seen == word], t) for word in words}
            missing = tuple(f"{word}: {one}" for word, part in parts.items() for one in part[2])
            wanted, held = sum(part[0] for part in parts.values()), sum(part[1] for part in parts.values())
            goals.append(CoverageGoal(f"{name} x {_TOGETHER.get(t, f'{t}-wise')}", wanted, held, missing))
    return goals + _met(every)


def _held(inputs: InputModel, values: NDArray[np.float64], t: int) -> tuple[int, int, tuple[str, ...]]:
    """Return how many combinations of t blocks there are, how many values hold, and the first that they do not."""
    if t == 1:
        blocks = cover(inputs, values)
        return blocks.n_blocks, blocks.n_hit, blocks.uncovered
    found = measure(values, inputs, t)
    return found.n_wanted, found.n_held, found.missing


def _met(every: Sequence[Drawn]) -> list[CoverageGoal]:
    """Return the goals of marks; folders may have different ones."""
    met: dict[str, dict[str, bool]] = {}
    for one in every:
        for name, (words, by_case) in one.marks.items():
            of = met.setdefault(name, {})
            for k, word in enumerate(words):
                of[word] = of.get(word, False) or bool(by_case[:, k].any())
    return [
        CoverageGoal(name, len(of), sum(of.values()), tuple(word for word, is_met in of.items() if not is_met))
        for name, of in met.items()
    ]


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
