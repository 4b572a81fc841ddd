"""A running program: the lines that it prints, one at a time, or why there are no more.

Nothing here waits longer than its patience, whatever the program does: it may die, hang, flood, not read its input, or
leave helpers behind that hold its streams open. Programs end with this process, also by kill -9.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import multiprocessing.util
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from typing import IO, TYPE_CHECKING, TypeVar

import msgspec

from parcours.errors import HostFailure
from parcours.run.hosts.launching import ending
from parcours.study.components.socket_door import SocketDoor

if TYPE_CHECKING:
    from parcours.study.components.systems import ProgramPart

T = TypeVar("T")
SOCKET = "PARCOURS_SOCKET"  # environment variable: the path of the socket of a program that has `socket: true`
LONGEST = 1_000_000  # most bytes of a line
_QUOTED = 80
_TAIL = 4096  # kept of what a program writes to standard error [bytes]
_CHUNK = 1 << 16
_LOOK = 0.05  # how often a silent program is asked whether it lives [s]: helpers may hold its streams open
_GRACE = 1.0  # how long a program may take to end after the end of its input [s] before it is killed
_MOST_KEPT = 16
_PARENT_DEATH = 1  # PR_SET_PDEATHSIG
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None  # a forked child could not load it safely

_alive: set[ComponentProcess] = set()
_kept: dict[object, list[ComponentProcess]] = {}
_guarded: set[int] = set()  # processes whose exit ends the programs that they have started


# One exchange. No thread of ours reads or writes: one poll serves all three streams, so that a program that neither
# reads nor ends, or fills its standard error, blocks nobody.
#
#     ask("permit") -> _outgoing --_flush--> stdin  |         |
#                      _words <--_hear_words- stderr | program |   the last 4096 bytes, for its last words
#     line()        <- _incoming <--_read--- stdout |         |
#                         |
#          whole line: the answer    no line: has_ended? -> program-ended    patience over? -> program-silent
#
# Of a program with `socket: true`, the socket takes the place of stdin and stdout once the program has connected; its
# standard output and error are then one stream, of words for people.
class ComponentProcess:
    """A running program of a component; an answer may take `patience` [s]. HostFailure if it cannot be started."""

    def __init__(self, command: list[str], part: ProgramPart, component: str, patience: float) -> None:
        self.status: int | None = None  # exit status, negative for a signal; None while it runs
        self._component, self._patience, self._owner = component, patience, os.getpid()
        self._asked, self._until = "", 0.0
        self._incoming, self._outgoing, self._words = bytearray(), bytearray(), bytearray()
        self._door = SocketDoor() if part.socket else None
        environment = {**os.environ, **part.environment, **({SOCKET: self._door.path} if self._door else {})}
        try:
            self._popen = _started(command, part, component, environment)
        except BaseException:
            self._close_door()
            raise
        streams = (self._popen.stdin, self._popen.stdout, self._popen.stderr)
        self._files: list[IO[bytes] | socket.socket] = [file for file in streams if file is not None]
        numbers = [file.fileno() for file in self._files]
        self._to, self._from, self._errors = (-1, -1, *numbers) if part.socket else numbers
        for number in numbers:
            os.set_blocking(number, False)
        _alive.add(self)

    @contextlib.contextmanager
    def exchange(self, word: str, content: object) -> Iterator[ComponentProcess]:
        """Ask a word, and let the caller read the answer; whatever goes wrong meanwhile ends the program."""
        try:
            self.ask(word, content)
            yield self
            self.require_silence()
        except BaseException:
            self.end()
            raise

    def say(self, word: str, content: object) -> None:
        """Say a word that is not answered; what is not read at once waits."""
        try:
            plain = msgspec.to_builtins({word: content}, str_keys=True)
            self._outgoing += json.dumps(plain, allow_nan=False, separators=(",", ":")).encode() + b"\n"
        except (TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
            rule = f"`{word}` must hold what JSON can hold, but: {error}"
            raise HostFailure(f"component {self._component}", rule, slug="program-message") from error
        self._flush()

    def ask(self, word: str, content: object) -> None:
        """Say a word whose whole answer must come within the patience; what it printed unasked fails it."""
        if self._owner != os.getpid():
            raise failure(self._component, "must be used by the process that started it", "program-ended")
        if self._asked:
            self._read()
            self.require_silence()
        self._asked, self._until = word, time.monotonic() + self._patience
        self.say(word, content)

    def line(self) -> bytes:
        """Return the next line. Raises HostFailure if the program ends, is silent, or prints too long a line."""
        while True:
            end = self._incoming.find(b"\n")
            if (end if end >= 0 else len(self._incoming)) > LONGEST:
                rule = f"must print lines of at most {LONGEST} bytes, but printed a longer one:"
                raise failure(self._component, f"{rule} {quoted(self._incoming)}", "program-flood")
            if end >= 0:
                line = bytes(self._incoming[:end])
                del self._incoming[: end + 1]
                return line
            self._await()

    def unanswered(self, why: str, slug: str) -> HostFailure:
        """Return the complaint that it has not answered, with what it said at last."""
        half = f"; it had printed part of a line: {quoted(self._incoming)}" if self._incoming else ""
        words = [line for line in bytes(self._words).splitlines() if line.strip()]
        last = f"; its last words: {quoted(words[-1])}" if words else ""
        return failure(self._component, f"must answer `{self._asked}`{why}{half}{last}", slug)

    def require_silence(self) -> None:
        """Raise HostFailure if more has come than the answer."""
        if self._incoming:
            rule = f"must print nothing after its answer to `{self._asked}`, but printed {quoted(self._incoming)}"
            raise failure(self._component, rule, "program-words")

    def forget_words(self) -> None:
        """Forget what it has written to standard error: that was in an earlier case."""
        self._hear_words()
        self._words.clear()

    def has_ended(self) -> bool:
        """Return whether it has ended; it stays a zombie, so that nobody else can get its process group."""
        if self.status is None:
            try:
                found = os.waitid(os.P_PID, self._popen.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            except ChildProcessError:  # somebody lets the system reap all children of this process
                self.status = 0
            else:
                if found is not None:
                    self.status = found.si_status if found.si_code == os.CLD_EXITED else -found.si_status
        return self.status is not None

    def hang_up(self) -> None:
        """Let it see the end of its input."""
        self._to = -1
        with contextlib.suppress(OSError):
            if isinstance(self._files[-1], socket.socket):
                self._files[-1].shutdown(socket.SHUT_WR)
            elif self._popen.stdin is not None:
                self._popen.stdin.close()

    def end(self, until: float = 0.0) -> None:
        """End it and its helpers; by force, unless it has ended before `until` [s, monotonic] by itself."""
        if self._owner == os.getpid():
            self.hang_up()
            while not self.has_ended() and time.monotonic() < until:
                time.sleep(0.002)
            with contextlib.suppress(OSError):
                os.killpg(self._popen.pid, signal.SIGKILL)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._popen.wait(_GRACE)
        self._close_door()
        self.let_go()
        _alive.discard(self)

    def let_go(self) -> None:
        """Close this process's ends of its streams."""
        self._to = self._from = self._errors = -1
        for file in self._files:
            with contextlib.suppress(OSError):
                file.close()

    def _await(self) -> None:
        """Wait until more has come. Raises HostFailure if nothing does."""
        while True:
            ended = self.has_ended()  # asked first: what it wrote before its end is read below
            self._flush()
            self._hear_words()
            self._let_in()
            if self._read():
                return
            left = self._until - time.monotonic()
            if ended or left <= 0:
                raise self._silence()
            poll = select.poll()
            out = self._to if self._outgoing else -1
            door = self._door.listener.fileno() if self._door is not None else -1
            wanted = {self._from: select.POLLIN, self._errors: select.POLLIN, door: select.POLLIN}
            wanted[out] = wanted.get(out, 0) | select.POLLOUT  # a socket is read and written by one number
            for number, event in wanted.items():
                if number >= 0:
                    poll.register(number, event)
            # A closed output means that its end follows at once, and no stream reports that.
            poll.poll(1000 * min(left, 0.005 if self._has_closed() else _LOOK))

    def _silence(self) -> HostFailure:
        if self.status is not None:
            return self.unanswered(f", but ended ({ending(self.status)})", "program-ended")
        what = f" connect to the socket {SOCKET}" if self._door is not None else ""
        what += " and has closed its output" if self._has_closed() else ""
        return self.unanswered(f" within {self._patience:g} s, but did not{what}", "program-silent")

    def _has_closed(self) -> bool:
        return self._from < 0 and self._door is None

    def _let_in(self) -> None:
        """Speak over the socket from now on, if the program has connected to it."""
        if self._door is not None and (connection := self._door.accepted()) is not None:
            self._files.append(connection)
            self._to = self._from = connection.fileno()
            self._close_door()

    def _close_door(self) -> None:
        if self._door is not None:
            self._door.close()
            self._door = None

    def _flush(self) -> None:
        if self._outgoing and self._to >= 0:
            try:
                del self._outgoing[: os.write(self._to, self._outgoing)]
            except BlockingIOError:
                pass
            except OSError:
                self._to = -1  # it reads no more; whether that matters, its answers will show

    def _read(self) -> bool:
        """Return whether something has come."""
        chunk = _chunk(self._from)
        if chunk == b"":
            self._from = -1
        self._incoming += chunk or b""
        return bool(chunk)

    def _hear_words(self) -> None:
        for _ in range(16):  # not until there is silence, which may never be
            chunk = _chunk(self._errors)
            if not chunk:
                self._errors = self._errors if chunk is None else -1
                return
            self._words += chunk
            del self._words[:-_TAIL]


