"""A machine and a criterion -> few short paths that meet every requirement (paper, section IV-B, Table III)."""

from __future__ import annotations

from dataclasses import replace

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Machine
from parcours.paths.criteria import requirements
from parcours.paths.graph import graph_of
from parcours.paths.internal import InternalPath
from parcours.paths.visiting import Cover, Shape, cover_sequences


def cover_machine(
    machine: Machine, criterion: str = "edge", *, shape: Shape = "tests", max_length: int | None = None
) -> Cover:
    """Return a cover of a machine's graph, with what is known of the optimum.

    Args:
        machine: the machine to cover.
        criterion: a name in `parcours.paths.criteria.CRITERIA`.
        shape: tests that end in final states, or one walk.
        max_length: most transitions of a path.

    Raises:
        BadRequest: no criterion has that name, the machine has no transition to walk, or what is asked for is
            impossible.

    >>> from parcours.model.structure import Transition
    >>> fork = Machine("fork", "s", ("s", "a", "b"), (Transition("left", "s", "a"), Transition("right", "s", "b")))
    >>> cover_machine(fork).fewest
    2
    """
    required = requirements(machine, criterion)
    graph = graph_of(machine)
    if not graph.edges:
        raise BadRequest(
            f"machine '{machine.name}'",
            f"must have a transition to cover, but none leaves its initial state '{machine.initial}'",
            "give that state a transition, or leave the machine out",
            slug="nothing-to-cover",
        )
    edge = {id: number for number, id in enumerate(graph.edges)}
    state = {name: number for number, name in enumerate(graph.states)}
    sequences = [tuple(edge[id] for id in each.steps) for each in required if each.kind == "transitions"]
    states = [state[each.steps[0]] for each in required if each.kind == "state"]
    return cover_sequences(graph, sequences, states, shape=shape, max_length=max_length)


def cover(machine: Machine, criterion: str = "edge", component: str = "") -> tuple[InternalPath, ...]:
    """Return paths from the initial state that together meet the criterion.

    Args:
        machine: the machine to cover.
        criterion: a name in `parcours.paths.criteria.CRITERIA`.
        component: the name of the component that runs the machine; the paths carry it.

    Raises:
        BadRequest: no criterion has that name, or the machine has no transition to walk.

    Example: the loop and the way there and back make one closed path.

    >>> from parcours.model.structure import Transition
    >>> lamp = Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "on"), Transition("t3", "on", "off")))
    >>> [str(path) for path in cover(lamp)]
    ['tp1 = t1 t2 t3']
    """
    graph, found = graph_of(machine), cover_machine(machine, criterion)
    transition = {each.id: each for each in machine.transitions}
    return tuple(
        InternalPath(f"tp{place}", component, machine.name, tuple(transition[graph.edges[edge]] for edge in path))
        for place, path in enumerate(found.paths, start=1)
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
    >>> from parcours.model.structure import Transition
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
