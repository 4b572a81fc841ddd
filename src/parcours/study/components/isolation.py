"""Does items of work in a process apart, so that a component that hangs or dies costs its own case only.

A turn that takes too long is ended there by an alarm, which says in which event; a process that the alarm cannot reach,
or that is gone, is replaced, and the item it was at has failed.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from parcours.abtc import Event
from parcours.run.enforcement import instance_name
from parcours.run.heartbeat import write_place
from parcours.run.hosts.launching import ending
from parcours.run.workers import Crew, Done, Lost, failure_of

__all__ = ["Done", "TurnTimeout", "longest", "run_apart", "watched"]

T = TypeVar("T")
_GRACE = 2.0  # so much longer than a turn may take, an item is waited for after its last sign of life [s]


class TurnTimeout(Exception):
    """A component did not finish its turn in time."""


def watched(patience: float) -> Callable[[Event], contextlib.AbstractContextManager[None]]:
    """Return what is entered around a turn: it raises in a component that takes longer than `patience` [s]."""

    def ring(number: int, frame: object) -> None:
        raise TurnTimeout(f"no answer within {longest(patience):g} s")

    @contextlib.contextmanager
    def watch(event: Event) -> Iterator[None]:
        write_place(f"event {event.position}, {instance_name(event)}, {event.transition}")
        before = signal.signal(signal.SIGALRM, ring)
        # Adapters of programs and threads keep `patience` themselves, and know more: the alarm is for what they miss.
        signal.setitimer(signal.ITIMER_REAL, longest(patience))
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)

    return watch


def longest(patience: float) -> float:
    """Return how long a turn may take that an adapter already bounds by `patience` [s]."""
    return 1.5 * patience + 0.5


def run_apart(items: Sequence[str], work: Callable[[str], T], patience: float) -> Iterator[tuple[str, Done[T] | str]]:
    """Yield each item with its result, or why it has none: how its process ended, and during which event.

    Raises ParcoursError: an item raised.
    """
    crew = Crew(work, 1, forks=True, patience=longest(patience) + _GRACE, own_group=True)
    with contextlib.closing(crew):
        crew.pending.extend((number, (item,)) for number, item in enumerate(items))
        for number, answer in crew.answers():
            if isinstance(answer, Done):
                yield items[number], answer
            elif isinstance(answer, Lost):
                yield items[number], _why(answer, patience)
            else:
                raise failure_of(items[number], answer, "component-raised")


def _why(lost: Lost, patience: float) -> str:
    place = lost.place or "the making of its components"
    if lost.how == "hung":
        return f"no answer within {longest(patience):g} s, and deaf to being ended, in {place}"
    return f"its process ended: {ending(lost.status)}, in {place}"
