"""The component graph of a model, and interaction test paths (ITPs) through it (paper, Table IV).

A node of the component graph is a component; an edge is a pair of components that a channel links (Table I).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from parcours.errors import require_known
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
        """The (sender, receiver) pairs along the path; none where components only run side by side."""
        return () if self.criterion == TOGETHER else tuple(pairwise(self.components))

    def __str__(self) -> str:
        return f"{self.name}: {(' || ' if self.criterion == TOGETHER else ' -> ').join(self.components)}"


def component_graph(cefsm: Cefsm) -> dict[tuple[str, str], tuple[Channel, ...]]:
    """Return the edges (sender, receiver) of the component graph with their channels, in file order.

    The environment is not a node of the graph: what it sends is test data, not an interaction.
    """
    edges: dict[tuple[str, str], list[Channel]] = {}
    for channel in cefsm.channels:
        if ENVIRONMENT not in (channel.sender, channel.receiver) and channel.sender != channel.receiver:
            edges.setdefault((channel.sender, channel.receiver), []).append(channel)
    return {edge: tuple(channels) for edge, channels in edges.items()}


def partners(cefsm: Cefsm) -> dict[str, int]:
    """Return with how many others each component shares a channel, in file order."""
    edges = component_graph(cefsm)
    return {
        component.name: len({other for edge in edges if component.name in edge for other in edge} - {component.name})
        for component in cefsm.components
    }


def hub(cefsm: Cefsm) -> str | None:
    """Return the component that shares channels with most others, the first in the file among equals.

    A model whose components share no channel has no hub.
    """
    counts = partners(cefsm)
    most = max(counts.values(), default=0)
    return next((name for name, count in counts.items() if most and count == most), None)


def _round_trips(cefsm: Cefsm) -> tuple[InteractionPath, ...]:
    """One path out and back for each pair that talks both ways, from the one with more partners."""
    edges, counts = component_graph(cefsm), partners(cefsm)
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


def _specified(cefsm: Cefsm) -> tuple[InteractionPath, ...]:
    return tuple(InteractionPath(name, "SPC", components) for name, components in cefsm.interactions)


def _together(cefsm: Cefsm) -> tuple[InteractionPath, ...]:
    return (InteractionPath(TOGETHER, TOGETHER, tuple(component.name for component in cefsm.components)),)


CRITERIA: dict[str, Callable[[Cefsm], tuple[InteractionPath, ...]]] = {
    "EPC": _round_trips,
    "SPC": _specified,
    TOGETHER: _together,
}
"""Interaction criteria by name.

EPC: one round trip for each pair of components that talk both ways (so the paper uses edge-pair coverage).
SPC: the paths that the model file specifies. together: all components at once.
"""


def interaction_paths(cefsm: Cefsm, criterion: str | None = None) -> tuple[InteractionPath, ...]:
    """Return the interaction test paths that a criterion asks for.

    Args:
        cefsm: the model.
        criterion: a name in `CRITERIA`. By default EPC, then SPC; `together` if no two components share a channel.

    Raises:
        BadRequest: no criterion has that name.

    >>> from parcours.model.structure import Component
    >>> ring = Cefsm("ring", (Component("A", ()), Component("B", ())),
    ...              (Channel("ask", "A", "B", "Text"), Channel("answer", "B", "A", "Text")))
    >>> [str(path) for path in interaction_paths(ring)]
    ['ITP1: A -> B -> A']
    """
    if criterion is None:
        chosen = ["EPC", "SPC"] if component_graph(cefsm) else [TOGETHER]
        return tuple(path for name in chosen for path in CRITERIA[name](cefsm))
    require_known(criterion, list(CRITERIA), "interaction criterion", slug="unknown-interaction-criterion")
    return CRITERIA[criterion](cefsm)
