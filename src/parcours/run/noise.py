"""Measures the noise of the machine between the repeats of a run: what it adds to work that needs no time.

One sample has the shape of an interaction between processes without its content: some round trips to a bare
process that sleeps until it is woken, then some work of the processor, of which only what was lost counts
(interrupts, other processes: the detours of Beckman et al., CLUSTER 2006, in a fixed quantum of work as of Sottile
& Minnich, CLUSTER 2004). A sample of another shape tells little: what runs ten times as long is interrupted ten
times as often.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self, cast

from parcours.errors import BadRequest, HostFailure

_ECHO = "import os, sys\nend = int(sys.argv[1])\nwhile byte := os.read(end, 1):\n    os.write(end, byte)\n"
"""The bare process. It ends by itself when the meter's end of the line is closed, also by a kill."""

_DETOUR = 2_000
"""Two readings of the clock further apart [ns] had something else between them: a reading takes some 100 ns."""

_PATIENCE = 5.0
"""How long an answer of the bare process is waited for [s]."""


@dataclass(frozen=True, slots=True)
class Noise:
    """How much time the machine added, once a sample, in order of size.

    Attributes:
        times: at least one, not negative [ns], shape (n_samples,); sorted here.
        of: what a sample was, in words.

    Raises:
        BadRequest: there is no sample, or a negative one.

    >>> noise = Noise((30_000, 10_000, 20_000), "1 round trip")
    >>> noise.samples, noise.p50, noise.p99, noise.max
    (3, 20000, 30000, 30000)
    """

    times: tuple[int, ...]
    of: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", tuple(sorted(self.times)))
        if not self.times or self.times[0] < 0:
            given = f"{self.times[0]} ns" if self.times else "none"
            raise BadRequest("noise", f"at least one sample, none below 0 ns, but {given} given", slug="noise-samples")

    def listed(self) -> list[object]:
        """Return it as a list that files may hold; `noise_of` reads it."""
        return [self.of, *self.times]

    @property
    def samples(self) -> int:
        """How often it was measured."""
        return len(self.times)

    @property
    def p50(self) -> int:
        """The least time that half of the samples did not exceed [ns]."""
        return self.times[(self.samples - 1) // 2]

    @property
    def p99(self) -> int:
        """The least time that 99 % of the samples did not exceed [ns]."""
        return self.times[-(-99 * self.samples // 100) - 1]

    @property
    def max(self) -> int:
        """The largest sample [ns]."""
        return self.times[-1]


def noise_of(listed: object) -> Noise:
    """Return the noise of a list that `Noise.listed` gave. Raises ValueError if it is not one.

    >>> noise_of(Noise((1, 5), "2 round trips").listed()).max
    5
    """
    match listed:
        case [str(of), int(), *_] if all(type(one) is int and one >= 0 for one in listed[1:]):
            return Noise(tuple(cast("list[int]", listed[1:])), of)
    raise ValueError("noise is what a sample was, and then its times")


class NoiseMeter:
    """Measures noise between the repeats of a run, so that both meet the same machine.

    Use it as a context manager; the bare process lives as long.

    Args:
        trips: round trips to the bare process a sample, at least 0; as many as the interaction has messages, halved.
        work: the processor's time a sample [ns], at least 0; about as much as the interaction needs.

    Raises:
        BadRequest: a number is negative, or both are 0.

    >>> with NoiseMeter(trips=2, work=10_000) as meter:
    ...     for repeat in range(3):                       # here stands what is to be timed
    ...         meter.sample(10)
    >>> noise = meter.noise()
    >>> noise.samples, noise.of, 0 < noise.p50 <= noise.p99 <= noise.max
    (30, '2 round trips and 0.01 ms of work', True)
    """

    def __init__(self, *, trips: int = 2, work: int = 1_000_000) -> None:
        if min(trips, work) < 0 or trips + work == 0:
            rule = f"trips and work are at least 0 and not both 0, but {trips} and {work} ns given"
            raise BadRequest("noise meter", rule, slug="count-range")
        self._trips, self._work = trips, work
        self._times: list[int] = []
        self._line: socket.socket | None = None
        self._echo: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self._line, other = socket.socketpair()
        self._line.settimeout(_PATIENCE)
        with other:
            self._echo = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _ECHO, str(other.fileno())],
                pass_fds=(other.fileno(),), start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        try:
            self._round_trip()  # its start is not noise
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def sample(self, n: int = 1) -> None:
        """Measure n times, one after the other.

        Raises:
            HostFailure: the meter is not open, or its bare process does not answer within 5 s.
        """
        for _ in range(n):
            begin = time.perf_counter_ns()
            for _ in range(self._trips):
                self._round_trip()
            travelled = time.perf_counter_ns() - begin if self._trips else 0
            self._times.append(travelled + lost(self._work, time.perf_counter_ns))

    def noise(self) -> Noise:
        """Return what was measured so far.

        Raises:
            BadRequest: nothing was.
        """
        trips = [f"{self._trips} round trip{'s' if self._trips > 1 else ''}"] if self._trips else []
        work = [f"{self._work * 1e-6:g} ms of work"] if self._work else []
        return Noise(tuple(self._times), " and ".join(trips + work))

    def _round_trip(self) -> None:
        try:
            if self._line is None:
                raise ConnectionError("it is not open")
            self._line.sendall(b".")
            if not self._line.recv(1):
                raise ConnectionError("it has ended")
        except OSError as error:
            reason = f"it must answer within {_PATIENCE:g} s, but: {error}"
            remedy = "open the meter with `with`, and let its process run"
            raise HostFailure("noise meter's bare process", reason, remedy, slug="noise-meter") from error

    def _close(self) -> None:
        if self._line is not None:
            self._line.close()
        if self._echo is not None:
            self._echo.kill()  # a stopped process would not notice that the line is closed
            self._echo.wait()
        self._line = self._echo = None


def lost(work: int, read: Callable[[], int]) -> int:
    """Return how much longer than `work` the processor took for `work` of reading the clock [ns].

    Args:
        work: time of undisturbed reading [ns].
        read: the clock [ns].

    >>> clock = iter([0, 100, 5_100, 5_200, 5_300])     # 5 us went elsewhere
    >>> lost(300, clock.__next__)
    5000
    """
    last, done, away = read(), 0, 0
    while done < work:
        now = read()
        gap = now - last
        last = now
        if gap > _DETOUR:
            away += gap
        else:
            done += gap
    return away
