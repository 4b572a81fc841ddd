"""A plan and the k-th message of a channel -> what befalls it: from the seed alone, the same on every host.

The numbers are drawn by counter, not from a stream: BLAKE2b of (seed, channel, kind, k). So neither timing, nor other
channels, nor other faults of the plan change what one fault does to one message.
"""

from __future__ import annotations

from dataclasses import dataclass

from parcours.run.faults.corruption import How
from parcours.run.faults.figures import time_text
from parcours.run.faults.plan import ChannelFault, FaultPlan
from parcours.streams import hashed


@dataclass(frozen=True, slots=True)
class Effect:
    """What befalls one message.

    Attributes:
        copies: how much later each copy of it arrives [ns]; empty if it is lost.
        corrupt: the seed by which its content is changed (`corrupted`), or None.
        how: in which way.
        reorder: whether later messages may overtake it.
        why: what has befallen it, in words; empty if nothing has.
    """

    copies: tuple[int, ...] = (0,)
    corrupt: int | None = None
    how: How = "any"
    reorder: bool = False
    why: str = ""


UNTOUCHED = Effect()
"""The effect of a message that nothing befalls."""


class Effects:
    """What befalls the messages of a run by a plan.

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
        """Return whether anything can befall a message of the channel."""
        return channel in self._faults

    def effect(self, channel: str, k: int, time: int) -> Effect:
        """Return what befalls the k-th message of a channel.

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
