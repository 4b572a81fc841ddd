"""The executable case: an abstract case, the values that fill it, and the time it may take."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from parcours.errors import BadSuite

_PART = re.compile(r"[A-Za-z0-9_.+@=,-]{1,200}")


def is_part(text: str) -> bool:
    """Return whether the text may stand in a case id: letters, digits and _ . + @ = , - only.

    >>> is_part("ITP4-tp11.tp41+tp42.tp11-3.0"), is_part("a/b"), is_part("..")
    (True, False, False)
    """
    return bool(_PART.fullmatch(text)) and text.strip(".") != ""


@dataclass(frozen=True, slots=True)
class Case:
    """One test that a host can execute; the same case gives the same run wherever it is replayed.

    Attributes:
        study: the study it belongs to.
        number: its place in the study's plan, from 0.
        abstract: id of the abstract case it fills.
        row: which row of data and time budget it takes for that abstract case, from 0.
        names: names of the inputs.
        values: their values, in the units of the input model, shape (n_inputs,).
        time_budget: how long the run may take [s].
        seed: the campaign's seed; every stream of the run derives from it and `number`.

    Raises:
        BadSuite: a part of the id has other characters than an id may have, a number is out of its range, or names and
            values do not match.

    >>> case = Case("lift", 4, "ITP1-tp11.tp21-0.0", 0, ("floor", "load"), (3.0, 1.25), 20.0, seed=7)
    >>> case.id, case["load"]
    ('lift/ITP1-tp11.tp21-0.0/0', 1.25)
    """

    study: str
    number: int
    abstract: str
    row: int
    names: tuple[str, ...]
    values: tuple[float, ...]
    time_budget: float
    seed: int

    def __post_init__(self) -> None:
        where = f"case {self.number}"
        for what, part in (("study", self.study), ("abstract case", self.abstract)):
            if not is_part(part):
                rule = f"the id of its {what} must consist of letters, digits and _ . + @ = , -, but is {part[:60]!r}"
                raise BadSuite(where, rule, slug="case-id")
        if not (0 <= self.number < 2**63 and 0 <= self.row < 2**63) or not 0 <= self.seed < 2**64:
            rule = "number and row must lie in 0 .. 2**63 - 1 and the seed in 0 .. 2**64 - 1, but they are"
            raise BadSuite(where, f"{rule} {self.number}, {self.row} and {self.seed}", slug="case-number")
        if not (math.isfinite(self.time_budget) and self.time_budget > 0):
            raise BadSuite(where, f"a time budget must be positive, but is {self.time_budget} s", slug="time-budget")
        names = set(self.names)
        if len(self.names) != len(self.values) or len(names) != len(self.names):
            rule = f"every input must have one value, but there are {len(self.values)} values for {len(names)}"
            raise BadSuite(where, f"{rule} different names", slug="case-values")
        for name, value in zip(self.names, self.values, strict=True):
            if not (name.isidentifier() and math.isfinite(value)):
                rule = f"a value must be finite and its name an identifier, but {name[:60]!r} is {value}"
                raise BadSuite(where, rule, slug="case-values")

    @property
    def id(self) -> str:
        """The stable id: study, abstract case and row, joined by slashes."""
        return f"{self.study}/{self.abstract}/{self.row}"

    def __getitem__(self, name: str) -> float:
        """Return the value of an input. Raises KeyError if there is none of that name."""
        try:
            return self.values[self.names.index(name)]
        except ValueError:
            raise KeyError(name) from None
