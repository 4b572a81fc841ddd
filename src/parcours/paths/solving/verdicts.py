"""What is known of a requirement: covered by a path that runs, proven infeasible, or undecided."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal, TypeAlias

from parcours.errors import BadRequest
from parcours.model.configuration import Inputs, Move
from parcours.paths.criteria.requirement import CoverageRequirement

BUDGET = 10_000
"""Units of work for one machine, or for one question about a sequence: some 10 s."""

SOLVER_STEPS = 5_000
"""Steps of z3 (its `rlimit`) in one unit of work."""


class BudgetSpent(Exception):
    """The work allowed is done; the text says what came of it."""


@dataclass(slots=True)
class Work:
    """What a search has done, counted so that a busy machine gives the same answers as a quiet one.

    One unit is some 1 ms on a machine of 2025: a state expanded, or a question to the solver with at most
    `SOLVER_STEPS` of its own steps; more of these count in proportion.

    Attributes:
        budget: most units.
        spent: units so far.
        mark: the solver's count of steps when it was last read, if it was.
    """

    budget: float
    spent: float = 0.0
    mark: int | None = None

    def after(self, share: float) -> float:
        """Return what will be spent when a share of what is left is."""
        return self.spent + max(0.0, self.budget - self.spent) * share


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A run from the initial state, with the values that make it run. Two are equal if they are the same object.

    Attributes:
        moves: what to do: transitions, with inputs and contents of messages as ('Component.term', value).
        ends: whether it ends where a test may end.
    """

    moves: tuple[Move, ...]
    ends: bool = True

    @property
    def ids(self) -> tuple[str, ...]:
        """The transitions in the order they are taken; those of a rendezvous one after the other."""
        return tuple(id for move in self.moves for id in (move.transition, move.partner) if id)

    @property
    def inputs(self) -> tuple[Inputs, ...]:
        """The inputs at each of `ids`."""
        return tuple(move.inputs for move in self.moves for id in (move.transition, move.partner) if id)

    def __str__(self) -> str:
        return " ".join(map(str, self.moves))


@dataclass(frozen=True, slots=True)
class Covered:
    """The requirement is met by a path; it was run through the model's step relation."""

    requirement: CoverageRequirement
    path: Path
    verdict: Literal["covered"] = "covered"


@dataclass(frozen=True, slots=True)
class Infeasible:
    """No run of the model can meet the requirement.

    Attributes:
        requirement: what cannot be met.
        proof: what conflicts (guards, actions, ranges, bounds of time), or how all runs were seen.
    """

    requirement: CoverageRequirement
    proof: tuple[str, ...]
    verdict: Literal["infeasible"] = "infeasible"


@dataclass(frozen=True, slots=True)
class Undecided:
    """Neither a path nor a proof was found.

    Attributes:
        requirement: what was asked.
        reason: why it was not decided.
        spent: the work done for it and its companions, in units of `Work`.
    """

    requirement: CoverageRequirement
    reason: str
    spent: int
    verdict: Literal["undecided"] = "undecided"


Verdict: TypeAlias = Covered | Infeasible | Undecided


@dataclass(frozen=True, slots=True)
class Executability:
    """Every requirement in one of three lists, each in their own order; the paths to run; the work done."""

    covered: tuple[Covered, ...]
    infeasible: tuple[Infeasible, ...]
    undecided: tuple[Undecided, ...]
    paths: tuple[Path, ...]
    spent: int = 0

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """All verdicts: covered first, then infeasible, then undecided."""
        return (*self.covered, *self.infeasible, *self.undecided)


def require_solver() -> None:
    """Raise BadRequest unless the solver z3 can be imported."""
    if not has_solver():
        rule = "z3 must be installed to solve guards, but it is not"
        raise BadRequest("solver", rule, "install the extra: pip install 'parcours[solver]'", slug="solver-missing")


def has_solver() -> bool:
    """Return whether the solver z3 can be imported."""
    return find_spec("z3") is not None
