"""What a fault plan does to each message of a channel, and to the processes of components: the same on every host.

The numbers are drawn by counter, not from a stream: BLAKE2b of (seed, channel, kind, k). So neither timing, nor other
channels, nor other faults of the plan change what one fault does to one message.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from parcours.errors import BadRequest
from parcours.run.faults.corruption import How
from parcours.run.faults.plan import ChannelFault, FaultPlan, time_text
from parcours.streams import hashed


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
    >>> effects = Effects(plan)
    >>> [k for k in range(20) if not effects.effect("a", k, 100).copies]
    [4, 6, 7, 10, 11, 17]
    >>> effects.effect("a", 6, 99).copies, effects.effect("b", 6, 100) is UNTOUCHED
    ((5,), True)
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
        """Return what happens to the k-th message of a channel.

        Args:
            channel: its name.
            k: how many were sent on it before since the run began.
            time: when it is sent [ns since the run began]; only decides which faults are in force.
        """
        faults = self._faults.get(channel)
        if faults is None:
            return UNTOUCHED
        later, spread, corrupt, reorder = 0, -1, None, False
        how: How = "any"
        why: list[str] = []
        for fault in faults:
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
        key = self._seed + k.to_bytes(8, "little") + f"{kind} {channel}".encode()
        one, other, word = hashed(key, 3)
        return (one >> 11) * 2.0**-53, (other >> 11) * 2.0**-53, word >> 1


SLICE = 20_000_000
"""One turn of a slowed-down process: running, then stopped [ns]."""


@dataclass(frozen=True, slots=True)
class Signal:
    """At `time` [ns since the run began] the component's process is stopped, continued, or killed."""

    time: int
    component: str
    act: Literal["stop", "continue", "kill"]


def signals(plan: FaultPlan, component: str, piece: int = SLICE) -> Iterator[Signal]:
    """Yield what to do to the process of a component, in order of time; without end if a slow-down has none.

    A slow-down by a factor f lets the process run for 1/f of every slice of time.

    Args:
        plan: the faults.
        component: by the model's name.
        piece: how long one turn of a slowed-down process is [ns], at least 1000.

    Raises:
        BadRequest: the turn is too short.

    >>> from parcours.run.faults.text import parse_plan
    >>> plan = parse_plan("A: slow down 4 x at 1 us for 3 us\\nA: crash at 9 us")
    >>> [(one.time, one.act) for one in signals(plan, "A", 2000)]
    [(1500, 'stop'), (3000, 'continue'), (3500, 'stop'), (4000, 'continue'), (9000, 'kill')]
    """
    if piece < 1000:
        raise BadRequest("signals", f"a turn must be at least 1000 ns, but is {piece} ns", slug="fault-range")
    for fault in plan.of_components:
        if fault.component != component:
            continue
        until = fault.until_ns
        if fault.kind == "crash":
            yield Signal(fault.at_ns, component, "kill")
        elif fault.kind == "freeze":
            yield Signal(fault.at_ns, component, "stop")
            if until is not None:
                yield Signal(until, component, "continue")
        else:
            begin = fault.at_ns
            while until is None or begin < until:
                stop, end = begin + int(piece / fault.factor), begin + piece
                if until is not None:
                    stop, end = min(stop, until), min(end, until)
                if stop < end:
                    yield Signal(stop, component, "stop")
                    yield Signal(end, component, "continue")
                begin = end
