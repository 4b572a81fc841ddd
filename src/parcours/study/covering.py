"""What campaigns have covered together, and what is missing: blocks of test data, pairs of them, classes of cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel, cover, measure
from parcours.errors import BadRequest
from parcours.study.protocol import Request, Results
from parcours.study.stopping import MOST_CASES, pairs_wanted


@dataclass(frozen=True, slots=True)
class Drawn:
    """What the cases of results were made of and what became of them."""

    inputs: InputModel
    values: NDArray[np.float64]  # shape (n_cases, n_inputs)
    # name -> its classes, and that of each case, shape (n_cases,): start vectors, outcomes, verdicts
    classes: Mapping[str, tuple[Sequence[str], NDArray[np.str_]]]
    crossed: str = ""  # of these classes that of which each is to meet every block; none if empty


@runtime_checkable
class Covering(Protocol):
    """Results that know what their cases were made of."""

    def drawn(self) -> Drawn:
        """Return it."""


_WINDOW = 4096


@dataclass(frozen=True, slots=True)
class CoverageGoal:
    """One thing to cover."""

    name: str
    wanted: int
    held: int
    missing: tuple[str, ...]  # the first of what is missing, in words


def coverage(results: Mapping[str, Results]) -> list[CoverageGoal]:
    """Return what the cases of several results, by folder, cover together.

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
    goals = []
    if first.inputs.domains:
        blocks = cover(first.inputs, values)
        goals.append(CoverageGoal("blocks, each", blocks.n_blocks, blocks.n_hit, blocks.uncovered))
    if len(first.inputs.domains) > 1:
        pairs = measure(values, first.inputs, 2)
        goals.append(CoverageGoal("blocks, pairs", pairs.n_wanted, pairs.n_held, pairs.missing))
    for name, (words, _) in first.classes.items():
        seen = np.concatenate([one.classes[name][1] for one in every])
        absent = tuple(word for word in words if word not in set(seen.tolist()))
        goals.append(CoverageGoal(f"{name}, each", len(words), len(words) - len(absent), absent))
        if name == first.crossed and first.inputs.domains:
            parts = {word: cover(first.inputs, values[seen == word]) for word in words}
            missing = tuple(f"{word}: {block}" for word, part in parts.items() for block in part.uncovered)
            wanted = sum(part.n_blocks for part in parts.values())
            goals.append(CoverageGoal(f"{name} x blocks", wanted, wanted - len(missing), missing))
    return goals


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
