"""The abstract cases of a model that can be run on the nodes of a binding, as serialised sequences of events."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from parcours.abtc import (
    MARK,
    Emission,
    Event,
    Orders,
    Reception,
    abstract_cases,
    in_order,
    order_names,
    serialise,
)
from parcours.abtc.interactions import component_graph
from parcours.data import draw, read_input_model
from parcours.paths.covering import internal_paths
from parcours.paths.internal import InternalPath
from parcours.run.binding.structure import Binding
from parcours.suite import combine

MOST = 100_000
"""No more abstract cases are looked at."""


@dataclass(frozen=True, slots=True)
class AbstractScene:
    """An abstract case with a row of test inputs.

    Attributes:
        id: of the abstract case, with the name of the order if it is not the usual one, and the number of the row.
        events: in their order.
        inputs: names and values; empty if the binding has no `data`.
    """

    id: str
    events: tuple[Event, ...]
    inputs: tuple[tuple[str, float], ...] = ()

    @property
    def references(self) -> dict[int, str]:
        """Reference -> its component."""
        return {event.reference: event.component for event in self.events}


def abstract_scenes(binding: Binding, seed: int) -> Iterator[AbstractScene]:
    """Yield the abstract cases one by one, row of data by row, without end if there is data.

    Interactions of components, where the model has several that talk to each other; each component's internal paths,
    where it has not.

    Args:
        binding: whose model.
        seed: of the values.
    """
    found = orders_of(binding)
    if not binding.data_file:
        yield from (AbstractScene(f"{id}/0", events) for id, events in found.items())
        return
    inputs = read_input_model(Path(binding.data_file))
    for row in itertools.count():
        plan = combine(binding.name, list(found), inputs, seed=seed, n_cases=len(found) * (row + 1))
        numbers = np.arange(row * len(found), (row + 1) * len(found))
        values = draw(inputs, plan.blocks(numbers), numbers, seed=seed)
        for (id, events), drawn in zip(found.items(), values.tolist(), strict=True):
            yield AbstractScene(f"{id}/{row}", events, tuple(zip(inputs.names, drawn, strict=True)))


def in_orders(scene: AbstractScene, wanted: Orders, seed: int) -> Iterator[AbstractScene]:
    """Yield a scene in the orders that are wanted of its case. Raises BadRequest if it has too many."""
    abstract, _, row = scene.id.rpartition("/")
    for name in order_names(abstract, scene.events, wanted, seed):
        yield replace(scene, id=f"{abstract}{MARK}{name}/{row}", events=in_order(abstract, scene.events, name, seed))


def find_scenes(binding: Binding, seed: int, ids: Collection[str]) -> dict[str, AbstractScene]:
    """Return the abstract cases with some ids, by id; those that the binding does not have are missing.

    Raises BadRequest: an id names an order that its case does not have.
    """
    once = orders_of(binding)
    parts = {id: _parts(id) for id in ids}
    rows = [int(row) for abstract, _, row in parts.values() if abstract in once and row.isdecimal() and len(row) < 7]
    every = itertools.islice(abstract_scenes(binding, seed), len(once) * (max(rows, default=-1) + 1))
    wanted = {f"{abstract}/{row}" for abstract, _, row in parts.values()}
    found = {scene.id: scene for scene in every if scene.id in wanted}
    return {
        id: replace(scene, id=id, events=in_order(abstract, scene.events, order, seed))
        for id, (abstract, order, row) in parts.items()
        if (scene := found.get(f"{abstract}/{row}")) is not None
    }


def orders_of(binding: Binding) -> dict[str, tuple[Event, ...]]:
    """Return the events of each abstract case, in their usual order."""
    return dict(itertools.islice(_sequences(binding), MOST))


def _parts(id: str) -> tuple[str, str, str]:
    """Return the abstract case, the order and the row of an id."""
    case, _, row = id.rpartition("/")
    abstract, _, order = case.partition(MARK)
    return abstract, order, row


def _sequences(binding: Binding) -> Iterator[tuple[str, tuple[Event, ...]]]:
    model = binding.model
    runs = {component for node in binding.nodes for component in node.components}
    if component_graph(model):
        for case in abstract_cases(model):
            events = serialise(case)
            if runs & {event.component for event in events}:
                yield case.id, events
        return
    for component, paths in internal_paths(model).items():
        if component in runs:
            for path in paths:
                yield f"{component}-{path.name}", _alone(path)


def _alone(path: InternalPath) -> tuple[Event, ...]:
    """Return an internal path as a sequence in which the environment sends and receives everything."""
    return tuple(
        Event(
            position, position, 0, 0, path.component, path.machine, path.name, one.id,
            None if one.event is None else Reception(one.event.channel),
            tuple(Emission(send.channel) for send in one.sends),
            () if position == 0 else (position - 1,),
        )
        for position, one in enumerate(path.transitions)
    )  # fmt: skip