def _chunk(number: int) -> bytes | None:
    """Return what can be read at once: nothing at the end of a stream, None if there may be more later."""
    try:
        return os.read(number, _CHUNK) if number >= 0 else b""
    except BlockingIOError:
        return None
    except OSError:
        return b""


def failure(component: str, rule: str, slug: str, remedy: str = "") -> HostFailure:
    """Return the complaint about a component's program."""
    return HostFailure(f"component {component}", f"its program {rule}", remedy, slug=slug)


def quoted(line: bytes | bytearray) -> str:
    """Return the start of what a program printed, for a message.

    >>> quoted(b"Hello"), len(quoted(b"x" * 1000)), quoted(bytes([7, 255]))
    ("'Hello'", 80, "'\\\\x07\\\\\\\\xff'")
    """
    text = repr(bytes(line[: 2 * _QUOTED]).decode(errors="backslashreplace"))
    return text if len(text) <= _QUOTED else f"{text[: _QUOTED - 4]}...{text[0]}"


def command_of(part: ProgramPart, component: str) -> list[str]:
    """Return a part's command with the program's path."""
    first = part.command[0] if part.command else ""
    path = part.environment.get("PATH")
    found = shutil.which(str(part.folder.absolute() / first) if "/" in first else first, path=path)
    if found is None:
        is_path = "/" in first
        if (part.folder / first).is_file():
            remedy = "make it executable (chmod +x), or name its interpreter first" if is_path else f"write ./{first}"
        else:
            remedy = f"{f'build it in {part.folder}' if is_path else 'install it'}, or correct `command`"
        raise failure(component, f"must be there, but {first!r} cannot be executed", "program-missing", remedy)
    return [found, *part.command[1:]]


