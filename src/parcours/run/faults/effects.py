"""What a fault plan does to each message of a channel, and to the processes of components: the same on every host.

The numbers are drawn by counter, not from a stream: BLAKE2b of (seed, channel, kind, k). So neither timing, nor other
channels, nor other faults of the plan change what one fault does to one message.
"""

from __future__ import annotations

import heapq
import itertools
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from parcours.hashing import hashed
from parcours.run.faults.corruption import How
from parcours.run.faults.plan import ChannelFault, FaultPlan, time_text


@dataclass(frozen=True, slots=True)
class Effect:
    """What happens to one message.

    Attributes:
        copies: how much later each copy of it arrives [ns]; empty if it is lost.
        corrupt: the seed by which its content is changed (`corrupted`), or None.
        how: in which way.
        reorder: whether later messages may overtake it.
        why: what has happened to it, in words; empty if nothing has.
    """

    copies: tuple[int, ...] = (0,)
    corrupt: int | None = None
    how: How = "any"
    reorder: bool = False
    why: str = ""


UNTOUCHED = Effect()
"""The effect on a message to which nothing happens."""


class Effects:
    """What happens to the messages of a run by a plan.

    >>> plan = FaultPlan(7, (ChannelFault("a", "drop", 0.3, from_ns=100), ChannelFault("a", "delay", amount_ns=5)))
    >>> [k for k in range(20) if not Effects(plan).effect("a", k, 100).copies]
    [4, 6, 7, 10, 11, 17]
    """

    def __init__(self, plan: FaultPlan) -> None:
        self._seed = plan.seed.to_bytes(8, "little")
        self._faults: dict[str, list[ChannelFault]] = {}
        for fault in sorted(plan.of_channels, key=lambda one: (one.kind, one.from_ns)):
            self._faults.setdefault(fault.channel, []).append(fault)

    def concerns(self, channel: str) -> bool:
        """Return whether anything can happen to a message of the channel."""
        return channel in self._faults

    def effect(self, channel: str, k: int, time: int) -> Effect:
        """Return what happens to the k-th message of a channel, counted from 0, that is sent at `time`.

        The time [ns since the run began] only decides which faults are in force.
        """
        later, spread, corrupt, reorder = 0, -1, None, False
        how: How = "any"
        why: list[str] = []
        for fault in self._faults.get(channel, ()):
            if not fault.reaches(k, time):
                continue
            strikes, much, word = self._draw(channel, fault.kind, k)
            if strikes >= fault.probability:
                continue
            match fault.kind:
                case "drop":
                    return Effect((), why="lost")
                case "delay":
                    later += fault.amount_ns
                    why.append(f"delayed by {time_text(fault.amount_ns)}")
                case "jitter":
                    drawn = int(much * (fault.amount_ns + 1))
                    later += drawn
                    why.append(f"late by {time_text(drawn)}")
                case "reorder":
                    later, reorder = later + fault.amount_ns, True
                    why.append(f"held back for {time_text(fault.amount_ns)}")
                case "duplicate":
                    spread = fault.amount_ns
                    why.append("doubled" + (f", again after {time_text(spread)}" if spread else ""))
                case "corrupt":
                    corrupt, how = word, fault.how
                    why.append("corrupted")
        if not why:
            return UNTOUCHED
        copies = (later,) if spread < 0 else (later, later + spread)
        return Effect(copies, corrupt, how, reorder, ", ".join(why))

    def _draw(self, channel: str, kind: str, k: int) -> tuple[float, float, int]:
        """Return two numbers from [0, 1) and a word of 63 bits."""
        one, other, word = hashed(self._seed + k.to_bytes(8, "little") + f"{kind} {channel}".encode(), 3)
        return (one >> 11) * 2.0**-53, (other >> 11) * 2.0**-53, word >> 1


class Agenda:
    """What a live host has yet to do, by time, messages on their way among it; `now` is the time of the host [ns]."""

    def __init__(self, now: Callable[[], int]) -> None:
        self._now = now
        self._due: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._last_arrival: dict[str, int] = {}
        self._on_their_way: Counter[str] = Counter()

    def at(self, when: int, act: Callable[[], None]) -> None:
        """Do something at a time [ns]."""
        heapq.heappush(self._due, (when, next(self._order), act))

    @property
    def next_due(self) -> int | None:
        """When there is something to do next [ns]."""
        return self._due[0][0] if self._due else None

    def do_what_is_due(self, after: Callable[[], None] = lambda: None) -> None:
        """Do what is due by now, and `after` each of it something else."""
        while self._due and self._due[0][0] <= self._now():
            heapq.heappop(self._due)[2]()
            after()

    def clear(self) -> None:
        """Forget what is yet to be done."""
        self._due.clear()

    # A delayed message holds up those behind it, so that a channel keeps its order; a further copy, and a message
    # that is held back on purpose, hold up nothing:
    #
    #   sent      1 (delayed)   2   3 (doubled)
    #   arrives                 1 2 3      3'
    def pass_on(self, channel: str, effect: Effect, hand_over: Callable[[], None]) -> None:
        """Hand over each copy of a message when its effect says: at once, if nothing keeps it."""
        first = effect.copies[0]
        arrival = self._now() + first
        for copy in effect.copies:
            if effect.reorder or copy != first:
                self.at(arrival + copy - first, hand_over)
                continue
            arrival = max(arrival, self._last_arrival.get(channel, 0))
            if arrival <= self._now() and not self._on_their_way[channel]:
                hand_over()
                continue

            def arrive() -> None:
                self._on_their_way[channel] -= 1
                hand_over()

            self._last_arrival[channel] = arrival
            self._on_their_way[channel] += 1
            self.at(arrival, arrive)


ACTS = {"stop": signal.SIGSTOP, "continue": signal.SIGCONT, "kill": signal.SIGKILL}
"""What a `ProcessSignal` sends to a process."""

SLICE = 20_000_000
"""One turn of a slowed-down process: running, then stopped [ns]."""


@dataclass(frozen=True, slots=True)
class ProcessSignal:
    """At `time` [ns since the run began] the component's process is stopped, continued, or killed."""

    time: int
    component: str
    act: Literal["stop", "continue", "kill"]


def signals(plan: FaultPlan, component: str) -> Iterator[ProcessSignal]:
    """Yield what to do to the process of a component, in order of time; without end if a slow-down has none."""
    # A slow-down by a factor f lets the process run for 1/f of every slice; here f = 4:
    #
    #   |##......|##......|##......|     # runs   . is stopped
    #   |<SLICE->|
    for fault in plan.of_components:
        if fault.component != component:
            continue
        until = fault.until_ns
        if fault.kind == "crash":
            yield ProcessSignal(fault.at_ns, component, "kill")
        elif fault.kind == "freeze":
            yield ProcessSignal(fault.at_ns, component, "stop")
            if until is not None:
                yield ProcessSignal(until, component, "continue")
        else:
            start = fault.at_ns
            while until is None or start < until:
                stop, end = start + int(SLICE / fault.factor), start + SLICE
                if until is not None:
                    stop, end = min(stop, until), min(end, until)
                if stop < end:
                    yield ProcessSignal(stop, component, "stop")
                    yield ProcessSignal(end, component, "continue")
                start = end
