"""Chooses serialisations of an abstract case beside its own: all, drawn, or by random priorities (PCT); each by name.

A case leaves open what does not wait for each other. Its orders have names, which stand behind its id:

    X          the order of the lock step, as `serialise` gives it
    X@17       the order that is number 17 of all, in the order of `sequences`
    X@draw.3   the draw number 3 of the seed, all orders being equally likely
    X@pct2.3   the schedule number 3 of the seed, with random priorities that change once

PCT (Burckhardt, Kothari, Musuvathi, Nagarakatte: A Randomized Scheduler with Probabilistic Guarantees of Finding Bugs,
ASPLOS 2010): references have random priorities, the highest that can go on does, and at d - 1 random steps the one that
goes on falls below all others. Of n references with k events in all, one schedule finds a fault that takes d events in
an order of its own with a probability of at least 1 / (n k^(d - 1)).
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import Literal

from parcours.abtc.interleaving import Sampler, order_of_events, sequences
from parcours.abtc.order import Order
from parcours.abtc.sequencing import Event, Reception
from parcours.errors import BadRequest

MOST = 10_000
"""Most orders of one abstract case."""

MARK = "@"
"""Parts the id of an abstract case from the name of an order."""

_SCHEDULES = 10
_DEEPEST = 9
_ASKED = re.compile(r"(?P<all>all)|(?P<number>\d{1,5})|pct:(?P<depth>\d)(:(?P<schedules>\d{1,5}))?")
_NAME = re.compile(r"(?P<rank>\d{1,5})|draw\.(?P<draw>\d{1,5})|pct(?P<depth>\d)\.(?P<schedule>\d{1,5})")


@dataclass(frozen=True, slots=True)
class Orders:
    """Which orders of each abstract case are wanted: all, `number` drawn ones, or `number` of PCT with a `depth`."""

    kind: Literal["all", "draw", "pct"]
    number: int = MOST
    depth: int = 0


def parse_orders(text: str) -> Orders:
    """Return what `all`, `N`, `pct:d` or `pct:d:N` asks for. Raises BadRequest if it is something else.

    >>> parse_orders("pct:3:20")
    Orders(kind='pct', number=20, depth=3)
    """
    found = _ASKED.fullmatch(text.strip())
    if found is not None and found["all"]:
        return Orders("all")
    number = 0 if found is None else int(found["number"] or found["schedules"] or _SCHEDULES)
    depth = int(found["depth"] or 1) if found is not None else 0
    if found is None or not 1 <= number <= MOST or not 1 <= depth <= _DEEPEST:
        rule = f"must be all, a number N, or pct:d or pct:d:N with d from 1 to {_DEEPEST}, N from 1 to {MOST}"
        raise BadRequest("--orders", f"{rule}, but is {text[:40]!r}", "write for example pct:3:20", slug="orders-form")
    return Orders("pct", number, depth) if found["depth"] else Orders("draw", number)


def order_names(id: str, events: Sequence[Event], wanted: Orders, seed: int) -> tuple[str, ...]:
    """Return the names of different orders of a case; all of them where no more are wanted than there are.

    Args:
        id: of the abstract case.
        events: `serialise` of it.
        wanted: which ones.
        seed: of what is drawn.

    Raises:
        BadRequest: all are wanted, but there are more than 10 000; or too many to draw of.
    """
    order = _order(tuple(events))
    if wanted.kind != "pct":
        few = _first(order, wanted.number)
        if few is not None:
            return tuple(map(str, range(len(few))))
        if wanted.kind == "all":
            rule = f"all orders can be tried of a case that has at most {MOST}, but this one has more"
            raise BadRequest(
                f"abstract case {id}", rule, "try some: --orders 100, or --orders pct:3", slug="orders-many"
            )
    prefix = f"pct{wanted.depth}." if wanted.kind == "pct" else "draw."
    names: dict[tuple[int, ...], str] = {}
    for number in range(wanted.number):
        names.setdefault(_named(order, f"{prefix}{number}", seed) or (), f"{prefix}{number}")
    return tuple(names.values())


def in_order(id: str, events: Sequence[Event], name: str, seed: int) -> tuple[Event, ...]:
    """Return the events of a case in an order of it, each after the one before it.

    Args:
        id: of the abstract case.
        events: `serialise` of it.
        name: of the order; empty for the one that they have.
        seed: of what is drawn.

    Raises:
        BadRequest: it has no order of that name.
    """
    if not name:
        return tuple(events)
    sequence = _named(_order(tuple(events)), name, seed)
    if sequence is None:
        rule = f"an order of a case is called by its number, draw.K or pctD.K, but it has none called {name[:40]!r}"
        raise BadRequest(
            f"abstract case {id}", rule, "take it from the results of a run with --orders", slug="order-unknown"
        )
    numbered = _events_of(tuple(events))
    place = {numbered[number]: new for new, number in enumerate(sequence)}
    made = []
    for number in sequence:
        event = events[numbered[number]]
        got = event.receives
        if got is not None and got.event is not None:
            got = Reception(got.channel, place[got.event])
        new = place[event.position]
        after = tuple(sorted({place[one] for one in event.after} | ({new - 1} if new else set())))
        before = None if event.before is None else place[event.before]
        made.append(replace(event, position=new, turn=new, receives=got, after=after, before=before))
    return tuple(made)


def _events_of(events: tuple[Event, ...]) -> list[int]:
    """Return for each event of the order its position: the order counts reference by reference."""
    references = sorted({event.reference for event in events})
    return [event.position for one in references for event in events if event.reference == one]


@lru_cache(maxsize=64)
def _order(events: tuple[Event, ...]) -> Order:
    return order_of_events(events)


@lru_cache(maxsize=8)
def _first(order: Order, most: int) -> tuple[tuple[int, ...], ...] | None:
    """Return all sequences; None if there are more."""
    found = tuple(islice(sequences(order), most + 1))
    return found if len(found) <= most else None


@lru_cache(maxsize=64)
def _sampler(order: Order) -> Sampler:
    return Sampler(order)


def _named(order: Order, name: str, seed: int) -> tuple[int, ...] | None:
    found = _NAME.fullmatch(name)
    if found is None:
        return None
    if found["rank"]:
        rank = int(found["rank"])
        every = _first(order, MOST) or tuple(islice(sequences(order), min(rank, MOST) + 1))
        return every[rank] if rank < len(every) else None
    draw = random.Random(f"{seed} {name}")
    if found["draw"]:
        return _sampler(order).drawn(draw)
    return by_priorities(order, int(found["depth"]), draw) if 1 <= int(found["depth"]) <= _DEEPEST else None


def by_priorities(order: Order, depth: int, draw: random.Random) -> tuple[int, ...]:
    """Return a sequence by PCT.

    Args:
        order: whose paths are the threads.
        depth: d: how many priorities there are below the first ones, and one more than how often one falls.
        draw: chooses first priorities and the steps at which the running path falls.
    """
    paths = [path for path in order.paths if path]
    total = sum(map(len, paths))
    priorities = [depth + number for number in range(len(paths))]
    draw.shuffle(priorities)
    falls = {step: depth - 1 - number for number, step in enumerate(draw.sample(range(total), min(depth - 1, total)))}
    come = [0] * len(paths)
    done: set[int] = set()
    sequence: list[int] = []
    while len(sequence) < total:
        ready = [
            path for path, at in enumerate(come)
            if at < len(paths[path]) and done.issuperset(order.needs[paths[path][at]])
        ]  # fmt: skip
        path = max(ready, key=lambda one: priorities[one])
        step = len(sequence)
        if step in falls:
            priorities[path] = falls.pop(step)
            path = max(ready, key=lambda one: priorities[one])
        event = paths[path][come[path]]
        come[path] += 1
        done.add(event)
        sequence.append(event)
    return tuple(sequence)
