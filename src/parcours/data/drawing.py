"""Draws values for rows of blocks: by seed, uniform in their blocks, within the constraints.

Each case draws from a stream of its own, fixed by (campaign seed, case number). A row that breaks a
constraint is drawn again as a whole, inside the same blocks; so values are uniform over that part of the
blocks where the constraints hold.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from parcours.data.constraints import Constraint, meets
from parcours.data.domains import Domain
from parcours.data.inputs import InputModel, rules_of
from parcours.data.selecting import Rows
from parcours.errors import BadDomain, BadRequest
from parcours.streams import VALUES, starts, uniforms

TRIES = 100_000
"""How often a row is drawn before its constraints count as unmeetable within its blocks."""

_SECOND = 16
"""Draws of the second pass: few rows need more, and a pass of 16 draws takes hardly longer than a pass of one."""

_MOST_DRAWS, _MOST_ROWS = 4096, 1 << 16  # draws of one row, and draws in all, that are looked at together


def draw(
    model: InputModel, rows: Rows, cases: NDArray[np.int64], *, seed: int = 0, tries: int = TRIES
) -> NDArray[np.float64]:
    """Return one row of values a case, shape (n_cases, n_parameters), in the units of the domains.

    A row has the same bits whichever cases are drawn with it, and in whichever order.

    Args:
        model: the inputs and the constraints on them.
        rows: the block each value is drawn from, shape (n_cases, n_parameters).
        cases: case numbers, not negative, shape (n_cases,).
        seed: the campaign's seed, 0 <= seed < 2**64.
        tries: how often a row may be drawn.

    Raises:
        BadRequest: the shapes do not fit together, or a block index, a case number or the seed is out of
            range; a row breaks a rule over blocks.
        BadDomain: the constraints were not met within the blocks of some case in `tries` draws.
    """
    checked(model, rows, cases)
    limits = _limits(model, rows)
    start = starts(seed, cases, VALUES)
    values = np.empty(rows.shape)
    constraints = [constraint for constraint in model.constraints if constraint.over == "values"]
    met = np.zeros((len(cases), len(constraints)), dtype=np.int64)
    left = np.arange(len(cases))  # which rows still break a constraint
    done = 0
    # Values of a row are drawn in passes, which grow: most rows need one draw, a few need thousands.
    #
    #     pass    draws of each row that is left       rows left
    #       1     0                                    all
    #       2     1 .. 16                              those whose first draw broke a rule
    #       3     17 .. 33                             ...
    #
    # Draw k of a row uses words k * n_inputs .. (k + 1) * n_inputs - 1 of its own stream, whatever is drawn with it.
    while left.size and done < tries:
        # How many draws a pass looks at depends on the pass alone: so a row never depends on its company.
        n = min(max(done, _SECOND) if done else 1, tries - done, _MOST_DRAWS)
        failed = []
        for part in np.array_split(left, max(1, len(left) * n // _MOST_ROWS)):
            drawn = _drawn(model, start[part], [limit[part] for limit in limits], done, n)
            columns = {name: drawn[:, :, column].ravel() for column, name in enumerate(model.names)}
            good = np.ones((len(part), n), dtype=bool)
            for index, constraint in enumerate(constraints):
                fine = meets(constraint, columns).reshape(len(part), n)
                met[part, index] += fine.sum(axis=1)
                good &= fine
            values[part] = drawn[np.arange(len(part)), good.argmax(axis=1)]  # the first good draw of each row
            failed.append(part[~good.any(axis=1)])
        left = np.concatenate(failed)
        done += n
    if left.size:
        worst = constraints[int(np.argmin(met[left[0]]))]
        raise _unmeetable(model, worst, rows[left[0]], int(cases[left[0]]), int(met[left[0]].min()), tries)
    return values


def _drawn(
    model: InputModel, start: NDArray[np.uint64], limits: list[NDArray[np.float64]], done: int, n: int
) -> NDArray[np.float64]:
    """Return draws number `done` .. `done + n - 1` of each row, shape (n_rows, n, n_parameters)."""
    n_inputs = len(model.domains)
    low, width, first, last = (limit[:, np.newaxis] for limit in limits)
    words = uniforms(start, done * n_inputs, n * n_inputs).reshape(len(start), n, n_inputs)
    drawn = low + width * words
    whole = np.array([domain.kind in ("integer", "enumeration") for domain in model.domains])
    drawn = np.where(whole, np.floor(drawn), drawn)
    # Rounding may push a value onto an open end, so the block's own first and last number are the limits.
    drawn = np.clip(drawn, first, last)
    for column, domain in enumerate(model.domains):
        if domain.kind == "angle":
            drawn[:, :, column] = _turned(drawn[:, :, column])
    return drawn


def _turned(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles from -pi .. 3 pi as those in (-pi, pi]; beyond pi the difference is exact."""
    turn = 2.0 * math.pi
    angles = np.where(angles > math.pi, angles - turn, angles)
    return np.where(angles <= -math.pi, angles + turn, angles)


