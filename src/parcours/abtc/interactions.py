"""The component graph of a model, and interaction test paths (ITPs) through it (paper, Tables I and IV)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from parcours.model.structure import ENVIRONMENT, Cefsm, Channel

TOGETHER = "together"
"""The criterion, and the name of its only path, for components that share no channel (paper, section V-C)."""


@dataclass(frozen=True, slots=True)
class InteractionPath:
    """The components that take turns in an interaction, such as ITP1: Planner, TrajectoryGenerator, Planner."""

    name: str
    criterion: str
    components: tuple[str, ...]

    @property
    def hops(self) -> tuple[tuple[str, str], ...]:
        """The (sender, receiver) pairs along the path; empty where components only run side by side."""
        return () if self.criterion == TOGETHER else tuple(pairwise(self.components))

    def __str__(self) -> str:
        return f"{self.name}: {(' || ' if self.criterion == TOGETHER else ' -> ').join(self.components)}"


def component_graph(cefsm: Cefsm) -> dict[tuple[str, str], tuple[Channel, ...]]:
    """Return the edges (sender, receiver) between different components with their channels, in file order."""
    edges: dict[tuple[str, str], tuple[Channel, ...]] = {}
    for channel in cefsm.channels:
        ends = channel.sender, channel.receiver
        # The environment is not a node of the graph: what it sends is test data, not an interaction.
        if ENVIRONMENT not in ends and channel.sender != channel.receiver:
            edges[ends] = (*edges.get(ends, ()), channel)
    return edges


def _partners(cefsm: Cefsm) -> dict[str, int]:
    # With how many others each component shares a channel.
    edges, names = component_graph(cefsm), [component.name for component in cefsm.components]
    return {name: len({other for edge in edges if name in edge for other in edge} - {name}) for name in names}


def hub(cefsm: Cefsm) -> str | None:
    """Return the component that shares channels with most others, the first among equals; None without channels."""
    counts = _partners(cefsm)
    return max(counts, key=lambda name: counts[name]) if any(counts.values()) else None


def _round_trips(cefsm: Cefsm) -> tuple[InteractionPath, ...]:
    """EPC: one path out and back for each pair that talks both ways, from the one with more partners."""
    edges, counts = component_graph(cefsm), _partners(cefsm)
    order = list(counts)
    taken = {name for name, _ in cefsm.interactions}
    names = (f"ITP{number}" for number in range(1, 2 + len(edges) + len(taken)))
    free = (name for name in names if name not in taken)
    trips: dict[frozenset[str], InteractionPath] = {}
    for sender, receiver in edges:
        pair = frozenset((sender, receiver))
        if (receiver, sender) in edges and pair not in trips:
            out, back = sorted(pair, key=lambda name: (-counts[name], order.index(name)))
            trips[pair] = InteractionPath(next(free), "EPC", (out, back, out))
    return tuple(trips.values())


def interaction_paths(cefsm: Cefsm) -> tuple[InteractionPath, ...]:
    """Return the interaction test paths: round trips (EPC), then those that the model file specifies (SPC).

    If no two components share a channel, all of them run together instead.

    >>> from parcours.model.structure import Component
    >>> ring = Cefsm("ring", (Component("A", ()), Component("B", ())),
    ...              (Channel("ask", "A", "B", "Text"), Channel("answer", "B", "A", "Text")))
    >>> [str(path) for path in interaction_paths(ring)]
    ['ITP1: A -> B -> A']
    """
    if not component_graph(cefsm):
        return (InteractionPath(TOGETHER, TOGETHER, tuple(component.name for component in cefsm.components)),)
    return _round_trips(cefsm) + tuple(InteractionPath(name, "SPC", path) for name, path in cefsm.interactions)
