"""What a criterion requires: things to visit, each with a walk through the graph that does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

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
class Requirement:
    """What a set of paths must visit.

    Attributes:
        machine: the machine, as `Component.machine` in a model with several; empty if it is the model's.
        kind: what the steps name.
        steps: states, transitions or channels; START is the beginning of a run.
        variable: the one defined and used.

    >>> print(Requirement("lamp", "use", (START, "t4"), "switched"))
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

    requirement: Requirement
    walk: tuple[int, ...]
