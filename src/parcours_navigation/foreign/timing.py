"""Durations between channels of foreign nodes, and verdicts on the binding's limits.

A duration runs from when a message was handed to its receiver until the next message was heard on the other channel:
it holds the transport twice, and nothing that the tester itself takes or keeps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeAlias

from parcours.abtc import interaction_paths
from parcours.model.structure import ENVIRONMENT
from parcours.report.timings import TimingCase
from parcours.run.binding.structure import Binding, BoundEntry
from parcours.run.hosts.foreign.session import Session
from parcours.run.noise import Noise, NoiseMeter
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, Chain, judge, parse_bound
from parcours.verdict.timing.chains import reactions
from parcours_navigation.foreign.tester_messages import Maker

Shares: TypeAlias = "tuple[int, ...]"
"""How long something took, in the shares of what took it [ns]; only `NEVER` if it did not end."""

Timed: TypeAlias = "tuple[TimingCase, Chain | None]"
"""What was judged, and of a chain its shares."""

_GAP = 5_000_000
_LONGEST = 1_000_000_000
"""How long to wait for an answer [ns] before the repeat counts as one that never ended."""


def spans(binding: Binding) -> tuple[BoundEntry, ...]:
    """Return what the binding's `timing` bounds, each with the channels from and to which it is timed.

    An interaction runs from its first hop to its last; one of a single hop, from what its first component is given.
    """
    found = (bound if bound.begin else _placed(binding, bound) for bound in binding.timing)
    return tuple(bound for bound in found if bound.begin and bound.end)


def _placed(binding: Binding, bound: BoundEntry) -> BoundEntry:
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


def steps(binding: Binding, span: BoundEntry) -> tuple[str, ...]:
    """Return what takes the shares of a chain: components, and `on CHANNEL` while a message is with the tester."""
    found: list[str] = []
    for before, after in itertools.pairwise(span.channels):
        found += [binding.ends(before)[1] or binding.ends(after)[0] or "nodes", f"on {after}"]
    return tuple(found[:-1])


def durations(events: Iterable[TraceEvent], span: BoundEntry) -> list[Shares]:
    """Return how long each span took [ns], in order; of a chain the share of each of its steps."""
    if span.through:
        return list(reactions(sorted(events, key=lambda event: event.time), span.channels, span.name))
    found: list[Shares] = []
    opened: int | None = None
    for event in events:
        if event.kind == "send" and event.channel == span.end and opened is not None:
            found.append((event.time - opened,))
            opened = None
        if event.kind == "receive" and event.channel == span.begin:
            opened = event.time
    return found


def driven(events: Sequence[TraceEvent], span: BoundEntry) -> list[Shares]:
    """Return how long each span took in a system case [ns]; a chain once its last channel has spoken at all."""
    if span.through:
        starts = (event.time for event in events if (event.kind, event.channel) == ("send", span.end))
        first = min(starts, default=0)
        events = [event for event in events if event.time >= first]
    return durations(events, span)


def is_exercised(span: BoundEntry, binding: Binding) -> bool:
    """Whether a span that the tester can begin is repeated; chains that begin with what robots sense need a drive."""
    sensed = binding.system.sense if binding.system is not None else ()
    return not (span.through and span.begin in dict(sensed))


class SpanExercise:
    """Makes spans happen one after the other in a started session, and measures the machine between them."""

    def __init__(self, session: Session, maker: Maker, meter: NoiseMeter) -> None:
        self._session, self._maker, self._meter = session, maker, meter
        self._heard: list[TraceEvent] = []

    def listen(self, event: TraceEvent) -> None:
        """Take note of an event of the session."""
        if event.kind in ("send", "receive"):
            self._heard.append(event)

    def run(self, span: BoundEntry, repeats: int) -> list[Shares]:
        """Return the durations of some repeats [ns]; NEVER for one that did not end."""
        session, found = self._session, list[Shares]()
        for _ in range(repeats):
            self._meter.sample()
            self._heard.clear()
            data = self._maker.of_the_environment(span.begin, session.now() - session.case_began)
            session.relay.inject(span.begin, data)
            until = session.now() + _LONGEST
            while not (took := durations(self._heard, span)) and session.now() < until and not session.deaths:
                session.poll(until)
            found.append(took[0] if took else (NEVER,))
            if session.deaths:
                break
            rest = session.now() + _GAP
            while session.now() < rest:
                session.poll(rest)
        return found


def timed(span: BoundEntry, took: list[Shares], warm_up: int, noise: Noise | None, names: Sequence[str]) -> list[Timed]:
    """Return the durations of a span with their verdicts, one for each limit; the first ones do not count.

    Of a chain, `names` are those of its steps.
    """
    kept = took[warm_up:] if len(took) > warm_up else []
    whole = tuple(map(sum, kept))
    chain = Chain(span.name, tuple(names), tuple(row for row in kept if len(row) == len(names))) if names else None
    found = []
    for text in span.texts:
        bound = parse_bound(text)
        if kept:
            judgement = judge(whole, bound, noise)
        else:
            why = f"{len(took)} repeats were seen, of which {warm_up} are warm-up [few-repeats]"
            judgement = Judgement(Verdict.INCONCLUSIVE, why)
        found.append((TimingCase(span.name, whole, bound, judgement), chain))
    return found
