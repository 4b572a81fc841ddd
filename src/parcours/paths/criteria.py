"""A machine and a coverage criterion -> test requirements.

The criteria are those of Ammann & Offutt, Introduction to Software Testing, 2008, chapter 2. Only what the
machine's graph can reach from its initial state is required; guards are not solved here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from parcours.errors import require_known
from parcours.model.structure import Machine, Transition


@dataclass(frozen=True, slots=True)
class Requirement:
    """What a set of paths must visit: one state, or some transitions one straight after the other."""

    machine: str
    kind: Literal["state", "transitions"]
    steps: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join(self.steps)


def reachable_states(machine: Machine) -> tuple[str, ...]:
    """Return the states that the graph reaches from the initial one, nearest first, ties in file order.

    >>> lamp = Machine("lamp", "off", ("off", "on", "lost"), (Transition("t1", "off", "on"),))
    >>> reachable_states(lamp)
    ('off', 'on')
    """
    leaving = transitions_by_source(machine)
    found = {machine.initial: None}
    queue = [machine.initial]
    for state in queue:
        for transition in leaving.get(state, ()):
            if transition.target not in found:
                found[transition.target] = None
                queue.append(transition.target)
    return tuple(found)


def reachable_transitions(machine: Machine) -> tuple[Transition, ...]:
    """Return the transitions that leave reachable states, in file order."""
    states = set(reachable_states(machine))
    return tuple(transition for transition in machine.transitions if transition.source in states)


def transitions_by_source(machine: Machine) -> dict[str, list[Transition]]:
    """Return for each state that has any, its leaving transitions in file order."""
    leaving: dict[str, list[Transition]] = {}
    for transition in machine.transitions:
        leaving.setdefault(transition.source, []).append(transition)
    return leaving


def _nodes(machine: Machine) -> tuple[Requirement, ...]:
    return tuple(Requirement(machine.name, "state", (state,)) for state in reachable_states(machine))


def _edges(machine: Machine) -> tuple[Requirement, ...]:
    return tuple(Requirement(machine.name, "transitions", (t.id,)) for t in reachable_transitions(machine))


def _edge_pairs(machine: Machine) -> tuple[Requirement, ...]:
    """Paths of two transitions, and single ones that no pair contains, so that edge coverage is subsumed."""
    leaving = transitions_by_source(machine)
    transitions = reachable_transitions(machine)
    pairs = [(first.id, second.id) for first in transitions for second in leaving.get(first.target, ())]
    paired = {id for pair in pairs for id in pair}
    alone = [(transition.id,) for transition in transitions if transition.id not in paired]
    return tuple(Requirement(machine.name, "transitions", steps) for steps in [*pairs, *alone])


CRITERIA: dict[str, Callable[[Machine], tuple[Requirement, ...]]] = {
    "node": _nodes,
    "edge": _edges,
    "edge-pair": _edge_pairs,
}
"""Coverage criteria by name: each is a function from a machine to its requirements."""


def requirements(machine: Machine, criterion: str = "edge") -> tuple[Requirement, ...]:
    """Return what the criterion requires of a machine, in file order and each once.

    Args:
        machine: the machine to cover.
        criterion: a name in `CRITERIA`.

    Raises:
        BadRequest: no criterion has that name.

    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "off")))
    >>> [str(requirement) for requirement in requirements(lamp, "edge-pair")]
    ['t1 t2', 't2 t1']
    """
    require_known(criterion, list(CRITERIA), "coverage criterion", slug="unknown-criterion")
    return CRITERIA[criterion](machine)