def _started(
    command: list[str], part: ProgramPart, component: str, environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    if os.getpid() not in _guarded:  # a worker of multiprocessing runs finalizers, but no handlers of atexit
        _guarded.add(os.getpid())
        multiprocessing.util.Finalize(None, end_programs, exitpriority=10)
    parent = os.getpid()

    def bind() -> None:
        # The system kills the program when the thread that starts it has ended: the main one, as a rule.
        if _LIBC is not None:
            _LIBC.prctl(_PARENT_DEATH, signal.SIGKILL)
            if os.getppid() != parent:
                os._exit(1)  # the parent ended before this was asked for

    pipe = subprocess.PIPE
    stdin, stderr = (subprocess.DEVNULL, subprocess.STDOUT) if part.socket else (pipe, pipe)
    try:
        return subprocess.Popen(command, cwd=part.folder, env=environment, bufsize=0, process_group=0, preexec_fn=bind,
                                stdin=stdin, stdout=pipe, stderr=stderr)  # fmt: skip
    except (OSError, subprocess.SubprocessError) as error:
        rule = f"must start, but {command[0]} cannot be executed in {part.folder}: {error}"
        raise failure(component, rule, "program-missing") from error


# Programs that are sound after a case are kept for the next case of the same component: a start takes much longer than
# a case. A forked process has none of its parent's.


def take_kept(key: object) -> ComponentProcess | None:
    """Return a program that was kept under this key and still runs; None if there is none."""
    kept = _kept.get(key, [])
    while kept:
        process = kept.pop()
        if not process.has_ended():
            return process
        process.end()
    return None


def begun(
    kept: ComponentProcess | None, start: Callable[[], ComponentProcess], first: Callable[[ComponentProcess, bool], T]
) -> T:
    """Return what `first(program, is_new)` gives with a kept program, or with a new one.

    A program may do one case only. It says so by ending in good order when it is asked for a second one.
    """
    try:
        return first(kept or start(), kept is None)
    except HostFailure as error:
        if kept is None or error.slug != "program-ended" or kept.status != 0:
            raise
    return first(start(), True)


def keep(key: object, process: ComponentProcess) -> None:
    """Keep a sound program, unless there are enough."""
    if sum(map(len, _kept.values())) < _MOST_KEPT:
        _kept.setdefault(key, []).append(process)
    else:
        process.end(time.monotonic() + _GRACE)


def end_programs() -> None:
    """End all programs that this process has started: they see the end of their input, and have 1 s to end.

    Done at exit; a process that leaves by `os._exit` calls it before.
    """
    _kept.clear()
    for process in _alive:
        process.hang_up()
    until = time.monotonic() + _GRACE
    for process in list(_alive):
        process.end(until)


def _forget() -> None:
    for process in _alive:
        process.let_go()
        process._popen.returncode = 0  # it is the parent's to wait for
    _alive.clear()
    _kept.clear()


os.register_at_fork(after_in_child=_forget)
