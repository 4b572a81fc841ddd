"""Counts which blocks the values of a table hit, whatever was intended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.data.domains import OUTSIDE
from parcours.data.inputs import InputModel
from parcours.errors import BadRequest


@dataclass(frozen=True, slots=True)
class BlockCoverage:
    """How often each block of each parameter was hit, and how many values lay in no block.

    `model` says which parameters and blocks are meant; `counts` has one entry a block, the invalid ones last;
    `outside` one entry a parameter. Coverages of parts of a campaign add up: `whole = first + second`.
    """

    model: InputModel
    counts: tuple[tuple[int, ...], ...]
    outside: tuple[int, ...]
    n_rows: int

    def __add__(self, other: BlockCoverage) -> BlockCoverage:
        """Return the coverage of both tables together. Raises BadRequest if their input models differ."""
        if self.model != other.model:
            raise BadRequest(
                "block coverage",
                f"only coverages of one input model add up, but these are of"
                f" {self.model.name!r} and {other.model.name!r}, or of different versions of it",
                slug="coverage-model",
            )
        counts = tuple(
            tuple(a + b for a, b in zip(mine, theirs, strict=True))
            for mine, theirs in zip(self.counts, other.counts, strict=True)
        )
        outside = tuple(a + b for a, b in zip(self.outside, other.outside, strict=True))
        return BlockCoverage(self.model, counts, outside, self.n_rows + other.n_rows)

    @property
    def n_blocks(self) -> int:
        """The number of blocks there are to hit, those for negative tests included."""
        return sum(len(domain.choices) for domain in self.model.domains)

    @property
    def n_hit(self) -> int:
        """The number of blocks hit at least once."""
        return sum(count > 0 for counts in self.counts for count in counts)

    @property
    def uncovered(self) -> tuple[str, ...]:
        """The blocks that no value hit, as `parameter in block unit`, or `parameter = name`."""
        return tuple(
            f"{domain.name} = {block.name}" if block.name else f"{domain.name} in {block} {domain.unit}"
            for domain, counts in zip(self.model.domains, self.counts, strict=True)
            for block, count in zip(domain.choices, counts, strict=True)
            if not count
        )

    @property
    def is_complete(self) -> bool:
        """Whether every block was hit and no value lay outside: these values satisfy Each Choice."""
        return not self.uncovered and not any(self.outside)


def cover(model: InputModel, table: NDArray[np.float64]) -> BlockCoverage:
    """Return which blocks a table of values hits.

    Args:
        model: the input model whose blocks are meant.
        table: values in the units of the domains, shape (n_rows, n_parameters); no row at all is a table too.

    Raises:
        BadRequest: the table has another number of columns than the model has parameters.

    >>> from parcours.data.domains import split
    >>> model = InputModel("m", (split("v", "m/s", [0.0, 0.25, 0.5]),))
    >>> coverage = cover(model, np.array([[0.1], [0.25], [0.9]]))
    >>> coverage.counts, coverage.outside, coverage.uncovered
    (((2, 0),), (1,), ('v in (0.25, 0.5] m/s',))
    """
    if table.ndim != 2 or table.shape[1] != len(model.domains):
        rule = f"a table must have {len(model.domains)} columns, but its shape is {table.shape}"
        raise BadRequest("block coverage", rule, slug="table-shape")
    counts, outside = [], []
    for column, domain in enumerate(model.domains):
        index = domain.blocks_of(table[:, column])
        hits = np.bincount(index[index != OUTSIDE], minlength=len(domain.choices))
        counts.append(tuple(int(hit) for hit in hits))
        outside.append(int(np.sum(index == OUTSIDE)))
    return BlockCoverage(model, tuple(counts), tuple(outside), len(table))
