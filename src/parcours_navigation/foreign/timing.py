"""Durations between channels of foreign nodes, and verdicts on the binding's limits.

A duration runs from when a message was handed to its receiver until the next message was heard on the other channel:
it holds the transport twice, and nothing that the tester itself takes or keeps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import replace

from parcours.abtc import interaction_paths
from parcours.model.structure import ENVIRONMENT
from parcours.report.timings import TimingCase
from parcours.run.binding.structure import Binding, Bound
from parcours.run.hosts.foreign.session import Session
from parcours.run.noise import Noise, NoiseMeter
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, judge, parse_bound
from parcours_navigation.foreign.tester_messages import Maker

_GAP = 5_000_000
_LONGEST = 1_000_000_000
"""How long to wait for an answer [ns] before the repeat counts as one that never ended."""


def spans(binding: Binding) -> tuple[Bound, ...]:
    """Return what the binding's `timing` bounds, each with the channels from and to which it is timed.

    An interaction runs from its first hop to its last; one of a single hop, from what its first component is given.
    """
    found = (bound if bound.begin else _placed(binding, bound) for bound in binding.timing)
    return tuple(bound for bound in found if bound.begin and bound.end)


def _placed(binding: Binding, bound: Bound) -> Bound:
    """Return the limits on an interaction of the model with the channels where it begins and ends."""
    model = binding.model
    visited = dict(model.interactions).get(bound.name, ())
    if not visited:
        visited = next((one.components for one in interaction_paths(model) if one.name == bound.name), ())
    hops = list(itertools.pairwise(visited))
    if not hops:
        return bound
    names = {channel.name for channel in binding.channels}

    def between(sender: str, receiver: str) -> str:
        found = (one.name for one in model.channels if (one.sender, one.receiver) == (sender, receiver))
        return next((name for name in found if name in names), "")

    first = hops[0] if len(hops) > 1 else (ENVIRONMENT, visited[0])
    return replace(bound, begin=between(*first), end=between(*hops[-1]))


def durations(events: Iterable[TraceEvent], span: Bound) -> list[int]:
    """Return how long each span took [ns], in order."""
    found: list[int] = []
    opened: int | None = None
    for event in events:
        if event.kind == "send" and event.channel == span.end and opened is not None:
            found.append(event.time - opened)
            opened = None
        if event.kind == "receive" and event.channel == span.begin:
            opened = event.time
    return found


class Exercise:
    """Makes spans happen one after the other in a started session, and measures the machine between them."""

    def __init__(self, session: Session, maker: Maker, meter: NoiseMeter) -> None:
        self._session, self._maker, self._meter = session, maker, meter
        self._heard: list[TraceEvent] = []

    def listen(self, event: TraceEvent) -> None:
        """Take note of an event of the session."""
        if event.kind in ("send", "receive"):
            self._heard.append(event)

    def run(self, span: Bound, repeats: int) -> list[int]:
        """Return the durations of some repeats [ns]; NEVER for one that did not end."""
        session, found = self._session, []
        for _ in range(repeats):
            self._meter.sample()
            self._heard.clear()
            data = self._maker.of_the_environment(span.begin, session.now() - session.case_began)
            session.relay.inject(span.begin, data)
            until = session.now() + _LONGEST
            while not (took := durations(self._heard, span)) and session.now() < until and not session.deaths:
                session.poll(until)
            found.append(took[0] if took else NEVER)
            if session.deaths:
                break
            rest = session.now() + _GAP
            while session.now() < rest:
                session.poll(rest)
        return found


def timed(span: Bound, took: list[int], warm_up: int, noise: Noise | None) -> list[TimingCase]:
    """Return the durations of a span with their verdicts, one for each limit; the first ones do not count."""
    kept = took[warm_up:] if len(took) > warm_up else []
    found = []
    for text in span.texts:
        bound = parse_bound(text)
        if kept:
            judgement = judge(kept, bound, noise)
        else:
            why = f"{len(took)} repeats were seen, of which {warm_up} are warm-up [few-repeats]"
            judgement = Judgement(Verdict.INCONCLUSIVE, why)
        found.append(TimingCase(span.name, tuple(kept), bound, judgement))
    return found
