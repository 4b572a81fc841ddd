"""The input model: domains in the order of the columns, the rules a row must meet, and what to combine more closely."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.data.blocks import Block
from parcours.data.bounds import Bounds, may_hold
from parcours.data.constraints import Constraint, Over, meets
from parcours.data.domains import Domain
from parcours.data.naming import flat, numbered_words
from parcours.data.rules import MAX_CELLS, Rules, RuleTable
from parcours.errors import BadDomain, BadModel, BadRequest
from parcours.model.expression import BOOL, INT, REAL, Expression, Type, names, type_of


@dataclass(frozen=True, slots=True)
class Group:
    """Inputs that are combined by a strength of their own (mixed strength): all blocks of every `strength` of them."""

    inputs: tuple[str, ...]
    strength: int


@dataclass(frozen=True, slots=True)
class InputModel:
    """The inputs of a test in order, the rules a row of their values must meet, and where both come from.

    `domains` has the order of the columns of every table of rows or values; `constraints` speak of domain
    names only.
    """

    name: str
    domains: tuple[Domain, ...]
    constraints: tuple[Constraint, ...] = ()
    source: str = ""
    doc: str = ""
    repeat: int = 1
    groups: tuple[Group, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the inputs, in column order."""
        return tuple(domain.name for domain in self.domains)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of valid blocks of each input, in column order."""
        return tuple(len(domain.blocks) for domain in self.domains)

    @property
    def column_groups(self) -> list[tuple[list[int], int]]:
        """The columns of each group with its strength."""
        return [([self.names.index(name) for name in group.inputs], group.strength) for group in self.groups]

    def blocks_of(self, table: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index of the block of each value, OUTSIDE where it lies in none, shape (n_rows, n_inputs).

        Raises:
            BadRequest: the table has another number of columns than the model has inputs.
        """
        if table.ndim != 2 or table.shape[1] != len(self.domains):
            rule = f"a table must have {len(self.domains)} columns, but its shape is {table.shape}"
            raise BadRequest(f"input model {self.name!r}", rule, slug="table-shape")
        return np.stack([domain.blocks_of(table[:, c]) for c, domain in enumerate(self.domains)], axis=1)

    def in_words(self, blocks: Sequence[tuple[int, int]]) -> str:
        """Return (column, block) pairs in words: `x1 = [0.5, 1], mode = auto`."""
        return ", ".join(f"{self.domains[c].name} = {self.domains[c].choices[b].label}" for c, b in blocks)


def constraint_of(
    name: str, rule: Expression, domains: Collection[Domain], *, over: Over = "values", doc: str = ""
) -> Constraint:
    """Return the constraint that a condition stands for, after checking that its names and types are right.

    Args:
        rule: the condition; names of an enumeration, or of blocks, stand in it as texts.
        domains: the inputs that it may speak of.
        over: whether it speaks of values or of blocks.

    Raises:
        BadModel: a name is unknown, or something is compared with what it cannot be.
    """
    rule, where = flat(rule, {d.name for d in domains}), f"constraint {name!r}"
    # Only inputs that the rule names are typed: a model of 1000 columns has as many rules.
    spoken = names(rule)
    known = [d for d in domains if d.name in spoken]
    if len(known) < len(spoken):
        known = list(domains)  # an unknown name is answered with all that are known
    words = {d.name: d.labels if over == "blocks" else d.values for d in known}
    types = {d.name: _type_of(d, words[d.name]) for d in known}
    given = type_of(rule, types, where=where)
    if given != BOOL:
        raise BadModel(where, f"it must be true or false, but is {given}", "compare it", slug="type")
    numbers = numbered_words(rule, {column: known for column, known in words.items() if known})
    return Constraint(name, numbers, doc, over, str(rule) if numbers != rule else "")


def _type_of(domain: Domain, words: tuple[str, ...]) -> Type:
    if words:
        return Type("enum", words)
    return INT if domain.kind == "integer" else REAL


@functools.lru_cache(maxsize=64)
def rules_of(model: InputModel) -> Rules:
    """Return which combinations of blocks the constraints of a model allow.

    A rule over blocks is what it says. A rule over values forbids those combinations of blocks in which no value can
    meet it, as interval arithmetic proves; for single values and names that is exact.

    Raises:
        BadDomain: the constraints leave no row, or a rule over blocks speaks of more than MAX_CELLS combinations.
    """
    found = [table for constraint in model.constraints if (table := _table(model, constraint))]
    return Rules(model.sizes, found, f"input model {model.name!r}")


def _table(model: InputModel, constraint: Constraint) -> RuleTable | None:
    inputs = constraint.inputs
    columns = tuple(column for column, domain in enumerate(model.domains) if domain.name in inputs)
    shape = [len(model.domains[column].choices) for column in columns]
    where = f"constraint {constraint.name!r}"
    if math.prod(shape) > MAX_CELLS:
        if constraint.over == "values":
            return None  # drawing values will tell
        rule = f"at most {MAX_CELLS} combinations of blocks are looked at, but these are {math.prod(shape)}"
        raise BadDomain(where, rule, "split it into rules over fewer inputs", slug="rule-size")
    cells = [axis.ravel() for axis in np.indices(shape)]
    if constraint.over == "blocks":
        blocks = {model.names[c]: cell.astype(np.float64) for c, cell in zip(columns, cells, strict=True)}
        allowed = meets(constraint, blocks) if columns else np.array([True])
    else:
        bounds: dict[str, Bounds] = {}
        for column, cell in zip(columns, cells, strict=True):
            ends = np.array([extent(model.domains[column], block) for block in model.domains[column].choices])
            bounds[model.names[column]] = (ends[cell, 0], ends[cell, 1])
        allowed = np.broadcast_to(may_hold(constraint.expression, bounds), (math.prod(shape),))
    return RuleTable(constraint.name, columns, allowed.reshape(shape))


def extent(domain: Domain, block: Block) -> tuple[float, float]:
    """Return the least and the greatest value that is drawn from a block [unit]."""
    if domain.kind in ("integer", "enumeration"):
        return math.ceil(block.first), math.floor(block.last)
    if domain.kind == "angle" and block.last > math.pi:
        turn = 2.0 * math.pi
        return (block.first - turn, block.last - turn) if block.first > math.pi else (-math.pi, math.pi)
    return block.first, block.last
