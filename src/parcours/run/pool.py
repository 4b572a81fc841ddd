"""Numbered tasks -> worker processes; a worker that dies costs the task it was on and nothing else.

Where a task says on which case it is, a worker that hangs is ended, and the task is done again without that case.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pickle import PicklingError
from typing import Any, Protocol

import numpy as np

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.heartbeat import NO_CASE, POLL, LostCase, Watch, share

_ATTEMPTS = 2
_BY_OTHERS = (-signal.SIGKILL, -signal.SIGTERM)
"""How a process ends that somebody else has ended: for want of memory, say."""


class Task(Protocol):
    """What workers do; it must be picklable."""

    def __call__(self, number: int, lost: tuple[LostCase, ...], /) -> None:
        """Do the task of this number, without the cases that were lost on earlier attempts at it."""


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    line: Connection
    watch: Watch | None
    task: int = -1
    hung: bool = False


def run_tasks(
    task: Task,
    numbers: Sequence[int],
    workers: int,
    name: Callable[[int], str],
    *,
    heartbeat_words: int = 0,
    forks: bool = False,
) -> Generator[int, None, None]:
    """Yield each number once `task(number, lost)` has returned in some worker, in order of completion.

    A task whose worker dies is given to a fresh worker once. After a failure no further task is begun, those
    in progress are finished, and then the failure is raised. Leaving the iterator early stops the workers.
    With `heartbeat_words`, a task whose worker hung or died in a case is begun anew as often as it takes, without
    the cases that were lost; what ended a worker from outside is believed to be the case's doing the second time only.
    What tasks print goes to standard error.

    Args:
        task: picklable, unless workers are forked.
        numbers: what to run, in the order in which to begin.
        workers: how many processes, at least 1.
        name: what to call a task in a message.
        heartbeat_words: size of the array that a worker shares (`parcours.run.heartbeat`), or 0 for none.
        forks: whether workers are forked of this process where that is safe (`can_fork`), so that they begin with all
            that it has loaded. Only for tasks that share no lock with a thread of this process; others get a process
            that shares nothing with this one.

    Raises:
        HostFailure: a task raised, or its worker died twice.
        ParcoursError: whatever of ours a task raised.
        BadRequest: the task cannot be sent to another process.
    """
    # A forked child inherits the locks of strangers' threads in whatever state they are: hence spawned, unless told.
    forks = forks and can_fork()
    context: BaseContext = multiprocessing.get_context("fork" if forks else "spawn")
    pending, tries, deaths = deque(numbers), Counter[int](), Counter[int]()
    lost: dict[int, tuple[LostCase, ...]] = {}
    staff: list[_Worker] = []
    failure: ParcoursError | None = None
    looked = time.monotonic()

    def hire() -> _Worker:
        ours, theirs = context.Pipe()
        block = context.RawArray("d", [NO_CASE] * heartbeat_words) if heartbeat_words else None
        # A forked worker holds the parent's ends too, and would not see them close when the parent is killed.
        held = [ours, *(worker.line for worker in staff)] if forks else []
        process = context.Process(target=_serve, args=(theirs, task, block, held), daemon=True)  # type: ignore[attr-defined]
        try:
            process.start()
        except (AttributeError, TypeError, ImportError, ValueError, PicklingError) as error:
            rule = f"what runs in workers must be importable there, but: {error}"
            remedy = "name it 'module:function', or use one worker"
            raise BadRequest("workers", rule, remedy, slug="not-picklable") from error
        theirs.close()
        if block is None:
            return _Worker(process, ours, None)
        return _Worker(process, ours, Watch(np.frombuffer(block)))

    try:
        while pending or any(worker.task >= 0 for worker in staff):
            while pending and failure is None and len(staff) < workers:
                staff.append(hire())
            for worker in staff:
                if worker.task < 0 and pending and failure is None:
                    worker.task = pending.popleft()
                    tries[worker.task] += 1
                    with contextlib.suppress(OSError):  # it is dead: the next wait finds the end of its line
                        worker.line.send((worker.task, lost.get(worker.task, ())))
            busy = [worker for worker in staff if worker.task >= 0]
            if not busy:
                break
            ready = wait([worker.line for worker in busy], POLL if heartbeat_words else None)
            if (now := time.monotonic()) - looked >= POLL:  # neighbours that finish often end the wait early
                looked = now
                for worker in busy:
                    if worker.watch is not None and worker.watch.has_hung() and worker.line not in ready:
                        worker.hung = True
                        worker.process.kill()
            for worker in [worker for worker in busy if worker.line in ready]:
                number, worker.task = worker.task, -1
                try:
                    answer = worker.line.recv()
                except (EOFError, OSError):
                    staff.remove(worker)
                    worker.process.join()
                    case = _lost_case(worker)
                    if case is not None:
                        tries[number] -= 1
                        by_others = not worker.hung and worker.process.exitcode in _BY_OTHERS
                        deaths[case.number] += 1
                        if not by_others or deaths[case.number] == _ATTEMPTS:
                            lost[number] = (*lost.get(number, ()), case)
                        pending.appendleft(number)
                    elif tries[number] < _ATTEMPTS:
                        pending.appendleft(number)
                    else:
                        failure = failure or _died(name(number), worker.process.exitcode)
                    continue
                if answer is None:
                    yield number
                else:
                    failure = failure or _failed(name(number), answer)
        if failure is not None:
            raise failure
    finally:
        for worker in staff:
            worker.line.close()
            if worker.watch is not None:
                worker.process.kill()  # strangers' code may ignore anything else
            elif worker.task >= 0:
                worker.process.terminate()
        for worker in staff:
            worker.process.join()


def can_fork() -> bool:
    """Return whether a process may be forked here: on Linux. Elsewhere libraries of the system forbid it."""
    return sys.platform == "linux"


def _lost_case(worker: _Worker) -> LostCase | None:
    """Return the case that a worker was on when it ended, and how it ended."""
    if worker.watch is None:
        return None
    return worker.watch.lost("hung", "") if worker.hung else worker.watch.lost("died", _ending(worker.process.exitcode))


def _serve(line: Connection, task: Task, block: Any, held: Sequence[Connection]) -> None:
    """Do tasks until the line ends: also when the parent was killed, so that no worker is left behind."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a forked worker has the parent's handler
    for theirs in held:
        theirs.close()
    with contextlib.suppress(OSError, ValueError):
        os.dup2(sys.stderr.fileno(), 1)  # standard output is the parent's, who may write JSON there
    sys.stdout = sys.stderr
    if block is not None:
        share(np.frombuffer(block))
    try:
        while True:
            number, lost = line.recv()
            try:
                task(number, lost)
                line.send(None)
            except ParcoursError as error:
                line.send(error)
            except Exception as error:
                line.send(f"{type(error).__name__}: {error} ({_place(error)})")
    except (EOFError, OSError):
        return


def _place(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1]
    return f"in {last.name}, {last.filename.rpartition('/')[2]}:{last.lineno}"


def _failed(name: str, answer: object) -> ParcoursError:
    if isinstance(answer, ParcoursError):
        return answer
    return HostFailure(name, f"must be computed without an error, but raised {answer}", slug="shard-raised")


def _ending(code: int | None) -> str:
    return f"was killed by signal {-code}" if code is not None and code < 0 else f"ended with exit code {code}"


def _died(name: str, code: int | None) -> HostFailure:
    rule = f"was begun {_ATTEMPTS} times, but its worker {_ending(code)} each time"
    return HostFailure(
        name,
        rule,
        "run these cases with one worker to see why; all other shards are kept",
        slug="worker-died",
    )
