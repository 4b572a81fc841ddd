"""Internal test paths: runs through one machine of a component (paper, Table III)."""

from __future__ import annotations

from dataclasses import dataclass

from parcours.model.structure import Transition


@dataclass(frozen=True, slots=True)
class InternalPath:
    """A run of one machine: consecutive transitions from its initial state, e.g. tp11 of Table III.

    >>> tp = InternalPath("tp11", "Lamp", "light", (
    ...     Transition("p11", "off", "on"), Transition("p12", "on", "off")))
    >>> tp.states, tp.is_closed
    (('off', 'on', 'off'), True)
    """

    name: str
    component: str
    machine: str
    transitions: tuple[Transition, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """The transition ids along the path."""
        return tuple(transition.id for transition in self.transitions)

    @property
    def states(self) -> tuple[str, ...]:
        """The state occurrences along the path, one more than its transitions."""
        if not self.transitions:
            return ()
        return (self.transitions[0].source, *(transition.target for transition in self.transitions))

    @property
    def is_closed(self) -> bool:
        """Whether the path ends in the state it began in."""
        return bool(self.transitions) and self.transitions[0].source == self.transitions[-1].target

    @property
    def changes(self) -> tuple[int, ...]:
        """The positions, from 0, of the transitions that leave one state for another."""
        return tuple(place for place, transition in enumerate(self.transitions) if not transition.is_loop)

    def __str__(self) -> str:
        return f"{self.name} = {' '.join(self.ids)}"
