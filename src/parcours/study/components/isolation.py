"""Items of work -> results from a process apart, so that a component that hangs or dies costs its own case only.

The process does one item after the other. A turn that takes too long is ended there by an alarm, which says in which
event; a process that the alarm cannot reach, or that is gone, is replaced, and the item it was at has failed.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Generic, TypeVar

from parcours.abtc import Event
from parcours.errors import HostFailure, ParcoursError
from parcours.run.enforcement import instance_name
from parcours.run.hosts.launching import ending
from parcours.run.pool import can_fork

T = TypeVar("T")
_GRACE = 2.0
"""So much longer than a turn may take, an item is waited for after its last sign of life [s]."""

_WORDS = 512
"""Bytes in which the process says which event it is at."""


@dataclass(frozen=True, slots=True)
class Lost:
    """Why an item has no result: how its process ended, and during which event."""

    why: str


@dataclass(frozen=True, slots=True)
class Done(Generic[T]):
    """What an item gave."""

    result: T


class Place:
    """What a process apart is at: shared with its parent, so that it is known even when the process is gone."""

    def __init__(self, words: object | None = None) -> None:
        self._words = words

    def write(self, text: str) -> None:
        """Say what is begun."""
        if self._words is not None:
            self._words.value = text.encode()[: _WORDS - 1]  # type: ignore[attr-defined]


class Overdue(Exception):
    """A component did not finish its turn in time."""


def watched(patience: float, place: Place) -> Callable[[Event], contextlib.AbstractContextManager[None]]:
    """Return what is entered around a turn: it raises in a component that takes longer than `patience` [s]."""

    @contextlib.contextmanager
    def watch(event: Event) -> Iterator[None]:
        place.write(f"event {event.position}, {instance_name(event)}, {event.transition}")

        def ring(number: int, frame: object) -> None:
            raise Overdue(f"no answer within {longest(patience):g} s")

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


def run_apart(
    items: Sequence[str], work: Callable[[str, Place], T], patience: float
) -> Iterator[tuple[str, Done[T] | Lost]]:
    """Yield each item with its result, or why it has none, in their order.

    Args:
        items: names of what to do.
        work: done in the process apart, which is forked of this one where that is safe.
        patience: longest time without a sign of life [s of wall clock]; a sign is the begin of an item or an event.

    Raises:
        ParcoursError: whatever of ours an item raised.
    """
    context = multiprocessing.get_context("fork" if can_fork() else "spawn")
    left = list(items)
    while left:
        ours, theirs = context.Pipe(duplex=False)
        words = context.Array("c", _WORDS, lock=False)
        process = context.Process(target=_serve, args=(theirs, tuple(left), work, words), daemon=True)  # type: ignore[attr-defined]
        process.start()
        theirs.close()
        try:
            answers: Iterator[Done[T] | Lost] = _answers(ours, process, words, patience)
            for answer in answers:
                item = left.pop(0)
                yield item, answer
                if isinstance(answer, Lost):
                    break
        finally:
            with contextlib.suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)  # what it started, too
            process.kill()
            process.join()
            ours.close()


def _answers(line: Connection, process, words, patience: float) -> Iterator[Done[T] | Lost]:  # type: ignore[no-untyped-def]
    seen, since = b"", time.monotonic()
    open_ = True
    while True:
        ready = wait([line, process.sentinel] if open_ else [process.sentinel], timeout=0.25)
        if open_ and line in ready:  # first, so that what was answered before the end counts
            try:
                kind, answer = line.recv()
            except (EOFError, OSError):
                open_ = False
                continue
            if kind == "end":
                return
            if kind == "error":
                raise answer
            yield Done(answer)
            seen, since = b"", time.monotonic()
            continue
        place = words.value.decode("utf-8", "ignore") or "the making of its components"
        if process.sentinel in ready:
            process.join()
            yield Lost(f"its process ended: {ending(process.exitcode or 0)}, in {place}")
            return
        if words.value != seen:
            seen, since = words.value, time.monotonic()
        elif time.monotonic() - since > longest(patience) + _GRACE:
            yield Lost(f"no answer within {longest(patience):g} s, and deaf to being ended, in {place}")
            return


def _serve(line: Connection, items: Sequence[str], work: Callable[[str, Place], T], words: object) -> None:
    os.setpgrp()
    pid = os.getpid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    with contextlib.suppress(OSError, ValueError):
        os.dup2(sys.stderr.fileno(), 1)  # standard output is the parent's, who may write JSON there
    sys.stdout = sys.stderr
    place = Place(words)
    for item in items:
        place.write("")
        try:
            answer: tuple[str, object] = ("done", work(item, place))
        except ParcoursError as error:
            answer = ("error", error)
        except Exception as error:
            rule = f"must be executed without an error, but raised {type(error).__name__}: {error}"
            answer = ("error", HostFailure(item, rule, slug="component-raised"))
        if os.getpid() != pid:
            os._exit(0)  # a child that a component forked came back into our code: it answers for nobody
        line.send(answer)
    line.send(("end", None))
    line.close()
    if (programs := sys.modules.get("parcours.study.components.process")) is not None:
        programs.end_programs()
    sys.stderr.flush()
    os._exit(0)  # what a component registered to be done at exit is not done
