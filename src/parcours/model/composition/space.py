"""The state space that an exploration returns: configurations, the moves between them, and its discoveries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.model.composition.packing import Packing
from parcours.model.configuration import Configuration, Move
from parcours.model.structure import Cefsm

Numbers = NDArray[np.int32]

SEVERITY: dict[str, Literal["error", "warning", "note"]] = {
    **dict.fromkeys(("deadlock", "unspecified-reception", "blocked-reception", "model-fault"), "error"),
    **dict.fromkeys(("full-queue", "dead-transition", "unreachable-state"), "warning"), "rest": "note",
}  # fmt: skip
"""What can be discovered (docs/composition.md) and how grave it is: a warning may be meant, a note is no fault."""


@dataclass(frozen=True, slots=True)
class Discovery:
    """One thing that the exploration came upon.

    Args:
        kind: what it is, a key of SEVERITY.
        message: a sentence that names the elements of the model.
        state: the number of the nearest configuration that shows it, for `Space.path_to`; None where the
            whole space is the evidence.
        count: how many configurations show it; 0 where that is not counted.
        move: the move that the step relation refuses there; None otherwise.
    """

    kind: str
    message: str
    state: int | None = None
    count: int = 0
    move: Move | None = None

    @property
    def severity(self) -> Literal["error", "warning", "note"]:
        """How grave it is."""
        return SEVERITY[self.kind]

    def __str__(self) -> str:
        return f"{self.severity}: {self.message} [{self.kind}]"


@dataclass(frozen=True, eq=False)
class Space:
    """The reachable configurations of a model, numbered breadth first from the initial one, 0.

    Attributes:
        cefsm: the model.
        packing: how its configurations are packed.
        packed: the configurations, in the order of their distance from the initial one.
        parents: the configuration that each was first reached from, itself for the initial one, shape
            (n_states,).
        arrivals: the number of the move that first led there, -1 for the initial one, shape (n_states,).
        moves: the different moves taken anywhere.
        offsets: where the edges of each expanded configuration begin, shape (n_expanded + 1,).
        targets: the configuration that each edge enters, grouped by the one that it leaves, shape (n_edges,).
        labels: the number in `moves` of each edge's move, shape (n_edges,).
        seconds: how long it took [s].
        stopped: why it ended before everything was expanded, as a sentence; empty if nothing is left.
        findings: what it came upon, gravest kinds first.
        doubts: why runs may do more than is in here even if nothing is left to expand: for each transition whose
            open values were not all tried although they matter later, a sentence.
    """

    cefsm: Cefsm
    packing: Packing
    packed: list[int]
    parents: Numbers
    arrivals: Numbers
    moves: tuple[Move, ...]
    offsets: NDArray[np.int64]
    targets: Numbers
    labels: Numbers
    seconds: float
    stopped: str = ""
    findings: tuple[Discovery, ...] = ()
    doubts: tuple[str, ...] = ()

    @property
    def n_states(self) -> int:
        """How many configurations were met."""
        return len(self.packed)

    @property
    def n_expanded(self) -> int:
        """How many of them had all their moves taken."""
        return len(self.offsets) - 1

    @property
    def n_transitions(self) -> int:
        """How many moves lead from the expanded configurations."""
        return len(self.targets)

    @property
    def complete(self) -> bool:
        """Whether everything that the step relation offers was expanded."""
        return not self.stopped

    @property
    def exact(self) -> bool:
        """Whether what is not in here cannot happen: the space is complete, and no other choice matters."""
        return self.complete and not self.doubts

    @cached_property
    def sources(self) -> Numbers:
        """The configuration that each edge leaves, shape (n_edges,)."""
        return np.repeat(np.arange(self.n_expanded, dtype=np.int32), np.diff(self.offsets))

    def configuration(self, state: int) -> Configuration:
        """Return the configuration that has a number. Raises BadRequest if none has."""
        return self.packing.unpack(self.packed[self._known(state)])

    def path_to(self, state: int) -> tuple[Move, ...]:
        """Return a shortest run from the initial configuration, as moves that `parcours.model.step` takes.

        Raises:
            BadRequest: no configuration has that number.
        """
        moves: list[Move] = []
        at = self._known(state)
        while at:
            moves.append(self.moves[self.arrivals[at]])
            at = int(self.parents[at])
        return tuple(reversed(moves))

    def rests(self) -> list[int]:
        """Return the configurations at rest: empty queues, every machine in a final state or one with no way out.

        There the system may stop; elsewhere, that no move is possible is a deadlock.
        """
        queues = sum(cell.mask for cell in self.packing.queues.values())
        cells = []
        for cell, machine in zip(self.packing.states, self.packing.machines, strict=True):
            left = {transition.source for transition in machine.transitions}
            ends = [state in machine.final or state not in left for state in cell.things]
            cells.append((cell.mask, cell.shift, ends))
        return [
            state
            for state, packed in enumerate(self.packed)
            if not packed & queues and all(ends[(packed & mask) >> shift] for mask, shift, ends in cells)
        ]

    def _known(self, state: int) -> int:
        if not 0 <= state < self.n_states:
            rule = f"a configuration has a number from 0 to {self.n_states - 1}, but {state} was given"
            raise BadRequest("space", rule, "take one of its findings' `state`", slug="unknown-configuration")
        return state
