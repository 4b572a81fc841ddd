"""The worker's side of `parcours.run.workers`: does a task on one item after the other until the line ends."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from parcours.run import canaries as canaries
from parcours.run.exception_text import described
from parcours.run.heartbeat import case_in, share, write_last_place, write_place
from parcours.run.keeper import BoundedText, can_keep, end_with, keep
from parcours.run.messages import packed

_line: Connection | None = None
_strangers = False


def tell(value: object) -> None:
    """Say something to the parent in the middle of an item; that is a sign of life, too."""
    if _line is not None:
        _say(("heard", value))


def _say(message: tuple[str, object]) -> None:
    """Send a message to the parent. Raises what pickle does if it cannot be sent."""
    assert _line is not None
    if not _strangers:
        _line.send(message)
        return
    left = memoryview(packed(message))
    while left:
        left = left[os.write(_line.fileno(), left) :]


def is_worker() -> bool:
    """Return whether this process does tasks for another one."""
    return _line is not None


def serve_kept(memory: int, line: Connection, *more: Any) -> None:
    """Serve with a keeper around it."""
    _, block, says, lifeline, held, _, _ = more
    for end in held:
        end.close()
    others = (line.fileno(), says.fileno())
    keep(lifeline.fileno(), others, memory, lambda: serve(line, *more), partial(write_last_place, block),
         partial(case_in, block))  # fmt: skip


def serve(
    line: Connection, task: Callable[..., object], block: Any, says: Connection, lifeline: Connection,
    held: Sequence[Connection], own_group: bool, strangers: bool,
) -> None:  # fmt: skip
    """Do the task until the line ends: also when the parent was killed, so that no worker is left behind."""
    global _line, _strangers
    _line, _strangers, pid = line, strangers, os.getpid()
    if own_group and os.getpgid(0) != pid:
        os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a forked worker has the parent's handler
    multiprocessing.current_process().daemon = False  # a task may have workers of its own
    for end in held:
        end.close()
    with contextlib.suppress(OSError, ValueError):
        os.dup2(sys.stderr.fileno(), 1)  # standard output is the parent's, who may write JSON there
    sys.stdout = sys.stderr = BoundedText(partial(case_in, block)) if strangers else sys.stderr
    share(block, says.fileno())
    if strangers and os.name == "posix":
        canaries.place((line.fileno(), says.fileno()))
    try:
        _answer_items(line, task, strangers)
    finally:
        if strangers:  # who may have changed what an error passes through
            canaries.require_unchanged()


def _answer_items(line: Connection, task: Callable[..., object], strangers: bool) -> None:
    pid, process_id, keeper = os.getpid(), os.getpid, os.getppid() if strangers and can_keep() else 0
    require_unchanged = canaries.require_unchanged  # by reference: it may be the last that works
    with contextlib.suppress(EOFError, OSError):
        while True:
            item = line.recv()
            write_place("")
            answer = _tried(task, item, strangers)
            if process_id() != pid:
                os._exit(0)  # a child that a component forked came back into our code: it answers for nobody
            if strangers:
                require_unchanged()
            if keeper:
                end_with(keeper)
            try:
                _say(answer)
            except (TypeError, AttributeError, pickle.PicklingError) as error:
                _say(("raised", Exception(f"{type(error).__name__}: {error}")))


def _tried(task: Callable[..., object], item: tuple[Any, ...], strangers: bool) -> tuple[str, object]:
    try:
        return "done", task(*item)
    except BaseException as error:
        if not strangers and not isinstance(error, Exception):
            raise
        return "raised", described(error)
