"""Measures in a dry run how long nodes are silent where they must speak, and proposes what a binding should allow."""

from __future__ import annotations

import math
from collections.abc import Iterable

from parcours.run.binding.structure import Binding
from parcours.run.trace import TraceEvent

_MARGIN = 2.0
"""How many times the longest silence that was seen should be allowed: a dry run is short, and machines get busy."""


def silences(binding: Binding, events: Iterable[TraceEvent]) -> dict[str, int]:
    """Return the longest silence of each channel on which a node sends [ns], of those that were heard twice.

    That of a topic lies between two messages; that of a response, between the request's arrival and its own.
    """
    asked = {one.address: one.name for one in binding.channels if one.part == "request"}
    requests = {
        one.name: asked[one.address] for one in binding.channels if one.part == "response" and one.address in asked
    }
    longest: dict[str, int] = {}
    last: dict[str, int] = {}
    sent = {one.name: requests.get(one.name, one.name) for one in binding.channels if one.role == "model"}
    for event in events:
        if event.kind == "send" and event.channel in sent and not event.text:
            since = last.get(sent[event.channel])
            if since is not None:
                longest[event.channel] = max(longest.get(event.channel, 0), event.time - since)
            if sent[event.channel] == event.channel:
                last[event.channel] = event.time
        elif event.kind == "receive" and event.channel in requests.values():
            last[event.channel] = event.time
    return longest


def proposals(binding: Binding, events: Iterable[TraceEvent]) -> list[str]:
    """Return a line for each channel whose quiescence is too short for what was seen."""
    found = []
    for name, longest in silences(binding, events).items():
        channel = binding.channel(name)
        wanted = _MARGIN * longest * 1e-9
        if wanted > channel.quiescence:
            least = math.ceil(10.0 * wanted) / 10.0
            found.append(
                f"{binding.source}:{channel.line}: channel {name!r} was silent for {longest * 1e-9:.3g} s, but its "
                f"quiescence is {channel.quiescence:g} s; write quiescence: {least:g} s"
            )
    return found
