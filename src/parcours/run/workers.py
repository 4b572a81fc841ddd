"""Runs a task on many items in processes of its own, so that an item on which it hangs or dies costs nothing else.

parent                                  worker (one of several, replaced when it hangs or dies)
  | item ------------------------------->|  task(*item)
  |<------------- ("heard", a value) ... |  tell(a value)
  |<- ("done", result) or ("raised", it) |
  | shared memory: where the worker is   |  write_place, words
  | end of the line ------------------->|  ends: also when the parent was killed
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from pickle import PicklingError
from typing import Any, Generic, Literal, TypeVar

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.heartbeat import POLL, LostCase, Watch, new_block, share, write_place

R = TypeVar("R")
_GRACE = 3.0
"""How long an idle worker may take to end by itself, with the programs that it has started [s]."""


@dataclass(frozen=True, slots=True)
class Done(Generic[R]):
    """What an item gave."""

    result: R


@dataclass(frozen=True, slots=True)
class Lost:
    """Why an item has no result: its process hung and was ended, or died.

    Attributes:
        how: which of the two.
        status: exit status of the process; negative for a signal.
        place: where it was, in its own words.
        case: on which it was, if it said so.
    """

    how: Literal["hung", "died"]
    status: int
    place: str
    case: LostCase | None

    @property
    def ending(self) -> str:
        """How the process ended, in words."""
        return f"was killed by signal {-self.status}" if self.status < 0 else f"ended with exit code {self.status}"


class _Worker:
    """One process, the line to it, and the item that it is on."""

    def __init__(self, crew: Crew[Any]) -> None:
        context: Any = multiprocessing.get_context("fork" if crew.forks else "spawn")
        self.line, theirs = context.Pipe()
        block = new_block(context, crew.n_words)
        # A forked worker holds the parent's ends too, and would not see them close when the parent is killed.
        held = [self.line, *(worker.line for worker in crew.staff)] if crew.forks else []
        arguments = (theirs, crew.task, block, held, crew.own_group)
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        try:
            self.process.start()
        except (AttributeError, TypeError, ImportError, ValueError, PicklingError) as error:
            rule = f"what runs in workers must be importable there, but: {error}"
            remedy = "name it 'module:function', or use one worker"
            raise BadRequest("workers", rule, remedy, slug="not-picklable") from error
        theirs.close()
        self.watch = Watch(block, crew.patience)
        self.key: int | None = None
        self.hung = False
        self._own_group = crew.own_group

    def start(self, key: int, item: tuple[Any, ...]) -> None:
        self.key = key
        self.watch.restart()
        with contextlib.suppress(OSError):  # it is dead: the next wait finds the end of its line
            self.line.send(item)

    def has_hung(self) -> bool:
        self.hung = self.watch.has_hung()
        return self.hung

    def kill(self) -> None:
        if self._own_group:
            with contextlib.suppress(OSError):
                os.killpg(self.process.pid, signal.SIGKILL)  # what it started, too
        self.process.kill()

    def lost(self) -> Lost:
        """End it if need be, and return how it ended."""
        if not self.hung:
            self.process.join(_GRACE)
        self.kill()
        self.process.join()
        self.line.close()
        how: Literal["hung", "died"] = "hung" if self.hung else "died"
        lost = Lost(how, self.process.exitcode or 0, self.watch.place, None)
        return replace(lost, case=self.watch.lost(how, "" if self.hung else lost.ending))


class Crew(Generic[R]):
    """Processes that do a task on items. Close it in the end.

    What workers print goes to standard error, since the parent may write JSON. Ctrl-C is the parent's to handle.

    Args:
        task: called with the parts of an item; picklable, unless workers are forked.
        size: how many processes at most, at least 1.
        forks: whether workers are forked of this process where that is safe (`can_fork`), so that they start with all
            that it has loaded. Only for tasks that share no lock with a thread of this process.
        n_words: size of the array that a worker shares (`parcours.run.heartbeat`).
        patience: how long a worker may give no sign of life while it is on no case [s of wall clock].
        own_group: a worker leads a process group, which ends with it: for tasks that start programs.
        once: a worker does one item only, so that whatever it leaves behind in its process is gone with it.
        heard: called with what a task says by `tell`.
    """

    def __init__(
        self, task: Callable[..., R], size: int, *, forks: bool = False, n_words: int = 0,
        patience: float = math.inf, own_group: bool = False, once: bool = False,
        heard: Callable[[Any], None] = lambda value: None,
    ) -> None:  # fmt: skip
        self.task, self.forks, self.n_words = task, forks and can_fork(), n_words
        self.patience, self.own_group = patience, own_group
        self.staff: list[_Worker] = []
        self.pending: deque[tuple[int, tuple[Any, ...]]] = deque()
        self._size, self._once, self._heard = size, once, heard
        self._looks = n_words > 0 or patience < math.inf

    def answers(self) -> Generator[tuple[int, Done[R] | Lost | Exception], None, None]:
        """Yield (key, answer) of all pending items, also of those added meanwhile, in order of completion.

        An exception is ParcoursError as it was raised, or a plain one whose text says what was raised, and where.
        """
        looked = time.monotonic()
        while True:
            for worker in self.staff:
                if worker.key is None and self.pending:
                    worker.start(*self.pending.popleft())
            while self.pending and len(self.staff) < self._size:
                self.staff.append(_Worker(self))
                self.staff[-1].start(*self.pending.popleft())
            busy = [worker for worker in self.staff if worker.key is not None]
            if not busy:
                return
            ready = wait([worker.line for worker in busy], POLL if self._looks else None)
            looks = self._looks and time.monotonic() - looked >= POLL  # neighbours that finish often end the wait early
            looked = time.monotonic() if looks else looked
            for worker in busy:
                answer = None
                if worker.line in ready:
                    answer = self._answer(worker)
                elif looks and (worker.has_hung() or worker.process.exitcode is not None):
                    answer = self._lost(worker)  # its line may be kept open by a child of its own
                if answer is not None:
                    key, worker.key = worker.key, None
                    assert key is not None
                    if self._once and worker in self.staff:
                        self._lost(worker, ended=True)
                    yield key, answer

    def _answer(self, worker: _Worker) -> Done[R] | Lost | Exception | None:
        try:
            kind, value = worker.line.recv()
        except (EOFError, OSError):
            return self._lost(worker)
        if kind == "heard":
            worker.watch.restart()
            self._heard(value)
            return None
        return Done(value) if kind == "done" else value

    def _lost(self, worker: _Worker, *, ended: bool = False) -> Lost:
        self.staff.remove(worker)
        if ended:
            worker.kill()
        return worker.lost()

    def close(self) -> None:
        """End all workers: at once those that are on an item."""
        for worker in self.staff:
            worker.line.close()
            if worker.key is not None:
                worker.kill()
        until = time.monotonic() + _GRACE
        for worker in self.staff:
            worker.process.join(max(until - time.monotonic(), 0.0))
            worker.kill()  # foreign code may have left threads that do not end
            worker.process.join()
        self.staff.clear()


def can_fork() -> bool:
    """Return whether a process may be forked here: on Linux. Elsewhere libraries of the system forbid it."""
    return sys.platform == "linux"


def failure_of(where: str, error: Exception, slug: str = "shard-raised") -> ParcoursError:
    """Return the complaint that an item's task raised."""
    if isinstance(error, ParcoursError):
        return error
    return HostFailure(where, f"must be computed without an error, but raised {error}", slug=slug)


