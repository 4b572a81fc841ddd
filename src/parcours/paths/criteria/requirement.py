"""What a criterion requires: things to visit, each with a walk through the graph that does; and how much it may ask."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from parcours.errors import BadRequest

Kind: TypeAlias = Literal[
    "state", "transitions", "round trip", "definition", "use", "du-path", "channel", "message", "rendezvous"
]
"""What `steps` of a requirement names.

- state: one state; round trip: one state, to be left and found again by a path on which no other comes twice.
- transitions: some, one straight after the other.
- definition: a transition that gives `variable` a value, to be followed by some use of that value.
- use: such a transition, and one that reads the value; du-path: all transitions from the one to the other.
- channel, message: one name; rendezvous: a transition that sends, and one that receives what it sent.
"""

START = ""
"""The step before the first transition of a run, which gives variables their initial values."""


@dataclass(frozen=True, slots=True)
class CoverageRequirement:
    """What a set of paths must visit.

    Attributes:
        machine: the machine, as `Component.machine` in a model with several; empty if it is the model's.
        kind: what the steps name.
        steps: states, transitions or channels; START is the beginning of a run.
        variable: the one defined and used; of criterion `tag` the tag.

    >>> print(CoverageRequirement("lamp", "use", (START, "t4"), "switched"))
    switched: (start) -> t4
    """

    machine: str
    kind: Kind
    steps: tuple[str, ...]
    variable: str = ""

    def __str__(self) -> str:
        shown = [step or "(start)" for step in self.steps]
        if self.kind == "round trip":
            return f"round trip at {shown[0]}"
        if self.kind == "definition":
            return f"{self.variable}: {shown[0]} -> any use"
        if self.kind == "use":
            return f"{self.variable}: {' -> '.join(shown)}"
        if self.kind == "rendezvous":
            return " -> ".join(shown)
        return f"{self.variable}: {' '.join(shown)}" if self.variable else " ".join(shown)


@dataclass(frozen=True, slots=True)
class Goal:
    """A requirement and a walk that meets it: edge numbers of a graph, empty if only a state is to be visited."""

    requirement: CoverageRequirement
    walk: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class RequirementLimits:
    """Bounds on the requirements of one criterion on one graph.

    Attributes:
        count: most requirements.
        steps: most steps in all of them together; each takes 8 bytes.
        work: most steps of the search for them; some two million take a second.
    """

    count: int = 1_000_000
    steps: int = 20_000_000
    work: int = 16_000_000


class RequirementCounter:
    """Counts requirements as they are found, against limits.

    >>> tally = RequirementCounter(RequirementLimits(count=1), "prime paths of 'door'")
    >>> tally.add(3)
    >>> tally.add(3)
    Traceback (most recent call last):
    parcours.errors.BadRequest: prime paths of 'door': there must be at most 1, but the search was stopped at 2 of \
6 steps in all, with more to come; take a weaker criterion, cover parts of the model, or raise the limit \
[too-many-requirements]
    """

    def __init__(self, limits: RequirementLimits, what: str) -> None:
        self.limits, self.what = limits, what
        self.count = self.steps = self.work = 0

    def add(self, steps: int) -> None:
        """Count one requirement with this number of steps. Raises BadRequest: it is one too many, or its steps are."""
        self.count += 1
        self.steps += steps
        if self.count > self.limits.count:
            raise self._refusal(f"at most {self.limits.count}")
        if self.steps > self.limits.steps:
            raise self._refusal(f"at most {self.limits.steps} steps in all of them")
        self.tick()

    def tick(self) -> None:
        """Count one step of the search. Raises BadRequest if it is one too many."""
        self.work += 1
        if self.work > self.limits.work:
            raise self._refusal(f"so few that {self.limits.work} steps of the search find them")

    def _refusal(self, rule: str) -> BadRequest:
        rule = f"there must be {rule}, but the search was stopped at {self.count} of {self.steps} steps in all, "
        remedy = "take a weaker criterion, cover parts of the model, or raise the limit"
        return BadRequest(self.what, f"{rule}with more to come", remedy, slug="too-many-requirements")
