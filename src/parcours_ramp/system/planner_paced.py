"""RAMP's planner as one thread whose work takes time, and the guard beside it: the component form with latencies.

The same rules as `planner_thread`, which is compiled, and the same durations, drawn from the same stream in the same
order. What is computed holds from the start of the work; then the thread sleeps, and messages wait for it: of obstacle
lists and reports only the newest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from parcours.kernels import Record
from parcours.run.port import Link
from parcours.streams import start
from parcours_ramp.planner import messages
from parcours_ramp.planner.control import Control
from parcours_ramp.planner.guard import GUARD_PERIOD, is_imminent, take_report
from parcours_ramp.planner.latency import Latencies, draw
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.planner import Message, Planner
from parcours_ramp.planner.service import Timeless
from parcours_ramp.system.workspace import FAR, ROOM

_CLOCK = np.uint64(3)  # Purpose of the random stream of durations
_CALLBACKS = ("obstacles", "update")
_TO_CONTROL = ("imminent_collision", "halt", "speed_limit")

Pass = Callable[[int], None]  # brings the world to a time [ns]


class PacedPlanner(Planner):
    """The planner, asleep while its thread is busy.

    Args:
        world: called with the time [ns] before anything is done at it.
    """

    def __init__(
        self, parameters: Parameters, seed: int, case: int, begin: Record, goal: tuple[float, float],
        latencies: Latencies, world: Pass,
    ) -> None:  # fmt: skip
        self._latencies, self._world = latencies.record(), world
        self._clock_of = np.uint64(seed), np.uint64(case), _CLOCK
        self.expected: Callable[[int], None] = lambda due: None
        """Called when a trajectory leaves, with the time [ns] at which it will arrive."""
        super().__init__(parameters, seed, case, begin, goal)

    def reset(self) -> None:
        """Start again, with the stream of durations."""
        super().reset()
        self.clock = np.zeros(1, np.uint64)
        start(self.clock, *self._clock_of)
        self._asleep = False
        self._free = 0
        self._next_guard = GUARD_PERIOD if self._is_original else FAR
        self._begun = False
        self.late: list[int] = []
        """When those planning cycles began [ns] that took longer than their period."""

    @property
    def deaf(self) -> tuple[str, ...]:
        """What waits while the thread works or sleeps."""
        return _CALLBACKS if self._asleep or self._conversation is not None else ()

    def next_wake(self) -> int | None:
        """When the thread is free again; then what has been due longest, up to when it woke for its callbacks."""
        if self._asleep:
            return self._free
        if self._conversation is not None:
            return None
        return min(int(self._planner.t_next), self._next_guard, self._next_planning)

    def wake(self, now: int) -> Iterator[messages.PlannerStep]:
        """End the sleep, or do what has been due longest."""
        self._world(now)
        if self._asleep:
            self._asleep = False
            return
        first = min(int(self._planner.t_next), self._next_guard)
        if first > self._next_planning:
            yield from self.plan()
        elif first == self._planner.t_next:
            yield from self.control(now)
        else:
            self._next_guard = max(first + GUARD_PERIOD, now - now % GUARD_PERIOD + GUARD_PERIOD)
            self._planner.halted = 1 if is_imminent(self._planner, now, self._parameters) else 0
            yield messages.PlannerStep("", (("imminent_collision", bool(self._planner.halted)),))

    def control(self, now: int) -> Iterator[messages.PlannerStep]:
        """Run a control cycle at `now` [ns], as far as it needs no answer."""
        self.expected(now + int(self._latencies.transport))
        yield from super().control(now)

    def _take(self, channel: str, message: object, now: int) -> Iterator[messages.PlannerStep]:
        if isinstance(message, messages.Obstacles):
            yield from self._begin_sensing(message)
        else:
            yield from super()._take(channel, message, now)

    def _go_on(self, message: Message, now: int) -> Iterator[messages.PlannerStep]:
        yield from super()._go_on(message, now)
        if self._conversation is None:
            self._rest(message.tag.cycle, now)

    def _rest(self, cycle: str, now: int) -> None:
        """Sleep for as long as the cycle takes that has ended; the first control cycle is over when the case begins."""
        times = self._latencies
        if cycle == "planning":
            busy = draw(self.clock, times.planning, times.planning_spread) + int(times.added_planning)
            if busy > self._period:
                self.late.append(now)
            self._free = self._next_planning = now + max(busy, self._period)
        elif cycle == "sensing":
            self._free = now + draw(self.clock, times.sensing, times.sensing_spread)
        else:
            busy = draw(self.clock, times.control, times.control_spread) + int(times.added_planning)
            self._free = now + busy if self._begun else now
            self._begun = True
        self._asleep = self._free > now

    def look(
        self, obstacles: messages.Obstacles, report: messages.StateReport | None, now: int
    ) -> list[tuple[str, object]]:
        """Run the guard as a task beside the thread; return what it has to say to Control."""
        if report is not None:
            take_report(self._planner, report.pose, report.stamp, report.lag)
        self._reported = False
        return [send for step in self._guard(obstacles, now) for send in step.sends]


class PacedControl(Control):
    """Control, for which the world is brought to the time of each message."""

    def __init__(self, parameters: Parameters, opens: int, world: Pass) -> None:
        super().__init__(parameters, opens)
        self._world = world

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[messages.PlannerStep]:
        """Take a message."""
        if channel != "pose":
            self._world(now)
        return super().handle("imminent_collision" if channel == "halt" else channel, message, now)

    def expect(self, due: int) -> None:
        """Forget a trajectory that waits for control to begin if a newer one, on its way, arrives only after that."""
        if due > self._opens:
            self._early = None

    def wake(self, now: int) -> Iterator[messages.PlannerStep]:
        """Do what is due."""
        self._world(now)
        return super().wake(now)


class Guard(Timeless):
    """The guard: sees every obstacle list at once, and the planner's memory; it can only halt, or limit the speed."""

    name = "Guard"

    def __init__(self, planner: PacedPlanner, control: Control, latencies: Latencies) -> None:
        self._planner, self._control, self._latencies = planner, control, latencies.record()
        self._busy = 0

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[messages.PlannerStep]:
        """Look at the obstacles."""
        if not isinstance(message, messages.Obstacles):
            return
        times = self._latencies
        if sends := self._planner.look(message, self._control.reported, now):
            self._busy = draw(self._planner.clock, times.guard, times.guard_spread)
            names = {"imminent_collision": "halt"}
            yield messages.PlannerStep("", tuple((names.get(channel, channel), value) for channel, value in sends))

    def transport(self, channel: str) -> int:
        """Return how long a message that leaves now is on its way [ns]; the guard's, from when it began to look."""
        times = self._latencies
        if channel == "best_trajectory":
            return int(times.transport)
        if channel not in _TO_CONTROL:
            return 0
        busy = 0 if channel == "imminent_collision" else self._busy
        return busy + int(times.transport) + int(times.added_stop)


def paced(links: tuple[Link, ...]) -> tuple[Link, ...]:
    """Return the links of a planner that is a thread: only the newest message waits for it; its guard sees first."""
    kept = (
        Link(one.channel, one.sender, one.receiver, 1 if one.channel in _CALLBACKS else one.capacity, one.kind)
        for one in links
        if one.channel not in _TO_CONTROL
    )
    return (
        Link("sensed", "World", "Guard", 8), *kept, Link("imminent_collision", "Planner", "Control", ROOM),
        Link("halt", "Guard", "Control", ROOM), Link("speed_limit", "Guard", "Control", ROOM),
    )  # fmt: skip
