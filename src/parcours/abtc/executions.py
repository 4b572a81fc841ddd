"""Paths, a combination or an abstract case -> the partial order that their executions keep."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.abtc.combining import Combination
from parcours.abtc.order import Order, Place
from parcours.abtc.sequencing import serialise
from parcours.abtc.serialising import AbstractCase
from parcours.model.structure import Cefsm
from parcours.paths.internal import InternalPath


def side_by_side(paths: Sequence[InternalPath], *, changes_only: bool = False) -> Order:
    """Return the order of paths that never wait for each other: each keeps its own order, and that is all.

    Args:
        paths: any internal paths.
        changes_only: leave transitions out that stay in their state.

    Example: the two paths of ITP1 of the RAMP study, whole and with state changes only.
    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> from parcours.paths import internal_paths
    >>> from parcours.abtc.interleaving import count_sequences
    >>> found = internal_paths(read_model(files("parcours_ramp") / "components" / "model.yaml"))
    >>> pair = [found["Planner"][1], found["TrajectoryGenerator"][0]]
    >>> count_sequences(side_by_side(pair)), count_sequences(side_by_side(pair, changes_only=True))
    (462, 20)
    """
    chosen = [[path.ids[at] for at in path.changes] if changes_only else path.ids for path in paths]
    return Order.of(chosen)


def order_of(cefsm: Cefsm, combination: Combination) -> Order:
    """Return the order that every execution of a combination keeps: its paths' own, and its rendezvous.

    What a visit receives from the visit before it, it receives in the order of sending, on each channel the
    first reference first; what that visit does not send, the tester supplies at any time. On a channel of
    capacity 0, send and receive are one event. An event is called by path, reference and transition.

    Args:
        cefsm: the model, which says how much a channel holds.
        combination: an RCC combination.

    Raises:
        BadRequest: the paths would meet in a circle.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> from parcours.abtc import combinations, interaction_paths
    >>> from parcours.abtc.interleaving import count_sequences
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> (combination,) = combinations(ramp, interaction_paths(ramp)[2]).kept
    >>> order = order_of(ramp, combination)
    >>> order.names[:4]
    ('tp11#0 p11', 'tp11#0 p12', 'tp11#0 p13', 'tp51#1 p51')
    >>> [order.names[need] for need in order.needs[order.names.index('tp51#1 p52')]]
    ['tp11#0 p11', 'tp51#1 p51']
    """
    references = combination.references
    sent: dict[tuple[int, str], list[Place]] = {}
    received: dict[tuple[int, str], list[Place]] = {}
    for reference, (visit, path) in enumerate(references):
        for at, transition in enumerate(path.transitions):
            for send in transition.sends:
                sent.setdefault((visit + 1, send.channel), []).append((reference, at))
            if transition.event is not None:
                received.setdefault((visit, transition.event.channel), []).append((reference, at))
    before: list[tuple[Place, Place]] = []
    together: list[tuple[Place, Place]] = []
    for (visit, channel), receives in received.items() if combination.meetings else ():
        kept = before if cefsm.channel(channel).capacity else together
        kept += zip(sent.get((visit, channel), ()), receives, strict=False)
    names = [[f"{path.name}#{at} {id}" for id in path.ids] for at, (_, path) in enumerate(references)]
    return Order.of(names, before, together)


def order_of_case(case: AbstractCase) -> Order:
    """Return the order that every execution of an abstract case keeps: what its events wait for and precede.

    Raises:
        BadSuite: references wait for each other, as in a case whose starts were edited.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> from parcours.abtc import abstract_cases
    >>> from parcours.abtc.interleaving import count_sequences
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> [count_sequences(order_of_case(case)) for case, _ in zip(abstract_cases(ramp), range(3))]
    [110565, 36855, 8190]
    """
    events = serialise(case)
    lines: list[list[int]] = [[] for _ in case.combination.references]
    for event in events:
        lines[event.reference].append(event.position)
    place = {event: (path, at) for path, line in enumerate(lines) for at, event in enumerate(line)}
    before = [(place[cause], place[event.position]) for event in events for cause in event.after]
    before += [(place[event.position], place[event.before]) for event in events if event.before is not None]
    names = [[f"{events[at].path}#{events[at].reference} {events[at].transition}" for at in line] for line in lines]
    return Order.of(names, before)
