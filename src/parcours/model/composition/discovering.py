"""Finds what is wrong in a state space: deadlocks, lost messages, faults, full queues, and what never happens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.model.composition.local import LocalMoves
from parcours.model.composition.moves import Actor, Discoveries
from parcours.model.composition.space import Discovery, Space
from parcours.model.configuration import Configuration, Layout, Message

LISTED = 100
"""Most deadlocks told apart by the states of the machines; the others are counted together."""

Flags = NDArray[np.bool_]


def discoveries(space: Space, local: LocalMoves, record: Discoveries, band: Sequence[Actor]) -> tuple[Discovery, ...]:
    """Return what is wrong in a space, gravest kinds first, nearest to the initial configuration first."""
    faulty = _faulty(space, band) if record.faults else np.zeros(space.n_states, dtype=bool)
    ends = np.flatnonzero((np.diff(space.offsets) == 0) & ~faulty[: space.n_expanded]).tolist()
    rests = {*space.rests()} if ends else set()
    found = [*_deadlocks(space, [state for state in ends if state not in rests])]
    found += _lost(space, local, faulty)
    found += [
        Discovery("model-fault", f"{f'{move}: ' if move else ''}{fault}", state, move=move)
        for (move, fault), state in record.faults.items()
        if state < space.n_expanded
    ]
    found += [
        Discovery("full-queue", f"{taken} cannot send, for channel {channel} is full", state)
        for (taken, channel), state in record.blocked.items()
        if state < space.n_expanded
    ]
    if space.exact and not record.faults:
        found += _never(space)
    resting = [state for state in ends if state in rests]
    if resting:
        message = f"all is at rest with {standing(space.packing.layout, space.configuration(resting[0]))}"
        found.append(Discovery("rest", message, resting[0], len(resting)))
    return tuple(found)


def standing(layout: Layout, here: Configuration) -> str:
    """Return in words where the machines stand and which queues hold messages."""
    places = [f"{owner}.{name} in {state}" for (owner, name), state in zip(layout.machines, here.states, strict=True)]
    held = [f"{name} holding {len(q)}" for name, q in zip(layout.channels, here.queues, strict=True) if q]
    return ", ".join(places + held)


def _faulty(space: Space, band: Sequence[Actor]) -> Flags:
    # A component in the way of whose moves stands a fault may have moves that nobody knows.
    found = np.zeros(space.n_states, dtype=bool)
    suspects = [(actor.mask, actor.faulty) for actor in band if actor.faulty]
    for state, packed in enumerate(space.packed):
        found[state] = any(packed & mask in views for mask, views in suspects)
    return found


def _deadlocks(space: Space, stuck: list[int]) -> Iterator[Discovery]:
    layout = space.packing.layout
    groups: dict[tuple[str, ...], list[int]] = {}
    beyond: list[int] = []
    for state in stuck:
        states = space.configuration(state).states
        if states in groups:
            groups[states][1] += 1
        elif len(groups) < LISTED:
            groups[states] = [state, 1]
        else:
            beyond.append(state)
    for state, count in groups.values():
        message = f"no move is possible with {standing(layout, space.configuration(state))}"
        yield Discovery("deadlock", message, state, count)
    if beyond:
        message = f"no move is possible in {len(beyond)} other configurations, first with "
        message += standing(layout, space.configuration(beyond[0]))
        yield Discovery("deadlock", message, beyond[0], len(beyond))


def _lost(space: Space, local: LocalMoves, faulty: Flags) -> Iterator[Discovery]:
    # A queue's oldest message is lost where no run takes anything from that queue any more. A run through
    # what was not expanded, or is faulty, may take it.
    packing, unknown, ahead = space.packing, faulty.copy(), _Backwards(space)
    unknown[space.n_expanded :] = True
    events = [packing.layout.sites[move.transition].transition.event for move in space.moves]
    for name, cell in packing.queues.items():
        takes = np.array([event is not None and event.channel == name for event in events], dtype=bool)
        goal = unknown.copy()
        goal[space.sources[takes[space.labels]]] = True
        receiver = space.cefsm.channel(name).receiver
        homes = [
            ((at,), local.mask((at,))) for at, (owner, _) in enumerate(packing.layout.machines) if owner == receiver
        ]
        lost = {
            state: content[0]
            for state in np.flatnonzero(~ahead.reaching(goal)).tolist()
            if (content := cell.at(space.packed[state]))
        }
        # Where the receiver comes to stand where a transition takes it, only the sending that goes with it is missing.
        able = np.zeros(space.n_states, dtype=bool)
        for state, message in lost.items():
            able[state] = any(local.of(home, space.packed[state] & mask, name, message) for home, mask in homes)
        blocked = ahead.reaching(able)
        groups: dict[tuple[Message, bool], list[int]] = {}
        for state, message in lost.items():
            groups.setdefault((message, bool(blocked[state])), [state, 0])[1] += 1
        for (message, is_blocked), (state, count) in groups.items():
            yield _reception(space, name, receiver, message, is_blocked, state, count)


def _reception(
    space: Space, channel: str, receiver: str, message: Message, is_blocked: bool, state: int, count: int
) -> Discovery:
    pairs = zip(space.packing.layout.machines, space.configuration(state).states, strict=True)
    places = " and ".join(f"{machine} in {at}" for (owner, machine), at in pairs if owner == receiver)
    said = ", ".join(f"{field} = {value!r}" for field, value in message)
    oldest = f"the oldest message of {channel}{f' ({said})' if said else ''}"
    tried = ", for the values tried" if space.doubts else ""
    if is_blocked:
        text = f"{receiver}, with {places}, can never send what it has to when it takes {oldest}{tried}"
        return Discovery("blocked-reception", text, state, count)
    text = f"{receiver}, with {places}, never comes to a state that takes {oldest}{tried}"
    return Discovery("unspecified-reception", text, state, count)


class _Backwards:
    """The edges of a space turned round, once for many questions."""

    def __init__(self, space: Space) -> None:
        order = np.argsort(space.targets, kind="stable")
        self.sources = space.sources[order]
        self.counts = np.bincount(space.targets, minlength=space.n_states)
        self.offsets = np.concatenate(([0], np.cumsum(self.counts, dtype=np.int64)))

    def reaching(self, goal: Flags) -> Flags:
        """Return which configurations lie in a goal or have a run that leads there."""
        found, border = goal.copy(), np.flatnonzero(goal)
        while len(border):
            # The edges into each configuration of the border stand side by side: all of them as one list of places.
            first, counts = self.offsets[border], self.counts[border]
            places = np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
            before = self.sources[places]
            before = before[~found[before]]
            found[before] = True
            border = np.unique(before)
        return found


def _never(space: Space) -> Iterator[Discovery]:
    taken = {id for move in space.moves for id in (move.transition, move.partner)}
    packing = space.packing
    for (owner, _), machine, cell in zip(packing.layout.machines, packing.machines, packing.states, strict=True):
        for state in machine.states:
            if state not in cell.things:
                yield Discovery("unreachable-state", f"no run leads to state {state} of {owner}.{machine.name}")
        for transition in machine.transitions:
            if transition.id not in taken and transition.source in cell.things:
                yield Discovery("dead-transition", f"no run takes {transition.id} of {owner}")
