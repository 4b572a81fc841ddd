"""Durations between channels of foreign nodes, and verdicts on the binding's limits.

A duration runs from when a message was handed to its receiver until the next message was heard on the other channel:
it holds the transport twice, and nothing that the tester itself takes or keeps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from parcours.abtc import interaction_paths
from parcours.model.structure import ENVIRONMENT, Cefsm
from parcours.report.timings import Timed
from parcours.run.binding.structure import Binding
from parcours.run.binding.structure import Bound as BoundText
from parcours.run.hosts.ros1.foreign_session import Session
from parcours.run.noise import Noise, NoiseMeter
from parcours.run.trace import TraceEvent
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, judge, parse_bound
from parcours_navigation.foreign.tester_messages import Maker

_GAP = 5_000_000
_LONGEST = 1_000_000_000
"""How long to wait for an answer [ns] before the repeat counts as one that never ended."""


@dataclass(frozen=True, slots=True)
class Span:
    """What is timed: from the first channel to the second."""

    name: str
    begin: str
    end: str
    texts: tuple[str, ...]


def spans(binding: Binding) -> tuple[Span, ...]:
    """Return the spans that the binding's `timing` bounds.

    An interaction runs from its first hop to its last; one of a single hop, from what its first component is given.
    """
    found = []
    for bound in binding.timing:
        begin, end = (bound.begin, bound.end) if bound.begin else _of_interaction(binding, bound)
        if begin and end:
            found.append(Span(bound.name, begin, end, bound.texts))
    return tuple(found)


def _of_interaction(binding: Binding, bound: BoundText) -> tuple[str, str]:
    model = binding.model
    visited = next((parts for name, parts in model.interactions if name == bound.name), ())
    if not visited:
        visited = next((one.components for one in interaction_paths(model) if one.name == bound.name), ())
    hops = list(itertools.pairwise(visited))
    if not hops:
        return "", ""
    bound_names = {channel.name for channel in binding.channels}
    first, last = (_between(model, *hop, bound_names) for hop in (hops[0], hops[-1]))
    if len(hops) == 1:
        first = _between(model, ENVIRONMENT, visited[0], bound_names)
    return first, last


def _between(model: Cefsm, sender: str, receiver: str, bound: set[str]) -> str:
    found = (one.name for one in model.channels if (one.sender, one.receiver) == (sender, receiver))
    return next((name for name in found if name in bound), "")


def durations(events: Iterable[TraceEvent], span: Span) -> list[int]:
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
    """Makes spans happen one after the other, and measures the machine between them.

    Args:
        session: started, every node run once.
        maker: makes the tester's messages.
        meter: open.
    """

    def __init__(self, session: Session, maker: Maker, meter: NoiseMeter) -> None:
        self._session, self._maker, self._meter = session, maker, meter
        self._heard: list[TraceEvent] = []

    def listen(self, event: TraceEvent) -> None:
        """Take note of an event of the session."""
        if event.kind in ("send", "receive"):
            self._heard.append(event)

    def run(self, span: Span, repeats: int) -> list[int]:
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


def timed(span: Span, took: list[int], warm_up: int, noise: Noise | None) -> list[Timed]:
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
        found.append(Timed(span.name, tuple(kept), bound, judgement))
    return found
