"""Components in this process on the real clock -> a trace: how long their work really takes on this machine.

One thread runs all components, so a duration contains no waiting for another processor, and whatever two
components could do at the same time is done one after the other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from parcours.errors import BadRequest
from parcours.run.clocks import WallClock
from parcours.run.hosts.channel_delay import ChannelDelay
from parcours.run.hosts.exchange import Exchange
from parcours.run.hosts.slots import Answer, silence
from parcours.run.noise import Noise
from parcours.run.port import Component, Link
from parcours.run.trace import Row, Trace, TraceEvent


class WallClockHost(Exchange):
    """The rules of the simulated host, with execution times as they really are.

    Args:
        components: the system under test; who is absent is played by the environment.
        links: the channels between them.
        environment: the tester, as for `SimulatedHost`; the time it takes is part of what is measured.
        channel_delays: channel -> latency, drop rate, reordering; latencies are really waited for.
        rng: the source of what the channel_delays draw.

    Raises:
        HostFailure: two components share a name, or a channel_delay names no link.
    """

    label = "wallclock"

    def __init__(
        self,
        components: Sequence[Component],
        links: Sequence[Link],
        *,
        environment: Component | Answer = silence,
        channel_delays: Mapping[str, ChannelDelay] | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(
            components, links, WallClock(), environment=environment, channel_delays=channel_delays, rng=rng
        )


def measure(
    host: WallClockHost,
    exercise: Callable[[WallClockHost], None],
    *,
    repeats: int,
    warm_up: int = 3,
    noise_samples: int = 2000,
) -> Trace:
    """Return the trace of all repeats of an exercise, one after the other, with the noise of the machine.

    The host is reset before every repeat. Half of the noise is measured before the repeats and half after.

    Args:
        host: stays open.
        exercise: injects and runs, e.g. `lambda host: (host.inject("ask", 1), host.run(10**9))`.
        repeats: how many are recorded, at least 1; a note `repeat` stands before each.
        warm_up: how many run first and are forgotten (caches, compilation).
        noise_samples: how often the empty loop reads the clock, at least 2.

    Raises:
        BadRequest: a count is too small.
    """
    for name, count, least in (
        ("repeats", repeats, 1),
        ("warm_up", warm_up, 0),
        ("noise_samples", noise_samples, 2),
    ):
        if count < least:
            raise BadRequest("measure", f"{name} is at least {least}, but was given as {count}", slug="count-range")
    for _ in range(warm_up):
        host.reset()
        exercise(host)
    quiet = _empty_loop(noise_samples // 2)
    events: list[TraceEvent] = []
    row = Row()
    for _ in range(repeats):
        host.reset()
        exercise(host)
        events += row.next(host.trace().events)
    quiet += _empty_loop(noise_samples - noise_samples // 2)
    return Trace("wall", tuple(events), host.label, noise=Noise(tuple(quiet), "reading the clock"))


def _empty_loop(samples: int) -> list[int]:
    stamps = [0] * (samples + 1)
    for k in range(samples + 1):
        stamps[k] = time.perf_counter_ns()
    return [after - before for before, after in pairwise(stamps)]