_line: Connection | None = None


def tell(value: object) -> None:
    """Say something to the parent in the middle of an item; that is a sign of life, too."""
    if _line is not None:
        _line.send(("heard", value))


def _serve(
    line: Connection, task: Callable[..., object], block: Any, held: Sequence[Connection], own_group: bool
) -> None:
    """Do the task until the line ends: also when the parent was killed, so that no worker is left behind."""
    global _line
    _line, pid = line, os.getpid()
    if own_group:
        os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a forked worker has the parent's handler
    multiprocessing.current_process().daemon = False  # a task may have workers of its own
    for theirs in held:
        theirs.close()
    with contextlib.suppress(OSError, ValueError):
        os.dup2(sys.stderr.fileno(), 1)  # standard output is the parent's, who may write JSON there
    sys.stdout = sys.stderr
    share(block)
    with contextlib.suppress(EOFError, OSError):
        while True:
            item = line.recv()
            write_place("")
            answer = _tried(task, item)
            if os.getpid() != pid:
                os._exit(0)  # a child that a component forked came back into our code: it answers for nobody
            try:
                line.send(answer)
            except (TypeError, AttributeError, PicklingError) as error:
                line.send(("raised", Exception(f"{type(error).__name__}: {error}")))


def _tried(task: Callable[..., object], item: tuple[Any, ...]) -> tuple[str, object]:
    try:
        return "done", task(*item)
    except Exception as error:
        return "raised", described(error)


def described(error: Exception) -> Exception:
    """Return an error of ours as it is, and of any other its type, its text and the place that raised it."""
    if isinstance(error, ParcoursError):
        return error
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = f"in {last.name}, {last.filename.rpartition('/')[2]}:{last.lineno}"
    return Exception(f"{type(error).__name__}: {error} ({place})")
