"""Starts a command, watches its process, keeps its output, and ends it without leaving anything behind."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from parcours.errors import HostFailure
from parcours.run.faults.effects import ACTS
from parcours.run.hosts.launching import ending

_KEEPER = str(Path(__file__).with_name("process_keeper.py"))
_TAIL = 5
_LONGEST_TAIL = 4096
_ANSWER = 5.0
_WHOLE_PROCESS = 2
"""Makes of a process's number the clock of its processor time (clock_getcpuclockid(3))."""
_STEERING = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|[@-Z\\-_])")
"""Escape sequences of terminals (ECMA-48)."""


def plain_text(line: str) -> str:
    """Return a line without what only steers a terminal, such as colours.

    >>> plain_text("\\x1b[31m[ERROR] no map\\x1b[0m\\r")
    '[ERROR] no map'
    """
    return "".join(sign for sign in _STEERING.sub("", line) if sign.isprintable()).strip()


def _state(file: str) -> str:
    """Return the letter that a thread's `stat` has for its state."""
    descriptor = os.open(file, os.O_RDONLY)
    try:
        said = os.read(descriptor, 512)
    finally:
        os.close(descriptor)
    return chr(said[said.rindex(b")") + 2])


class KeptProcess:
    """A process that a command started, with everything that it starts itself.

    With a `priority` it runs in the real-time class, where that is allowed. Raises HostFailure if it cannot be started.
    """

    def __init__(self, name: str, command: Sequence[str], cwd: Path, env: Mapping[str, str], log: Path,
                 folder: str = "", priority: int = 0) -> None:  # fmt: skip
        self.name, self.command, self.log = name, tuple(command), log
        self.pid = 0
        self.status: int | None = None
        """How it ended: its exit status, negative for a signal; None while it lives."""
        self.ended = 0
        """When it ended [ns of the monotonic clock]."""
        self.rule = "SCHED_OTHER"
        """Under which rule of scheduling it was started."""
        self.was_killed = False
        """Whether it did not end when asked."""
        self._heard = b""
        self._failed = ""
        self.descriptor, other = os.pipe()
        os.set_blocking(self.descriptor, False)
        words = [sys.executable, "-I", "-S", _KEEPER, str(os.getpid()), str(other), folder, str(priority), *command]
        try:
            with log.open("ab") as output:
                self._begin = output.tell()
                self._keeper = subprocess.Popen(
                    words, cwd=cwd, env=dict(env), stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                    pass_fds=(other,), start_new_session=True,
                )  # fmt: skip
        except OSError as error:
            os.close(self.descriptor)
            self._refuse(error.strerror or str(error))
        finally:
            os.close(other)

    def await_start(self) -> None:
        """Wait until the command runs. Raises HostFailure if it cannot be run."""
        until = time.monotonic() + _ANSWER
        while not self.pid and self.is_alive and time.monotonic() < until:
            time.sleep(0.001)
            self.look()
        if self._failed:
            self._refuse(self._failed)
        if not self.pid:
            self._refuse(f"not within {_ANSWER:g} s")

    @property
    def is_alive(self) -> bool:
        """Whether it is not known to have ended."""
        return self.status is None

    def look(self) -> bool:
        """Take in what its keeper reports, without waiting; return whether it is known to have ended."""
        with contextlib.suppress(BlockingIOError):
            chunk = os.read(self.descriptor, 4096)
            *lines, self._heard = (self._heard + chunk).split(b"\n")
            for line in lines:
                match line.decode(errors="replace").split(" ", 1):
                    case "pid", pid:
                        self.pid = int(pid)
                    case "rule", rule:
                        self.rule = rule
                    case "failed", why:
                        self._failed = why
                    case "ended", how:
                        self.status, self.ended = map(int, how.split())
            if not chunk and self.status is None:  # the keeper was killed, and the command with it
                self.status, self.ended = -signal.SIGKILL, time.perf_counter_ns()
        return self.status is not None

    def act(self, what: Literal["stop", "continue", "kill"]) -> None:
        """Stop, continue or kill the process and those of its group; nothing if it has ended."""
        self._signal(ACTS[what])

    def _signal(self, number: int) -> None:
        if self.pid and self.is_alive:
            with contextlib.suppress(OSError):
                os.killpg(self.pid, number)

    def await_stop(self, within: float = 0.2) -> bool:
        """Return whether all its threads stand, after waiting for that [s]: a signal takes its time to reach them."""
        until = time.monotonic() + within
        while not (stands := self._stands()) and self.is_alive and time.monotonic() < until:
            time.sleep(0.0002)
        return stands

    def _stands(self) -> bool:
        states = self._states()
        return bool(states) and set(states) <= set("Tt")

    def _states(self) -> str:
        """Return the state of each thread, one letter each; none if it has ended."""
        folder = f"/proc/{self.pid}/task"
        with contextlib.suppress(OSError):
            return "".join(_state(f"{folder}/{thread}/stat") for thread in os.listdir(folder))  # noqa: PTH208 asked often
        return ""

    def effort(self) -> int:
        """Return the processor time of all its threads, not of what it has started [ns]; 0 if it has ended."""
        with contextlib.suppress(OSError):
            return time.clock_gettime_ns(~self.pid << 3 | _WHOLE_PROCESS)
        return 0

    def rests(self, since: int) -> bool:
        """Return whether it has worked since it had had that `effort`, and every thread waits for something now.

        A message wakes the thread that reads it, and each thread that has work the next one; so a process that rests
        has taken what was sent to it, though a callback may still wait for something else.
        """
        effort = self.effort()
        return effort != since and not set(self._states()) & set("RDTt") and self.effort() == effort

    def demand(self) -> int:
        """Return for how long its threads have had a processor, or have waited for one [ns].

        However crowded the machine is, one that starts asks for all of a processor, and one that is done for little.
        """
        folder, total = f"/proc/{self.pid}/task", 0
        with contextlib.suppress(OSError):
            for thread in os.listdir(folder):  # noqa: PTH208 asked often
                with contextlib.suppress(OSError):  # it may have ended meanwhile
                    had, waited, _ = Path(f"{folder}/{thread}/schedstat").read_text(encoding="ascii").split()
                    total += int(had) + int(waited)
        return total

    def is_wanting(self) -> bool:
        """Return whether one of its threads wants a processor, or a disk, now."""
        return bool(set(self._states()) & set("RD"))

    def how(self, began: int | None = None) -> str:
        """Return how it ended, in words, with the last lines that it has said.

        Args:
            began: since when its end is told [ns of the monotonic clock].
        """
        if self.status is None:
            return "lives"
        said = self.tail()
        when = "" if began is None else f" at {max(self.ended - began, 0) * 1e-9:.3f} s"
        return f"{ending(self.status)}{when}; " + (f"its last lines: {' | '.join(said)}" if said else "it said nothing")

    def output(self) -> str:
        """Return what it has said since it was started; its log may be that of several."""
        with self.log.open("rb") as output:
            output.seek(self._begin)
            return output.read().decode(errors="replace")

    def tail(self) -> list[str]:
        """Return the last lines of its output since it was started."""
        with contextlib.suppress(OSError), self.log.open("rb") as output:
            end = output.seek(0, os.SEEK_END)
            output.seek(max(self._begin, end - _LONGEST_TAIL))
            lines = [plain_text(line)[:300] for line in output.read().decode(errors="replace").splitlines()]
            return [line for line in lines if line][-_TAIL:]
        return []

    def ask_to_end(self) -> None:
        """Interrupt it, as Ctrl-C does."""
        self._signal(signal.SIGCONT)
        self._signal(signal.SIGINT)

    def end(self, patience: float) -> None:
        """Wait for its end [s], then force it. Again: do nothing."""
        if self.descriptor < 0:
            return
        until = time.monotonic() + patience
        while not self.look() and time.monotonic() < until:
            time.sleep(0.002)
        self.was_killed = not self.look()
        if self.was_killed:
            self.act("kill")
        try:
            self._keeper.wait(3.0)
        except subprocess.TimeoutExpired:
            self._keeper.kill()  # the command has a death signal
            self._keeper.wait()
        self.look()
        os.close(self.descriptor)
        self.descriptor = -1

    def _refuse(self, why: str) -> None:
        rule = f"must be started by {' '.join(self.command)!r:.300}, but: {why}"
        raise HostFailure(f"node {self.name}", rule, "correct its command, or build it", slug="foreign-start")
