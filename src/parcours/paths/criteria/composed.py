"""The graph of the composition of a model, and walks of it that make its components talk.

An edge of the composition is a move: one transition, or the two of a rendezvous.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from parcours.errors import BadRequest
from parcours.model.composition import Space
from parcours.paths.criteria.communication import NOBODY, Wiring, communications, wiring
from parcours.paths.criteria.grammar import CoverageCriterion, parse_criterion
from parcours.paths.criteria.requirement import CoverageRequirement, Goal, RequirementCounter, RequirementLimits
from parcours.paths.criteria.requiring import CoverageSubject, Demand, demands
from parcours.paths.graph import Came, Graph, Walk, breadth_first, graph_of, stranded, way_to


def composition_graph(space: Space) -> Graph:
    """Return the graph of a composition: an edge for each move, named after it, between numbered configurations.

    A path may end where all queues are empty and each machine stands where one of its own paths may end (`graph_of`),
    and wherever no such place can be reached any more. Raises BadRequest: the exploration was stopped, so that some of
    the graph is not known.
    """
    if not space.complete:
        rule = f"it must be explored to its end, but {space.stopped}"
        remedy = "raise the bounds of the exploration, or cover its machines one by one"
        raise BadRequest(f"composition of '{space.cefsm.name}'", rule, remedy, slug="open-composition")
    sources, targets = space.sources.tolist(), space.targets.tolist()
    rests = _rests(space)
    names = [str(move) for move in space.moves]
    return Graph(
        space.cefsm.name, tuple(map(str, range(space.n_states))),
        tuple(names[label] for label in space.labels.tolist()), space.sources.astype(np.int64),
        space.targets.astype(np.int64), tuple(sorted({*rests, *stranded(space.n_states, sources, targets, rests)})),
    )  # fmt: skip


def composition_demand(
    space: Space, criterion: str | CoverageCriterion, limits: RequirementLimits | None = None
) -> tuple[Demand, tuple[CoverageRequirement, ...]]:
    """Return what a criterion over graphs or channels asks of a composition, and what no walk of it meets.

    That none can meet it is proven only if the space is exact (`Space.exact`).

    Each requirement over channels has a shortest walk that meets it: one edge, or for a rendezvous over a queue those
    from the one that sends to the one that receives.

    Args:
        criterion: one of `parcours.paths.CRITERIA` over graphs or channels.
        limits: how many requirements are too many.

    Raises BadRequest: the exploration was stopped; or as for `requirements`.
    """
    chosen = parse_criterion(criterion) if isinstance(criterion, str) else criterion
    graph = composition_graph(space)
    if chosen.family != "communication":
        return demands(graph, chosen, (), limits)[0], ()
    wires = wiring(space.cefsm)
    tally = RequirementCounter(limits or RequirementLimits(), f"communications of '{graph.name}'")
    if chosen.name == "rendezvous":
        walks = _meetings(space, graph, wires, tally)
    else:
        walks = _deliveries(space, wires, chosen.name)
    required = communications(space.cefsm, chosen.name, limits)
    goals = tuple(Goal(each, walks[each.steps]) for each in required if each.steps in walks)
    return Demand(CoverageSubject("", graph), graph, goals), tuple(each for each in required if each.steps not in walks)


def _rests(space: Space) -> list[int]:
    """Return the configurations with empty queues in which each machine stands in a final state of its graph."""
    graphs = [graph_of(machine) for component in space.cefsm.components for machine in component.machines]
    finals = [{graph.states[state] for state in graph.finals} for graph in graphs]
    found = []
    for state in range(space.n_states):
        here = space.configuration(state)
        if not any(here.queues) and all(at in ends for at, ends in zip(here.states, finals, strict=True)):
            found.append(state)
    return found


def _deliveries(space: Space, wires: Wiring, criterion: str) -> dict[tuple[str, ...], Walk]:
    """Return for each channel, or each message class, the first edge by which a message of it is delivered."""
    delivered: dict[int, set[str]] = {}
    for number, move in enumerate(space.moves):
        taken = [id for id in (move.transition, move.partner) if id]
        delivered[number] = {wires.receives[id] for id in taken if id in wires.receives}
        delivered[number] |= {name for id in taken for name in wires.sends[id] if not wires.is_read(name)}
    walks: dict[tuple[str, ...], Walk] = {}
    for edge, label in _first_edges(space):
        for channel in delivered[label]:
            walks.setdefault((channel if criterion == "channel" else wires.channels[channel].message,), (edge,))
    return walks


def _meetings(space: Space, graph: Graph, wires: Wiring, tally: RequirementCounter) -> dict[tuple[str, ...], Walk]:
    """Return for each pair of transitions that meet in the composition a shortest walk from the one to the other."""
    walks: dict[tuple[str, ...], Walk] = {}
    for edge, label in _first_edges(space):
        move = space.moves[label]
        if move.partner:
            walks[move.transition, move.partner] = (edge,)
    for name, channel in wires.channels.items():
        if channel.capacity and wires.is_read(name):
            queue = _Queue(space, graph, wires, name)
            for _, sending in wires.senders[name]:
                walks |= queue.walks_from(sending, tally)
    return walks


class _Queue:
    """What the edges of a composition do to the queue of one channel."""

    def __init__(self, space: Space, graph: Graph, wires: Wiring, channel: str) -> None:
        self._targets, self._leaving = graph.targets.tolist(), graph.leaving()
        self._sources, self._labels = graph.sources.tolist(), space.labels.tolist()
        taken = [[id for id in (move.transition, move.partner) if id] for move in space.moves]
        sends = [sum(wires.sends[id].count(channel) for id in ids) for ids in taken]
        self._sender = [next((id for id in ids if channel in wires.sends[id]), NOBODY) for ids in taken]
        self._receiver = [next((id for id in ids if wires.receives.get(id) == channel), NOBODY) for ids in taken]
        self._length = [0] * space.n_states
        # Configurations are numbered breadth first, so a parent's queue is known before its child's.
        arrivals = zip(space.parents.tolist()[1:], space.arrivals.tolist()[1:], strict=True)
        for state, (parent, move) in enumerate(arrivals, start=1):
            self._length[state] = self._length[parent] + sends[move] - bool(self._receiver[move])

    def walks_from(self, sending: str, tally: RequirementCounter) -> dict[tuple[str, ...], Walk]:
        """Return for each transition that receives what `sending` sent the shortest walk from the one to the other."""
        found: dict[tuple[str, ...], Walk] = {}
        came: Came[tuple[int, int], int] = {}
        begin = (-1, 0)

        def onward(here: tuple[int, int]) -> Iterator[tuple[int, tuple[int, int]]]:
            # A place is a configuration, and how many messages are ahead of the one that was sent.
            state, ahead = here
            for edge in self._leaving[state] if here != begin else range(len(self._labels)):
                label = self._labels[edge]
                taken = bool(self._receiver[label])
                if here == begin:
                    if self._sender[label] == sending:
                        yield edge, (self._targets[edge], self._length[self._sources[edge]] - taken)
                    continue
                tally.tick()
                if taken and not ahead:
                    found.setdefault((sending, self._receiver[label]), (*way_to(here, came), edge))
                else:
                    yield edge, (self._targets[edge], ahead - taken)

        for _ in breadth_first([begin], onward, came):
            pass
        return found


def _first_edges(space: Space) -> Iterable[tuple[int, int]]:
    """Return (edge, move) for the first edge of each move."""
    labels, edges = np.unique(space.labels, return_index=True)
    return zip(edges.tolist(), labels.tolist(), strict=True)
