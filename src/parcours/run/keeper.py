"""Stands between a worker that runs strangers' code and the process that ordered it, and leaves nothing of it behind.

parent ── keeper ── worker ── helpers that the code has started
             │         leads a session of its own; is killed when its keeper ends
             │ adopts the helpers that are orphaned; when the worker has ended, or the parent has, ends them all,
             │ and then ends as the worker did
             │ passes on what they print, up to a limit; nothing else that the parent has open reaches the worker
             └ ends all of them, too, where they become too many, print too much, or the worker is stopped

So the parent sees how the worker ended whatever its helpers hold open, and what the code does to its parent process it
does to the keeper. On Linux only.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import io
import math
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from parcours.run.canaries import CHANGED, TAMPERED, end_if

fcntl: Any = importlib.import_module("fcntl") if os.name == "posix" else None
resource: Any = importlib.import_module("resource") if os.name == "posix" else None

MOST_PRINTED = 1 << 18
"""So much of what a worker and its helpers print is passed on [bytes]."""

MOST_WRITTEN = 1 << 26
"""A worker that prints more than this in one case is ended [bytes]: to read it all would take others' time."""

MOST_PROCESSES = max(64, 4 * (os.cpu_count() or 1))
"""At most this many processes may descend from a worker at a time; those that nobody has waited for count, too."""

_LOOK = 0.1
"""How often they are counted [s]."""

_STOPPED = 10
"""A worker that is found stopped this many times in a row is ended: what stops all processes stops its keeper, too."""

