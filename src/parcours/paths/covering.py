"""A machine and a criterion -> few short paths that meet every requirement (paper, section IV-B, Table III).

Edge and edge-pair coverage are optimal: fewest paths, and among those the fewest transitions. Where every
state leads back to the initial one, this is a single closed path. Otherwise a path may end wherever there is
no way back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Machine, Transition
from parcours.paths.criteria import (
    reachable_states,
    reachable_transitions,
    requirements,
    transitions_by_source,
)
from parcours.paths.internal import InternalPath
from parcours.paths.touring import Arc, covering_tour

Walk = list[Transition]


def final_states(machine: Machine) -> tuple[str, ...]:
    """Return where a path may end: in the initial state if all states lead there, else in those that do not.

    >>> fuse = Machine("fuse", "whole", ("whole", "blown"), (Transition("t1", "whole", "blown"),))
    >>> final_states(fuse)
    ('blown',)
    """
    entering: dict[str, list[str]] = {}
    for transition in machine.transitions:
        entering.setdefault(transition.target, []).append(transition.source)
    returning = {machine.initial}
    queue = [machine.initial]
    for state in queue:
        for source in entering.get(state, ()):
            if source not in returning:
                returning.add(source)
                queue.append(source)
    stranded = tuple(state for state in reachable_states(machine) if state not in returning)
    return stranded or (machine.initial,)


def _cover_edges(machine: Machine) -> list[Walk]:
    """Tour the machine's own graph; one more node stands for the pause between two paths."""
    states = reachable_states(machine)
    number = {state: place for place, state in enumerate(states)}
    transitions = reachable_transitions(machine)
    pause = len(states)
    dear = _dearer_than_any_walk(len(states), len(transitions))
    arcs = [Arc(number[t.source], number[t.target]) for t in transitions]
    arcs += [Arc(number[state], pause, 0, False) for state in final_states(machine)]
    arcs.append(Arc(pause, number[machine.initial], dear))
    steps: list[Transition | None] = [*transitions, *[None] * (len(arcs) - len(transitions))]
    return _cut(covering_tour(pause + 1, arcs, number[machine.initial]), steps, len(arcs) - 1)


def _cover_edge_pairs(machine: Machine) -> list[Walk]:
    """Tour the line graph: a transition is a required arc, and so is each passage from one to the next."""
    transitions = reachable_transitions(machine)
    leaving: dict[str, list[int]] = {}
    for place, transition in enumerate(transitions):
        leaving.setdefault(transition.source, []).append(place)
    begin, pause = 2 * len(transitions), 2 * len(transitions) + 1
    ends = set(final_states(machine))
    arcs = [Arc(2 * place, 2 * place + 1) for place in range(len(transitions))]
    for place, transition in enumerate(transitions):
        arcs += [Arc(2 * place + 1, 2 * after, 0) for after in leaving.get(transition.target, ())]
    arcs += [Arc(begin, 2 * first, 0, False) for first in leaving.get(machine.initial, ())]
    arcs += [Arc(2 * place + 1, pause, 0, False) for place, t in enumerate(transitions) if t.target in ends]
    arcs.append(Arc(pause, begin, _dearer_than_any_walk(len(transitions), len(arcs))))
    steps: list[Transition | None] = [*transitions, *[None] * (len(arcs) - len(transitions))]
    return _cut(covering_tour(pause + 1, arcs, begin), steps, len(arcs) - 1)


def _dearer_than_any_walk(n_nodes: int, n_arcs: int) -> int:
    """Return a price for one more path that no saving in transitions repays: fewest paths come first."""
    return 1 + (n_nodes + 1) * (n_arcs + 1)


def _cut(tour: list[int], steps: list[Transition | None], pause: int) -> list[Walk]:
    """Return the pieces of a closed tour between its passages of the arc `pause`."""
    last = len(tour) - 1 - tour[::-1].index(pause)
    walks: list[Walk] = [[]]
    for place in tour[last + 1 :] + tour[: last + 1]:
        step = steps[place]
        if place == pause:
            walks.append([])
        elif step is not None:
            walks[-1].append(step)
    return [walk for walk in walks if walk]


