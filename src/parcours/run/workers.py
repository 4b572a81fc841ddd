"""Runs a task on many items in processes of its own, so that an item on which it hangs or dies costs nothing else.

parent                                  worker (one of several, replaced when it hangs or dies)
  | item ------------------------------->|  task(*item)
  |<------------- ("heard", a value) ... |  tell(a value)
  |<- ("done", result) or ("raised", it) |
  |<- pipe: which case it is at          |  enter, leave
  | shared memory: how far, in words     |  words, write_place
  | end of the line ------------------->|  ends: also when the parent was killed

This module is the parent's side; the worker's is `parcours.run.serving`.

Strangers' code is kept farther away: a keeper stands between (`parcours.run.keeper`), answers are read without running
what they name, and a worker in which it has changed what others rely on ends itself (`parcours.run.canaries`).
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import pickle
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from multiprocessing.connection import wait
from typing import Any, Generic, Literal, TypeVar

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run import canaries as canaries
from parcours.run.heartbeat import POLL, LostCase, WorkerWatch, new_block
from parcours.run.keeper import can_keep, memory_for_each, named_signal
from parcours.run.messages import LineMessages
from parcours.run.safe_path import safe_path
from parcours.run.serving import serve, serve_kept

R = TypeVar("R")
_GRACE = 3.0
"""How long an idle worker may take to end by itself, with the programs that it has started [s]."""


@dataclass(frozen=True, slots=True)
class Done(Generic[R]):
    """What an item gave."""

    result: R


@dataclass(frozen=True, slots=True)
class Lost:
    """Why an item has no result: its process hung and was ended, died, or ended itself as it was tampered with.

    Attributes:
        how: which of them.
        status: exit status of the process; negative for a signal.
        place: where it was, in its own words.
        case: on which it was, if it said so.
        entered: whether it had begun a case at all.
        fresh: whether the item was its first.
        silent: whether it closed or corrupted the line to this process, and went on until it was ended here.
    """

    how: Literal["hung", "died", "tampered"]
    status: int
    place: str
    case: LostCase | None
    entered: bool = field(default=False, compare=False)
    fresh: bool = field(default=False, compare=False)
    silent: bool = field(default=False, compare=False)

    @property
    def ending(self) -> str:
        """How the process ended, in words."""
        if self.silent:
            return "can be heard no more"
        by_signal = self.status < 0
        return f"was killed by {named_signal(-self.status)}" if by_signal else f"ended with exit code {self.status}"


class _Worker:
    """One process, the line to it, and the item that it is on."""

    def __init__(self, crew: Crew[Any]) -> None:
        context: Any = multiprocessing.get_context("fork" if crew.forks else "spawn")
        self.line, theirs = context.Pipe()
        self.said, says = context.Pipe(duplex=False)
        lifeline, self.life = context.Pipe(duplex=False)
        block = new_block(context, crew.n_words)
        # A forked worker holds the parent's ends too, and would not see them close when the parent is killed.
        mine = [self, *crew.staff] if crew.forks else []
        held = [end for worker in mine for end in (worker.line, worker.said, worker.life) if not end.closed]
        self.kept, self.hung, self.n_items = crew.strangers and can_keep(), False, 0
        run: Callable[..., None] = serve_kept if self.kept else serve
        arguments: tuple[Any, ...] = (theirs, crew.task, block, says, lifeline, held, crew.own_group, crew.strangers)
        if self.kept:
            arguments = (memory_for_each(crew.size), *arguments)
        try:
            with contextlib.nullcontext(run) if crew.forks else safe_path(run) as target:
                self.process = context.Process(target=target, args=arguments, daemon=True)
                self.process.start()
        except (AttributeError, TypeError, ImportError, ValueError, pickle.PicklingError) as error:
            rule = f"what runs in workers must be importable there, but: {error}"
            remedy = "name it 'module:function', or use one worker"
            raise BadRequest("workers", rule, remedy, slug="not-picklable") from error
        for end in (theirs, says, lifeline):
            end.close()
        os.set_blocking(self.said.fileno(), False)
        # A descriptor of the process itself: the line is kept open by whatever it has started.
        self.ended: int = os.pidfd_open(self.process.pid) if can_keep() else self.process.sentinel
        self.watch = WorkerWatch(block, self.said.fileno(), crew.patience)
        self.key: int | None = None
        self._own_group, self._strangers, self._messages = crew.own_group, crew.strangers, LineMessages()

    def start(self, key: int, item: tuple[Any, ...]) -> None:
        self.key = key
        self.n_items += 1
        self.watch.begin()
        with contextlib.suppress(OSError):  # it is dead: the next wait finds the end of its line
            self.line.send(item)

    def has_hung(self) -> bool:
        self.hung = self.watch.has_hung()
        return self.hung or self.watch.is_garbled  # in both cases it is ended at once

    def heard(self) -> tuple[str, Any] | None:
        """Return what it says, None if it has not said all of it. Raises EOFError, OSError, UnpicklingError."""
        if not self._strangers:
            return self.line.recv()  # type: ignore[no-any-return]
        if not self._messages.has_whole():
            self._messages.read(self.line.fileno())
        return self._messages.take() if self._messages.has_whole() else None

    def has_whole(self) -> bool:
        """Return whether a whole message of it was read that was not heard yet."""
        return self._messages.has_whole()

    def wait(self, seconds: float) -> None:
        """Give it that long to end [s]."""
        if self.process.exitcode is None:
            wait([self.ended], seconds)

    def kill(self) -> None:
        self.life.close()
        if self.kept:  # its keeper ends all that it has started, unless it is ended itself
            with contextlib.suppress(OSError):
                os.kill(self.process.pid, signal.SIGCONT)
            self.wait(_GRACE)
            if self.process.exitcode in (None, -signal.SIGKILL) and self.watch.process:
                with contextlib.suppress(OSError):
                    os.killpg(self.watch.process, signal.SIGKILL)
        elif self._own_group:
            with contextlib.suppress(OSError):
                os.killpg(self.process.pid, signal.SIGKILL)  # what it started, too
        self.process.kill()
        self.process.join()

    def lost(self, changed: str = "") -> Lost:
        """End it if need be, and return how it ended; `changed` is what was found of it here, in words."""
        if not self.hung and not self.watch.was_garbled():
            self.wait(_GRACE)
        silent = not self.hung and self.process.exitcode is None
        self.kill()
        status, place = self.process.exitcode or 0, self.watch.place
        how: Literal["hung", "died", "tampered"] = "hung" if self.hung else "died"
        if how == "died" and (changed or self.watch.was_garbled()):
            how, place = "tampered", canaries.CHANGED + (changed or "it wrote into the line to Parcours")
        elif how == "died" and status == canaries.TAMPERED and place.startswith(canaries.CHANGED):
            how = "tampered"
        lost = Lost(how, status, place, None, silent=silent)
        case = self.watch.lost(how, {"hung": "", "died": lost.ending}.get(how, place))
        self.close()
        return replace(lost, case=case, entered=self.watch.entered, fresh=self.n_items == 1)

    def close(self) -> None:
        """Close all ends of this side, once the process has ended."""
        for end in (self.line, self.said, self.life):
            end.close()
        if can_keep():
            os.close(self.ended)


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
        strangers: the task runs third-party code, which may do anything: a worker ends with all that it has started.
        once: a worker does one item only, so that whatever it leaves behind in its process is gone with it.
        heard: called with what a task says by `tell`.
    """

    def __init__(
        self, task: Callable[..., R], size: int, *, forks: bool = False, n_words: int = 0,
        patience: float = math.inf, own_group: bool = False, strangers: bool = False, once: bool = False,
        heard: Callable[[Any], None] = lambda value: None,
    ) -> None:  # fmt: skip
        self.task, self.forks, self.n_words = task, forks and can_fork(), n_words
        self.patience, self.own_group, self.strangers = patience, own_group, strangers
        self.staff: list[_Worker] = []
        self.pending: deque[tuple[int, tuple[Any, ...]]] = deque()
        self.apart: set[int] = set()
        """Keys of items that must be the first of a worker."""
        self.size, self._once, self._heard = size, once, heard
        self._looks = n_words > 0 or patience < math.inf

    def answers(self) -> Generator[tuple[int, Done[R] | Lost | Exception], None, None]:
        """Yield (key, answer) of all pending items, also of those added meanwhile, in order of completion.

        An exception is ParcoursError as it was raised, or a plain one whose text says what was raised, and where.
        """
        looked = time.monotonic()
        while True:
            for worker in list(self.staff):
                if worker.key is None and self.pending:
                    if worker.n_items and self.pending[0][0] in self.apart:
                        self._lost(worker, ended=True)
                    else:
                        worker.start(*self.pending.popleft())
            while self.pending and len(self.staff) < self.size:
                self.staff.append(_Worker(self))
                self.staff[-1].start(*self.pending.popleft())
            busy = [worker for worker in self.staff if worker.key is not None]
            if not busy:
                return
            ends: list[Any] = [end for worker in busy for end in (worker.line, worker.ended)]
            ready = wait(ends, POLL if self._looks else None)
            looks = self._looks and time.monotonic() - looked >= POLL  # neighbours that finish often end the wait early
            looked = time.monotonic() if looks else looked
            for worker in busy:
                answer = None
                if worker.line in ready or worker.line.poll():
                    answer = self._answer(worker)
                elif worker.ended in ready or (looks and worker.has_hung()):
                    answer = self._lost(worker)
                if answer is not None:
                    key, worker.key = worker.key, None
                    assert key is not None
                    if self._once and worker in self.staff:
                        self._lost(worker, ended=True)
                    elif isinstance(answer, Done) and self.pending and self.pending[0][0] not in self.apart:
                        worker.start(*self.pending.popleft())  # now: it need not wait until its answer was looked at
                    yield key, answer

    def _answer(self, worker: _Worker) -> Done[R] | Lost | Exception | None:
        while True:
            try:
                said = worker.heard()
            except Exception as error:  # it has ended, or strangers have written there
                worker.watch.was_garbled(elsewhere=self.strangers and not isinstance(error, (EOFError, OSError)))
                return self._lost(worker)
            if said is None:
                return None
            if worker.watch.was_garbled():
                return self._lost(worker)
            kind, value = said
            if kind == "raised" and self._was_changed(worker, value):
                return self._lost(worker, ended=True, changed=f"what runs its cases raised {value}")
            if kind != "heard":
                return Done(value) if kind == "done" else value
            worker.watch.restart()
            self._heard(value)
            if not worker.has_whole():
                return None

    def _was_changed(self, worker: _Worker, raised: Exception) -> bool:
        """Return whether strangers' code must be behind what a task raised: it lets none of theirs pass."""
        is_ours = not self.strangers or isinstance(raised, ParcoursError)
        return not is_ours and (worker.watch.has_entered() or worker.n_items > 1)

    def _lost(self, worker: _Worker, *, ended: bool = False, changed: str = "") -> Lost:
        self.staff.remove(worker)
        if ended:
            worker.kill()
        return worker.lost(changed)

    def close(self) -> None:
        """End all workers: at once those that are on an item."""
        for worker in self.staff:
            worker.line.close()
            if worker.key is not None:
                worker.kill()
        until = time.monotonic() + _GRACE
        for worker in self.staff:
            worker.wait(max(until - time.monotonic(), 0.0))
            worker.kill()  # foreign code may have left threads that do not end
            worker.close()
        self.staff.clear()


def can_fork() -> bool:
    """Return whether a process may be forked here: on Linux. Elsewhere libraries of the system forbid it."""
    return sys.platform == "linux"


def failure_of(where: str, error: Exception, slug: str = "shard-raised") -> ParcoursError:
    """Return the complaint that an item's task raised."""
    if isinstance(error, ParcoursError):
        return error
    return HostFailure(where, f"must be computed without an error, but raised {error}", slug=slug)
