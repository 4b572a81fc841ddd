"""A model, a criterion and the transitions taken -> which requirements they meet, and which they miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Cefsm, Machine
from parcours.paths.criteria import Requirement, requirements


@dataclass(frozen=True, slots=True)
class Coverage:
    """What a criterion requires, and how much of it was met; met and missed partition required."""

    criterion: str
    required: tuple[Requirement, ...]
    met: tuple[Requirement, ...]
    missed: tuple[Requirement, ...]

    @property
    def ratio(self) -> float:
        """The share of the requirements that were met [1]; 1 where nothing is required."""
        return len(self.met) / len(self.required) if self.required else 1.0


def measure(of: Machine | Cefsm, criterion: str, *sequences: Sequence[str]) -> Coverage:
    """Return which requirements the sequences meet, seen machine by machine.

    A machine stands in its initial state before it moves, so that state counts as visited. Two transitions
    are a pair if the machine took them one after the other, whatever other machines did between. Where a
    sequence jumps (a machine was reset) it meets no pair: none is required that does not join.

    Args:
        of: a machine, or a model with all its machines.
        criterion: a name in `parcours.paths.criteria.CRITERIA`.
        sequences: transition ids in the order in which they were taken, one sequence for each run.

    Raises:
        BadRequest: no criterion has that name, or a sequence names a transition that the model does not have.

    >>> from parcours.model.structure import Transition
    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "off")))
    >>> [str(requirement) for requirement in measure(lamp, "edge-pair", ["t1", "t2"]).missed]
    ['t2 t1']
    """
    machines = {of.name: of} if isinstance(of, Machine) else _machines(of)
    owner = {t.id: label for label, machine in machines.items() for t in machine.transitions}
    required: list[Requirement] = []
    for label, machine in machines.items():
        required += (Requirement(label, need.kind, need.steps) for need in requirements(machine, criterion))
    seen = {Requirement(label, "state", (machine.initial,)) for label, machine in machines.items()}
    for sequence in sequences:
        for label, ids in _by_machine(of.name, sequence, owner).items():
            seen |= _visited(label, machines[label], ids)
    met = tuple(need for need in required if need in seen)
    missed = tuple(need for need in required if need not in seen)
    return Coverage(criterion, tuple(required), met, missed)


def _machines(cefsm: Cefsm) -> dict[str, Machine]:
    return {
        f"{component.name}.{machine.name}": machine for component in cefsm.components for machine in component.machines
    }


def _by_machine(name: str, sequence: Sequence[str], owner: dict[str, str]) -> dict[str, list[str]]:
    """Return the part of a sequence that each machine took."""
    parts: dict[str, list[str]] = {}
    for place, id in enumerate(sequence):
        if id not in owner:
            raise BadRequest(
                f"sequence, entry {place}",
                f"must name transitions of '{name}', but {id!r} is none",
                one_of(id, list(owner)),
                slug="foreign-transition",
            )
        parts.setdefault(owner[id], []).append(id)
    return parts


def _visited(label: str, machine: Machine, ids: list[str]) -> set[Requirement]:
    """Return every state, transition and pair that the machine visited."""
    by_id = {transition.id: transition for transition in machine.transitions}
    ends = {state for id in ids for state in (by_id[id].source, by_id[id].target)}
    steps = [*((id,) for id in ids), *pairwise(ids)]
    return {Requirement(label, "state", (state,)) for state in ends} | {
        Requirement(label, "transitions", each) for each in steps
    }
