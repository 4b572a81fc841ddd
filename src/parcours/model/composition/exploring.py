"""Explores the reachable configurations of a model, breadth first, within bounds; says when it met one."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from parcours.errors import BadRequest
from parcours.model.composition.discovering import discoveries
from parcours.model.composition.local import LocalMoves
from parcours.model.composition.moves import Actor, Discoveries, actors
from parcours.model.composition.packing import Packing
from parcours.model.composition.space import Space
from parcours.model.configuration import Layout
from parcours.model.structure import Cefsm

MOST_STATES = 1 << 30
MOST_TRANSITIONS = 1 << 27
"""Most edges kept, eight bytes each: 1 GiB."""

_BETWEEN_LOOKS = 256

Progress = Callable[[str, int, int], None]


def explore(cefsm: Cefsm, max_states: int = 1_000_000, progress: Progress | None = None) -> Space:
    """Return the state space of a model: what the step relation reaches, with everything wrong in it.

    Inputs and open message fields take the values that `parcours.model.enabled` chooses: all of a finite
    domain, representatives of an infinite one. The environment supplies every message and accepts all.

    Args:
        max_states: most configurations to keep [1 .. 2^30].
        progress: gets ("states", how many are known, max_states) now and then.

    Raises:
        BadRequest: a bound is out of its range.
    """
    if not 1 <= max_states <= MOST_STATES:
        rule = f"must keep 1 to {MOST_STATES} states, but {max_states} was given"
        raise BadRequest("exploration", rule, slug="explore-bound")
    packing, record = Packing(Layout(cefsm)), Discoveries()
    local = LocalMoves(cefsm, packing)
    band = actors(packing, local, record)
    space = replace(_search(packing, band, record, max_states, progress), doubts=local.doubts)
    return replace(space, findings=discoveries(space, local, record, band))


def _search(
    packing: Packing, band: list[Actor], record: Discoveries, max_states: int, progress: Progress | None
) -> Space:
    # The inner loop does nothing but look up, add and append: it runs once for each edge.
    begun, stopped = time.monotonic(), ""
    packed, parents, arrivals = [0], array("i", [0]), array("i", [-1])
    degrees, targets, labels = array("i"), array("i"), array("i")
    index = {0: 0}
    views = [(actor.mask, actor.table, actor) for actor in band]
    # Breadth first: a configuration is first met by a shortest run, so parents give shortest witnesses.
    state, is_fresh = 0, True
    while state < len(packed):
        if is_fresh or not state % _BETWEEN_LOOKS:
            is_fresh = False
            if len(targets) > MOST_TRANSITIONS:
                stopped = f"at {len(targets)} transitions"
                break
            if progress is not None:
                progress("states", len(packed), max_states)
        here, before, known = packed[state], len(targets), len(packed)
        for mask, table, actor in views:
            acts = table.get(here & mask)
            if acts is None:
                acts, is_fresh = actor.work_out(here & mask, state), True
            for added, label in acts:
                there = here + added
                target = index.setdefault(there, len(packed))
                if target == len(packed):
                    packed.append(there)
                    parents.append(state)
                    arrivals.append(label)
                targets.append(target)
                labels.append(label)
        if len(packed) > max_states:
            # Take back what this configuration led to, so that what is kept is exactly within the bound.
            del packed[known:], parents[known:], arrivals[known:], targets[before:], labels[before:]
            stopped = f"at the bound of {max_states} states"
            break
        degrees.append(len(targets) - before)
        state += 1
    left = len(packed) - state
    if stopped:
        stopped = f"stopped {stopped}: {len(packed)} states known, {left} of them not expanded"
    offsets = np.concatenate(([0], np.cumsum(np.asarray(degrees), dtype=np.int64)))
    tree, edges = (np.asarray(parents), np.asarray(arrivals)), (offsets, np.asarray(targets), np.asarray(labels))
    moves, seconds = tuple(record.moves), time.monotonic() - begun
    return Space(packing.layout.cefsm, packing, packed, *tree, moves, *edges, seconds, stopped)
