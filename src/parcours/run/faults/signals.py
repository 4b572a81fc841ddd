"""Faults of a component -> when its process is to be stopped, let go on, or killed, on a host of real processes.

A slow-down by a factor f lets the process run for 1/f of every slice of time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from parcours.errors import BadRequest
from parcours.run.faults.plan import FaultPlan

SLICE = 20_000_000
"""So long is one turn of a slowed-down process: running, then stopped [ns]."""


@dataclass(frozen=True, slots=True)
class Signal:
    """At `time` [ns since the run began] the component's process is stopped, continued, or killed."""

    time: int
    component: str
    act: Literal["stop", "continue", "kill"]


def signals(plan: FaultPlan, component: str, piece: int = SLICE) -> Iterator[Signal]:
    """Yield what to do to the process of a component, in order of time; without end if a slow-down has none.

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
