"""The walks that each machine of a model did in recorded sequences of transitions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Cefsm, Machine
from parcours.paths.criteria.requiring import CoverageSubject, edge_names
from parcours.paths.graph import Graph

UNREACHABLE = -1
"""The edge of a transition that leaves a state which the graph does not reach."""

Known = TypeVar("Known")


@dataclass(slots=True)
class Walks:
    """What one machine did.

    Attributes:
        walks: of its graph, one straight piece each.
        begins: whether each walk is the beginning of a run, in the initial state.
    """

    walks: list[list[int]]
    begins: list[bool]


def walks_of(
    of: Machine | Cefsm | Graph, asked: Sequence[CoverageSubject], sequences: Sequence[Sequence[str]]
) -> list[Walks]:
    """Return what each machine did in the sequences."""
    if isinstance(of, Graph):
        parts = [[_along(of, sequence)] for sequence in sequences]
    else:
        known: dict[str, list[tuple[int, int]]] = {}
        for at, subject in enumerate(asked):
            edge = {id: number for number, id in enumerate(subject.graph.edges)}
            taken = subject.machine.transitions if subject.machine is not None else ()
            known |= {each.id: [(at, edge.get(each.id, UNREACHABLE))] for each in taken}
        parts = []
        for sequence in sequences:
            own_edges: list[list[int]] = [[] for _ in asked]
            for at, edge_taken in (step for steps in looked_up(of.name, sequence, known) for step in steps):
                own_edges[at].append(edge_taken)
            parts.append(own_edges)
    found = [Walks([], []) for _ in asked]
    for part in parts:
        for own, edges, subject in zip(found, part, asked, strict=True):
            _cut(own, np.array(edges, dtype=np.int64), subject.graph)
    return found


def looked_up(name: str, sequence: Sequence[str], known: dict[str, list[Known]]) -> Iterator[list[Known]]:
    """Yield what is known of each entry; of a move of two transitions, what is known of both."""
    for place, entry in enumerate(sequence):
        found = known.get(entry)
        if found is None:
            marks = [at for at, sign in enumerate(entry) if sign == "+"]
            halves = ((entry[:at], entry[at + 1 :]) for at in marks)
            both = next(([*known[a], *known[b]] for a, b in halves if a in known and b in known), None)
            if both is None:
                rule = f"must name transitions of '{name}', but {entry!r} is not one"
                remedy = one_of(entry, list(known))
                raise BadRequest(f"sequence, entry {place}", rule, remedy, slug="foreign-transition")
            found = known[entry] = both
        yield found


def _along(graph: Graph, sequence: Sequence[str]) -> list[int]:
    """Return the edges that a sequence takes; a name that several edges have means the one that leaves the state."""
    names = edge_names(graph)
    known = {name: edge for edge, name in enumerate(names)}
    leaving: dict[tuple[int, str], list[int]] = {}
    for edge, source in enumerate(graph.sources.tolist()):
        leaving.setdefault((source, graph.edges[edge]), []).append(edge)
    state, found = 0, []
    for place, entry in enumerate(sequence):
        edges = leaving.get((state, entry), [])
        if len(edges) != 1:
            edges = [known[entry]] if entry in known else edges
        if len(edges) != 1:
            rule = f"must name an edge of '{graph.name}' that leaves {graph.states[state]!r}, but {entry!r} is "
            rule += f"{len(edges)} of them" if edges else "not one"
            near = [graph.edges[each] for each in graph.leaving()[state]]
            remedy = f"write it as '{names[edges[0]]}'" if edges else one_of(entry, list(dict.fromkeys(near)))
            raise BadRequest(f"sequence, entry {place}", rule, remedy, slug="foreign-transition")
        found += edges
        state = int(graph.targets[edges[0]])
    return found


# Where two edges do not meet, the machine was reset or moved unseen, and nothing is toured across that place:
#
#   a -0-> b -1-> c   |   a -0-> b   |   -1 (unreachable)   |   c -2-> a        three walks: 0 1, 0 and 2
def _cut(own: Walks, edges: NDArray[np.int64], graph: Graph) -> None:
    """Add the straight pieces of what a machine did: it may have jumped, or been where its graph does not reach."""
    if not len(edges):
        return
    before, after = edges[:-1], edges[1:]
    joins = (before >= 0) & (after >= 0)
    joins[joins] = graph.targets[before[joins]] == graph.sources[after[joins]]
    for number, piece in enumerate(np.split(edges, np.flatnonzero(~joins) + 1)):
        if piece[0] != UNREACHABLE:
            own.walks.append(piece.tolist())
            own.begins.append(number == 0 and graph.sources[piece[0]] == 0)