def _cover_nodes(machine: Machine) -> list[Walk]:
    """Go to the nearest state not seen yet, again and again: short, not shortest (that would be NP-hard)."""
    unseen = set(reachable_states(machine)) - {machine.initial}
    ends = set(final_states(machine))
    walks: list[Walk] = [[]]
    here = machine.initial
    while unseen:
        onward = _shortest(machine, here, unseen)
        if onward is None:  # nothing new lies ahead: begin again
            walks.append([])
            here = machine.initial
            continue
        walks[-1] += onward
        unseen -= {transition.target for transition in onward}
        here = onward[-1].target
    if here not in ends:
        walks[-1] += _shortest(machine, here, ends) or []
    return [walk for walk in walks if walk]


def _shortest(machine: Machine, here: str, goals: set[str]) -> Walk | None:
    """Return the fewest transitions from `here` to a goal, the first in file order among equals."""
    leaving = transitions_by_source(machine)
    reached: dict[str, Walk] = {here: []}
    queue = [here]
    for state in queue:
        for transition in leaving.get(state, ()):
            if transition.target not in reached:
                reached[transition.target] = [*reached[state], transition]
                if transition.target in goals:
                    return reached[transition.target]
                queue.append(transition.target)
    return None


COVERS: dict[str, Callable[[Machine], list[Walk]]] = {
    "node": _cover_nodes,
    "edge": _cover_edges,
    "edge-pair": _cover_edge_pairs,
}
"""For each criterion, the function that finds its walks."""


def cover(machine: Machine, criterion: str = "edge", component: str = "") -> tuple[InternalPath, ...]:
    """Return paths from the initial state that together meet the criterion.

    Args:
        machine: the machine to cover.
        criterion: a name in `parcours.paths.criteria.CRITERIA`.
        component: the name of the component that runs the machine; the paths carry it.

    Raises:
        BadRequest: no criterion has that name, or the machine has no transition to walk.

    Example: the loop and the way there and back make one closed path.

    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "on"), Transition("t3", "on", "off")))
    >>> [str(path) for path in cover(lamp)]
    ['tp1 = t1 t2 t3']
    """
    requirements(machine, criterion)  # refuses a criterion that is not known
    if not reachable_transitions(machine):
        raise BadRequest(
            f"machine '{machine.name}'",
            f"must have a transition to cover, but none leaves its initial state '{machine.initial}'",
            "give that state a transition, or leave the machine out",
            slug="nothing-to-cover",
        )
    walks = COVERS[criterion](machine)
    return tuple(
        InternalPath(f"tp{place}", component, machine.name, tuple(walk)) for place, walk in enumerate(walks, start=1)
    )


def internal_paths(cefsm: Cefsm, criterion: str = "edge") -> dict[str, tuple[InternalPath, ...]]:
    """Return for each component the paths that cover its machines, named tp<component><path> as in Table III.

    Components and paths are counted from 1 in file order. With ten or more of either, an underscore keeps the
    two numbers apart.

    Args:
        cefsm: the model.
        criterion: a name in `parcours.paths.criteria.CRITERIA`.

    Raises:
        BadRequest: no criterion has that name, or a machine has no transition to walk.

    >>> from parcours.model.structure import Component
    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "off")))
    >>> paths = internal_paths(Cefsm("house", (Component("Hall", (lamp,)), Component("Attic", (lamp,)))))
    >>> [str(path) for path in paths["Attic"]]
    ['tp21 = t1 t2']
    """
    found = {
        component.name: [path for machine in component.machines for path in cover(machine, criterion, component.name)]
        for component in cefsm.components
    }
    apart = "_" if len(found) > 9 or any(len(paths) > 9 for paths in found.values()) else ""
    return {
        name: tuple(replace(path, name=f"tp{first}{apart}{second}") for second, path in enumerate(paths, start=1))
        for first, (name, paths) in enumerate(found.items(), start=1)
    }