_HARMLESS = {"SIGCHLD", "SIGCONT", "SIGSTOP", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGURG", "SIGWINCH"}
_FATAL = sum(1 << (one - 1) for one in signal.Signals if one.name not in _HARMLESS) if os.name == "posix" else 0
_BY_PROCESSOR_LIMIT = (-signal.SIGKILL, -signal.SIGXCPU) if os.name == "posix" else ()
_ROUNDING = 0.5  # so much less than its limit may have been counted of a process that has used it up [s]
_LEFT_OUT = b"\n(whatever else this process prints is left out)\n"
_TOO_MUCH = f"it printed more than {MOST_WRITTEN >> 20} MB in one case"
_CHUNK = 1 << 20  # and the size of their pipe, where the system allows it: the fewer turns, the sooner too much is seen
_ENDING = 5.0  # helpers that cannot be killed are left alone after this time [s]
_PARENT_DEATH, _SUBREAPER, _SET_SIZE = 1, 36, 1031  # PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER, F_SETPIPE_SZ
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None  # a forked child could not load it safely


def named_signal(number: int) -> str:
    """Return a signal's number and name.

    >>> named_signal(9), named_signal(50)
    ('signal 9 (SIGKILL)', 'signal 50')
    """
    with contextlib.suppress(ValueError):  # it has none
        return f"signal {number} ({signal.Signals(number).name})"
    return f"signal {number}"


class BoundedText(io.TextIOWrapper):
    """Standard error as text, which drops what is beyond the limit before it costs anything, but counts it.

    Args:
        case: number of the case that goes on.
    """

    def __init__(self, case: Callable[[], float]) -> None:
        super().__init__(io.FileIO(2, "w", closefd=False), errors="backslashreplace", line_buffering=True)
        self._left = MOST_PRINTED + 1  # so the keeper notices
        self._case, self._at, self._dropped = case, case(), 0

    def write(self, text: str) -> int:
        """Write what there is room for; return how much was given. Ends the process where a case prints too much."""
        kept = text[: self._left]
        self._left -= len(kept)
        if kept:
            super().write(kept)
        if len(kept) < len(text):
            if (at := self._case()) != self._at:
                self._at, self._dropped = at, 0
            self._dropped += len(text) - len(kept)
            end_if(_TOO_MUCH if self._dropped > MOST_WRITTEN else "")
        return len(text)


def can_keep() -> bool:
    """Return whether this system has what a keeper needs."""
    return _LIBC is not None and hasattr(os, "pidfd_open")


def memory_for_each(size: int) -> int:
    """Return how much memory each of some workers of strangers' code may have: half of what is free now, in all [B]."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
        return max(free * 512 // size, 1 << 30)
    return 1 << 62


def _data_here() -> int:
    """Return how much this process has that counts for its limit of data [B]; children share it until they write."""
    with contextlib.suppress(OSError):
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def keep(
    lifeline: int, others: tuple[int, ...], memory: int, work: Callable[[], None], say: Callable[[str], None],
    case: Callable[[], float],
) -> NoReturn:  # fmt: skip
    """Do the work in a child of this process, and end with it, or when the other end of the lifeline is closed.

    Args:
        lifeline: a descriptor to read from.
        others: descriptors that only the child needs.
        memory: so much the child may have beside what it shares with this process, and each of its helpers, too [B].
        work: what the child does; the child ends without cleaning up, since what it would run then is the strangers'.
        say: says in words why the child was ended; this process then ends as one whose worker was tampered with.
        case: number of the case at which the child is: what it may print is counted for each.
    """
    assert _LIBC is not None
    os.setpgid(0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    for one in (signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD):  # which the parent may handle
        signal.signal(one, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    memory += _data_here()
    if most == resource.RLIM_INFINITY or memory < most:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    _LIBC.prctl(_SUBREAPER, 1, 0, 0, 0)
    keeper, (printed, theirs) = os.getpid(), os.pipe()
    with contextlib.suppress(OSError):
        fcntl.fcntl(theirs, _SET_SIZE, _CHUNK)
    child = os.fork()
    if child == 0:
        status = 1
        try:
            _LIBC.prctl(_PARENT_DEATH, signal.SIGKILL, 0, 0, 0)
            os.setsid()
            if os.getppid() == keeper:
                os.close(lifeline)
                os.close(printed)
                _replace_streams(theirs)
                _take_away(others)
                work()
                status = 0
        finally:
            os._exit(status)
    for descriptor in (*others, theirs):
        os.close(descriptor)
    status, excess = _wait(child, lifeline, _Printed(printed, case))
    _end_children()
    if excess:
        say(CHANGED + excess)
        status = TAMPERED
    if status < 0:
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        with contextlib.suppress(OSError, ValueError):
            signal.signal(-status, signal.SIG_DFL)
        os.kill(keeper, -status)
        time.sleep(1.0)
    os._exit(status if status >= 0 else 128 - status)


def end_with(keeper: int) -> None:
    """Wait to be killed if the keeper is about to end: a signal takes effect some time after it was sent."""
    pending, state = 0, ""
    with contextlib.suppress(OSError):  # no descriptor is left, say
        status = Path(f"/proc/{keeper}/status").read_text(encoding="ascii", errors="replace")
        words = dict(line.split(":", 1) for line in status.splitlines())
        pending = int(words["SigPnd"], 16) | int(words["ShdPnd"], 16)
        state = words["State"].split()[0]
    if os.getppid() == keeper and not pending & _FATAL and state not in ("Z", "X"):
        return
    time.sleep(_ENDING)
    os._exit(1)


def _replace_streams(printed: int) -> None:
    """Let this process print into the pipe, and read nothing."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    for old, new in ((nothing, 0), (printed, 1), (printed, 2)):
        os.dup2(old, new)
    os.close(nothing)
    os.close(printed)


def _take_away(needed: tuple[int, ...]) -> None:
    """Put /dev/null in the place of what was open in the process that forked this one, but for what is needed.

    A socket or pipe of the user's program, or of whatever runs it, is nothing that strangers' code should write to.
    Their numbers stay taken, since objects that were copied with the process close them some day.
    """
    inherited = [int(number) for number in os.listdir("/proc/self/fd")]  # noqa: PTH208 -- a list at once
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in inherited:
        with contextlib.suppress(OSError):
            if number > 2 and number not in (*needed, nothing) and os.fstat(number):
                os.dup2(nothing, number)
    os.close(nothing)


class _Printed:
    """What a worker and its helpers print: passed on up to a limit, and counted for each case."""

    def __init__(self, pipe: int, case: Callable[[], float]) -> None:
        os.set_blocking(pipe, False)
        self.pipe, self._case, self._at = pipe, case, case()
        self._left = MOST_PRINTED
        self.written = 0
        """How much has been printed in the case that goes on [bytes]."""
        self.is_over = False
        """Whether nobody can print any more."""

    def pass_on(self, chunks: int) -> None:
        """Read at most this many chunks, and pass on what there is room for."""
        if (at := self._case()) != self._at:
            self._at, self.written = at, 0
        with contextlib.suppress(OSError):
            for _ in range(0 if self.is_over else chunks):
                said, left = os.read(self.pipe, _CHUNK), self._left
                if not said:
                    self.is_over = True
                    return
                self.written += len(said)
                self._left = max(left - len(said), 0)
                with contextlib.suppress(OSError):
                    os.write(2, said[:left] if len(said) < left or not left else said[:left] + _LEFT_OUT)


def _wait(child: int, lifeline: int, printed: _Printed) -> tuple[int, str]:
    """Wait until the child ends, or end it when the lifeline does, or when it prints or forks too much, or is stopped.

    Returns its exit status, negative for a signal, and what was wrong with it, in words.
    """
    ended = os.pidfd_open(child)
    poll = select.poll()
    for descriptor in (ended, lifeline, printed.pipe):
        poll.register(descriptor, select.POLLIN)
    counted, excess, stops = time.monotonic(), "", 0
    while True:
        ready = {descriptor for descriptor, _ in poll.poll(1000.0 * _LOOK)}
        if printed.pipe in ready:
            printed.pass_on(1)
            if printed.is_over:
                poll.unregister(printed.pipe)
            if not excess and printed.written > MOST_WRITTEN:
                excess = _TOO_MUCH
                _kill(child)
        if not excess and time.monotonic() - counted >= _LOOK:
            _wait_for_orphans(child)
            many, counted = _count_below(os.getpid(), MOST_PROCESSES + 1) > MOST_PROCESSES + 1, time.monotonic()
            if many:
                excess = f"it had more than {MOST_PROCESSES} processes at once"
                _kill(child)
            signal_there = _stopped_by(child)
            stops = stops + 1 if signal_there else 0
            if not excess and stops >= _STOPPED:
                excess = f"it was stopped by {named_signal(signal_there)}"
                _kill(child)
        if lifeline in ready:
            _kill(child)
            poll.unregister(lifeline)
        if ended in ready:
            printed.pass_on(16)
            with contextlib.suppress(OSError):
                os.killpg(child, signal.SIGKILL)  # before its number can be anybody else's
            allowed = _processor_limit(child)
            _, how, used = os.wait4(child, 0)
            status = os.waitstatus_to_exitcode(how)
            by_limit = status in _BY_PROCESSOR_LIMIT and used.ru_utime + used.ru_stime >= allowed - _ROUNDING
            if not excess and by_limit and allowed < _processor_limit(0):
                excess = f"it set itself a limit of {allowed:g} s of processor time, and used it up"
            return status, excess


def _stopped_by(child: int) -> int:
    """Return the signal by which a child is stopped now, or traced; 0 if it is not."""
    with contextlib.suppress(ChildProcessError):
        found = os.waitid(os.P_PID, child, os.WSTOPPED | os.WNOHANG | os.WNOWAIT)
        return 0 if found is None else found.si_status
    return 0


def _processor_limit(process: int) -> float:
    """Return for how long a process, also one that has ended, may use a processor [s]; 0 is this one."""
    limits: tuple[int, ...] = ()
    with contextlib.suppress(OSError):
        limits = resource.prlimit(process, resource.RLIMIT_CPU)
    return min((float(one) for one in limits if one != resource.RLIM_INFINITY), default=math.inf)


def _kill(child: int) -> None:
    """Kill a child, and those of its group."""
    with contextlib.suppress(OSError):
        os.killpg(child, signal.SIGKILL)
    os.kill(child, signal.SIGKILL)


def _wait_for_orphans(child: int) -> None:
    """Let those that this process has adopted, and that have ended, go; the child itself stays to be waited for."""
    with contextlib.suppress(ChildProcessError):
        while found := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if found.si_pid == child:
                return
            os.waitpid(found.si_pid, 0)


def _count_below(process: int, most: int) -> int:
    """Return how many processes descend from one; counts no farther than just beyond `most`."""
    below, found = [process], 0
    while below and found <= most:
        with contextlib.suppress(OSError, ValueError):
            for task in Path(f"/proc/{below.pop()}/task").iterdir():
                children = [int(word) for word in (task / "children").read_text(encoding="ascii").split()]
                found += len(children)
                below += children
    return found


def _end_children() -> None:
    """Kill all children of this process, those that it has adopted too, until there are no more."""
    until = time.monotonic() + _ENDING
    while time.monotonic() < until:
        for child in _children():
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(0.001)


def _children() -> list[int]:
    """Return the ids of the children of this process."""
    me = os.getpid()
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            with contextlib.suppress(OSError, ValueError, IndexError):
                stat = (entry / "stat").read_text(errors="replace")
                if int(stat.rpartition(")")[2].split()[1]) == me:
                    found.append(int(entry.name))
    return found
