"""Combines abstract cases, rows of data and time budgets into a plan whose cases are found by their numbers alone.

Numbers run over the abstract cases first, then over the time budgets, then over the rows of data:

    number     0   1   2     3   4   5     6   7   8     9 ...
    abstract   A   B   C     A   B   C     A   B   C     A
    budget     ---20 s---    ---40 s---    ---20 s---    ...
    data row   -----------0-----------     -----------1---

So any stretch of a plan treats all abstract cases alike, and the first `len(abstracts) * n_rows` data rows satisfy
the combination criterion for every abstract case. Values depend on (seed, abstract case, data row) only:
cases that differ in nothing but their time budget have the same values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel, count, draw, select
from parcours.errors import BadRequest, BadSuite, one_of
from parcours.suite.cases import Case, is_part

if TYPE_CHECKING:
    from parcours.abtc import AbstractCase

_BATCH = 1024


@dataclass(frozen=True, slots=True)
class Plan:
    """All cases of a study, none of them built before it is asked for. Make one with `combine`."""

    study: str
    abstracts: tuple[str, ...]
    inputs: InputModel
    criterion: str
    time_budgets: tuple[float, ...]
    seed: int
    n_cases: int

    def __len__(self) -> int:
        return self.n_cases

    @property
    def n_rows(self) -> int:
        """How many rows of data satisfy the combination criterion, for one abstract case."""
        return _rows(self.criterion, self.inputs)

    def number(self, abstract: str, row: int) -> int:
        """Return the number of the case with this abstract case and row.

        Raises:
            BadRequest: there is no such abstract case, or the plan ends before that row.
        """
        if abstract not in self.abstracts:
            rule = f"an abstract case must be known, but {abstract!r} is not"
            remedy = one_of(abstract, self.abstracts[:20])
            raise BadRequest(f"study {self.study!r}", rule, remedy, slug="unknown-abstract")
        number = row * len(self.abstracts) + self.abstracts.index(abstract)
        self._check(np.array([number]))
        return number

    def blocks(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the blocks that the values of the cases are drawn from, shape (n, n_inputs).

        Args:
            numbers: case numbers, shape (n,), in any order.

        Raises:
            BadRequest: a number lies outside the plan.
        """
        self._check(numbers)
        if not self.inputs.domains:
            return np.zeros((len(numbers), 0), np.int64)
        row, abstract = np.divmod(numbers, len(self.abstracts))
        # Every abstract case has repetitions of the criterion for itself: no two share one.
        repetition, place = np.divmod(row // len(self.time_budgets), self.n_rows)
        table_row = (repetition * len(self.abstracts) + abstract) * self.n_rows + place
        return select(self.criterion, self.inputs.sizes, table_row, seed=self.seed)

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the values of the cases in the units of the inputs, shape (n, n_inputs).

        A case has the same bits whichever cases are asked for with it.

        Args:
            numbers: case numbers, shape (n,), in any order.

        Raises:
            BadRequest: a number lies outside the plan.
            BadDomain: the constraints cannot be met within the blocks of a case.
        """
        rows = self.blocks(numbers)
        if not self.inputs.domains:
            return np.zeros((len(numbers), 0))
        row, abstract = np.divmod(numbers, len(self.abstracts))
        data = row // len(self.time_budgets) * len(self.abstracts) + abstract
        return draw(self.inputs, rows, data, seed=self.seed)

    def case(self, number: int) -> Case:
        """Return one case, without building the others. Raises as `values`."""
        return self._case(number, self.values(np.array([number]))[0])

    def cases(self, first: int = 0, n: int | None = None) -> Iterator[Case]:
        """Yield `n` cases from number `first` on, by default all; memory stays flat. Raises as `values`."""
        end = self.n_cases if n is None else first + n
        for start in range(first, end, _BATCH):
            numbers = np.arange(start, min(start + _BATCH, end))
            for number, values in zip(numbers, self.values(numbers), strict=True):
                yield self._case(int(number), values)

    def _case(self, number: int, values: NDArray[np.float64]) -> Case:
        row, abstract = divmod(number, len(self.abstracts))
        budget = self.time_budgets[row % len(self.time_budgets)]
        name = self.abstracts[abstract]
        return Case(self.study, number, name, row, self.inputs.names, tuple(values.tolist()), budget, self.seed)

    def _check(self, numbers: NDArray[np.int64]) -> None:
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < self.n_cases):
            asked = f"{numbers.min()} .. {numbers.max()}"
            rule = f"case numbers must lie in 0 .. {self.n_cases - 1}, but {asked} are asked for"
            raise BadRequest(f"study {self.study!r}", rule, slug="case-number")


def combine(
    study: str,
    abstracts: Iterable[AbstractCase | str],
    inputs: InputModel,
    *,
    criterion: str = "each_choice",
    time_budgets: Sequence[float] = (20.0,),
    seed: int = 0,
    n_cases: int | None = None,
) -> Plan:
    """Return the plan of a study.

    Args:
        study: its name.
        abstracts: the abstract cases or their ids, all different.
        inputs: the input model whose rows fill them; without any domain each abstract case has one row, without values.
        criterion: how blocks are combined, a name in `parcours.data.CRITERIA`.
        time_budgets: how long a run may take [s]; every row of data is run with each, shape (n_budgets,).
        seed: the campaign's seed, 0 <= seed < 2**64.
        n_cases: how many cases; by default as many as satisfy the criterion for every abstract case and budget.

    Raises:
        BadRequest: no case is asked for, an abstract case is missing or named twice, or the criterion is unknown.
        BadSuite: a name cannot stand in an id, a time budget is not positive, or the seed is out of range.

    >>> from parcours.data import split
    >>> inputs = InputModel("speed", (split("v", "m/s", [0.0, 0.25, 0.5]),))
    >>> plan = combine("demo", ["together", "apart"], inputs, seed=7)
    >>> [case.id for case in plan.cases()]
    ['demo/together/0', 'demo/apart/0', 'demo/together/1', 'demo/apart/1']
    >>> plan.case(3) == list(plan.cases())[3]
    True
    """
    where = f"study {study!r}"
    ids = tuple(each if isinstance(each, str) else each.id for each in abstracts)
    if not ids or len(set(ids)) != len(ids) or not time_budgets:
        has = f"{len(time_budgets)} and {len(ids)}, {len(set(ids))} of them different"
        rule = f"a plan needs a time budget and different abstract cases, but has {has}"
        raise BadRequest(where, rule, slug="plan-empty")
    for part in (study, *ids):
        if not is_part(part):
            rule = f"an id must consist of letters, digits and _ . + @ = , -, but one is {part[:60]!r}"
            raise BadSuite(where, rule, slug="case-id")
    least = len(ids) * len(time_budgets) * _rows(criterion, inputs)
    wanted = least if n_cases is None else n_cases
    if not 1 <= wanted < 2**63:
        rule = f"the number of cases must lie in 1 .. 2**63 - 1, but is {wanted}"
        raise BadRequest(where, rule, "ask for at least one", slug="case-count")
    for budget in time_budgets:  # an impossible one is refused here, not when its first case is built
        Case(study, 0, ids[0], 0, (), (), budget, seed)
    return Plan(study, ids, inputs, criterion, tuple(map(float, time_budgets)), seed, wanted)


def _rows(criterion: str, inputs: InputModel) -> int:
    """Return how many rows satisfy the criterion: one, without values, where there are no inputs."""
    return count(criterion, inputs.sizes) if inputs.domains else 1