def _limits(model: InputModel, rows: Rows) -> tuple[NDArray[np.float64], ...]:
    """Return low end, width, first and last value of the block of each value; each of the shape of `rows`."""
    tables = [np.array(ends_of(domain)) for domain in model.domains]
    ends = np.stack([table[rows[:, column]] for column, table in enumerate(tables)], axis=1)
    return ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0], ends[:, :, 2], ends[:, :, 3]


def ends_of(domain: Domain) -> list[tuple[float, float, float, float]]:
    """Return low end, high end, first and last value of each block of the domain."""
    return [_ends(domain, index) for index in range(len(domain.choices))]


def _ends(domain: Domain, index: int) -> tuple[float, float, float, float]:
    block = domain.choices[index]
    if domain.kind in ("real", "angle"):
        return block.low, block.high, block.first, block.last
    first, last = math.ceil(block.first), math.floor(block.last)
    return first, last + 1.0, first, last


def checked(model: InputModel, rows: Rows, cases: NDArray[np.int64]) -> None:
    """Raise BadRequest as `draw` does for rows and cases that do not fit the model."""
    where, shape = f"input model {model.name!r}", (len(cases), len(model.domains))
    if rows.shape != shape:
        raise BadRequest(where, f"rows must have the shape {shape}, but have {rows.shape}", slug="rows-shape")
    sizes = [len(domain.choices) for domain in model.domains]
    if rows.size and (rows.min() < 0 or (rows >= np.array(sizes)).any()):
        rule = f"a block index must be at least 0 and below the number of blocks of its parameter, {sizes}"
        raise BadRequest(where, rule, slug="block-index")
    # Rules over values are met by drawing again; no draw can mend a rule over blocks.
    ruled = {constraint.name for constraint in model.constraints if constraint.over == "blocks"}
    if not ruled:
        return
    rules = rules_of(model)
    broken = rules.broken(rows) & np.array([table.name in ruled for table in rules.tables], dtype=bool)
    for row, index in np.argwhere(broken)[:1]:
        table = rules.tables[index]
        words = model.in_words([(c, rows[row, c]) for c in table.columns])
        rule = f"a row must break no rule over blocks, but {words} breaks {table.name!r}"
        remedy = "choose rows that the rules allow, as `choose` does"
        raise BadRequest(f"{where}, case {cases[row]}", rule, remedy, slug="block-rule")


def _unmeetable(
    model: InputModel, worst: Constraint, row: NDArray[np.int64], case: int, met: int, tries: int
) -> BadDomain:
    blocks = ", ".join(
        f"{domain.name} in {domain.choices[block].label} {domain.unit}"
        for domain, block in zip(model.domains, row, strict=True)
        if domain.name in worst.inputs
    )
    rule = (
        f"all constraints must hold together within {tries} draws, but none of these met all of them, and"
        f" {worst.name!r} ({worst.text or worst.expression}) held in {met} within {blocks}"
    )
    where, remedy = f"input model {model.name!r}, case {case}", "loosen the constraint or widen the blocks"
    return BadDomain(where, rule, remedy, slug="constraint-unmet")
