"""Components in simulated time -> a trace: deterministic, and nothing is late that was not told to be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from parcours.run.clocks import SimulatedClock
from parcours.run.faults import FaultPlan, FlatCodec
from parcours.run.hosts.channel_delay import ChannelDelay, Execution, at_once
from parcours.run.hosts.exchange import Exchange
from parcours.run.hosts.slots import Answer, silence
from parcours.run.port import Component, Link


class SimulatedHost(Exchange):
    """A discrete-event host. The same arguments give the same trace, on every machine.

    Args:
        components: the system under test; who is absent is played by the environment.
        links: the channels between them, e.g. `links(cefsm)`.
        environment: the tester, which receives what is sent to it and injects: a function
            (channel, payload, time [ns]) -> sends, or a component called "environment".
        channel_delays: channel -> latency, drop rate, reordering; a channel that is not named delivers at once.
        execution: how long a component works on a transition [ns].
        rng: the one source of all that is drawn; without it the streams start from seed 0.
        recording: whether what happens is written into the trace; without it the trace stays empty.
        faults: what shall go wrong; under a plan, a component that raises has died and all others go on.
        codec: the flat form of the messages, for faults that corrupt them.

    Raises:
        HostFailure: two components share a name, or a channel_delay names no link.
        BadRequest: a fault names what is not there, or corrupts without a codec.
    """

    label = "simulated"

    def __init__(
        self,
        components: Sequence[Component],
        links: Sequence[Link],
        *,
        environment: Component | Answer = silence,
        channel_delays: Mapping[str, ChannelDelay] | None = None,
        execution: Execution = at_once,
        rng: np.random.Generator | None = None,
        recording: bool = True,
        faults: FaultPlan | None = None,
        codec: FlatCodec | None = None,
    ) -> None:
        super().__init__(
            components,
            links,
            SimulatedClock(),
            environment=environment,
            channel_delays=channel_delays,
            execution=execution,
            rng=rng,
            recording=recording,
            faults=faults,
            codec=codec,
        )
