"""Tasks -> answers, each from a process of its own, so that to hang or to take it down is an answer too."""

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
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Generic, TypeVar

from parcours.errors import HostFailure, ParcoursError
from parcours.run.pool import can_fork

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Ended:
    """Why a process gave no answer, in words."""

    why: str


@dataclass(slots=True)
class _Running(Generic[T]):
    index: int
    process: BaseProcess
    line: Connection
    deadline: float


def run_isolated(
    task: Callable[[T], R], items: Sequence[T], workers: int, patience: float
) -> Iterator[tuple[int, R | Ended]]:
    """Yield the index of each item with `task(item)`, or with why there is none, in order of completion.

    Args:
        task: run in a process that is forked of this one where that is safe; else it must be importable.
        items: what to give it.
        workers: how many processes run at a time, at least 1.
        patience: a process that takes longer is ended [s of wall clock].

    Raises:
        HostFailure: a task raised.
        ParcoursError: whatever of ours a task raised.
    """
    context: BaseContext = multiprocessing.get_context("fork" if can_fork() else "spawn")
    running: list[_Running[T]] = []
    begun = 0
    try:
        while begun < len(items) or running:
            while begun < len(items) and len(running) < workers:
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_answer, args=(theirs, task, items[begun]), daemon=True)  # type: ignore[attr-defined]
                process.start()
                theirs.close()
                running.append(_Running(begun, process, ours, time.monotonic() + patience))
                begun += 1
            soonest = min(one.deadline for one in running)
            ready = wait([one.line for one in running], max(soonest - time.monotonic(), 0.0))
            now = time.monotonic()
            for one in list(running):
                if one.line in ready:
                    answer = _received(one)
                elif now >= one.deadline:
                    one.process.kill()
                    answer = Ended(f"hung for {patience:g} s")
                else:
                    continue
                running.remove(one)
                one.line.close()
                one.process.join()
                if isinstance(answer, ParcoursError):
                    raise answer
                yield one.index, answer  # type: ignore[misc]
    finally:
        for one in running:
            one.process.kill()
            one.process.join()
            one.line.close()


def _received(one: _Running[T]) -> object:
    try:
        return one.line.recv()
    except (EOFError, OSError):
        one.process.join()
        code = one.process.exitcode
        return Ended(f"died by signal {-code}" if code is not None and code < 0 else f"died with exit code {code}")


def _answer(line: Connection, task: Callable[[T], R], item: T) -> None:
    """Send the answer to one item; standard output is the parent's, who may write JSON there."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with contextlib.suppress(OSError, ValueError):
        os.dup2(sys.stderr.fileno(), 1)
    answer: object
    try:
        answer = task(item)
    except ParcoursError as error:
        answer = error
    except Exception as error:
        rule = f"must be computed without an error, but raised {type(error).__name__}: {error}"
        answer = HostFailure(f"{item}", rule, slug="shard-raised")
    with contextlib.suppress(BrokenPipeError):  # the parent is gone
        line.send(answer)
