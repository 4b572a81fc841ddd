"""Numbered tasks -> worker processes; a worker that dies costs the task it was on and nothing else."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pickle import PicklingError

from parcours.errors import BadRequest, HostFailure, ParcoursError

Task = Callable[[int], None]
_ATTEMPTS = 2


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    line: Connection
    task: int = -1


def run_tasks(
    task: Task, numbers: Sequence[int], workers: int, name: Callable[[int], str]
) -> Generator[int, None, None]:
    """Yield each number once `task(number)` has returned in some worker, in order of completion.

    A task whose worker dies is given to a fresh worker once. After a failure no further task is begun, those
    in progress are finished, and then the failure is raised. Leaving the iterator early stops the workers.

    Args:
        task: picklable; runs in a process that was not forked, so it shares nothing with this one.
        numbers: what to run, in the order in which to begin.
        workers: how many processes, at least 1.
        name: what to call a task in a message.

    Raises:
        HostFailure: a task raised, or its worker died twice.
        ParcoursError: whatever of ours a task raised.
        BadRequest: the task cannot be sent to another process.
    """
    # A forked child would inherit the locks of compiled code's threads in whatever state they are.
    context = multiprocessing.get_context("spawn")
    pending, tries = deque(numbers), Counter[int]()
    staff: list[_Worker] = []
    failure: ParcoursError | None = None

    def hire() -> _Worker:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, task), daemon=True)
        try:
            process.start()
        except (AttributeError, TypeError, ImportError, ValueError, PicklingError) as error:
            rule = f"what runs in workers must be importable there, but: {error}"
            remedy = "name it 'module:function', or use one worker"
            raise BadRequest("workers", rule, remedy, slug="not-picklable") from error
        theirs.close()
        return _Worker(process, ours)

    try:
        while pending or any(worker.task >= 0 for worker in staff):
            while pending and failure is None and len(staff) < workers:
                staff.append(hire())
            for worker in staff:
                if worker.task < 0 and pending and failure is None:
                    worker.task = pending.popleft()
                    tries[worker.task] += 1
                    _tell(worker)
            busy = [worker for worker in staff if worker.task >= 0]
            if not busy:
                break
            ready = wait([worker.line for worker in busy])
            for worker in [worker for worker in busy if worker.line in ready]:
                number, worker.task = worker.task, -1
                try:
                    answer = worker.line.recv()
                except (EOFError, OSError):
                    staff.remove(worker)
                    worker.process.join()
                    if tries[number] < _ATTEMPTS:
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
            if worker.task >= 0:
                worker.process.terminate()
        for worker in staff:
            worker.process.join()


def _tell(worker: _Worker) -> None:
    with contextlib.suppress(OSError):  # it is dead: the next wait finds the end of its line
        worker.line.send(worker.task)


def _serve(line: Connection, task: Task) -> None:
    """Do tasks until the line ends: also when the parent was killed, so that no worker is left behind."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    try:
        while True:
            number = line.recv()
            try:
                task(number)
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


def _died(name: str, code: int | None) -> HostFailure:
    how = f"was killed by signal {-code}" if code is not None and code < 0 else f"ended with exit code {code}"
    rule = f"was begun {_ATTEMPTS} times, but its worker {how} each time"
    return HostFailure(
        name,
        rule,
        "run these cases with one worker to see why; all other shards are kept",
        slug="worker-died",
    )
