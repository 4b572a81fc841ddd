"""A machine -> its graph in numbers: what every criterion and every cover walks on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.model.structure import Machine


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """A directed multigraph with a start, all of it reachable from there.

    Attributes:
        name: of the machine, or of the composition.
        states: names of the states, numbered from 0; the start is state 0.
        edges: names of the edges (transition ids, or moves of a composition), numbered from 0 in file order.
        sources: the state each edge leaves, shape (n_edges,).
        targets: the state each edge enters, shape (n_edges,).
        finals: the states where a path may end, ascending; every state leads to one of them.
    """

    name: str
    states: tuple[str, ...]
    edges: tuple[str, ...]
    sources: NDArray[np.int64]
    targets: NDArray[np.int64]
    finals: tuple[int, ...]

    def leaving(self) -> list[list[int]]:
        """Return for each state the edges that leave it, in order."""
        found: list[list[int]] = [[] for _ in self.states]
        for edge, source in enumerate(self.sources.tolist()):
            found[source].append(edge)
        return found
