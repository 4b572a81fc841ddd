"""Finds what a binding needs and a running system does not have, or has with another type."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from parcours.errors import one_of
from parcours.model.finding import Finding
from parcours.run.binding.routes import INTO, OUT, Route, routes
from parcours.run.binding.structure import Binding, BoundChannel


@dataclass(frozen=True, slots=True)
class Graph:
    """What is registered: who publishes, subscribes and serves what, without the tester's own registrations.

    Args:
        publishers: topic -> names of ROS nodes.
        subscribers: topic -> names of ROS nodes.
        servers: service -> names of ROS nodes.
        types: topic or service -> type, as far as it is known; `*` is any.
    """

    publishers: Mapping[str, Collection[str]] = field(default_factory=dict)
    subscribers: Mapping[str, Collection[str]] = field(default_factory=dict)
    servers: Mapping[str, Collection[str]] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)


def graph_findings(binding: Binding, graph: Graph, absent: Collection[str] = ()) -> list[Finding]:
    """Return which bound topics and services a running system does not have, or has with another type.

    That nobody calls a service cannot be seen: clients do not register.

    Args:
        binding: a checked binding.
        graph: what is registered once every node is up.
        absent: nodes of the binding that are not run.
    """
    found: list[Finding] = []
    for channel, route in zip(binding.channels, routes(binding, absent), strict=True):
        for address, table, need in _needs(channel, route, graph):
            if not table.get(address):
                remedy = _hint(address, table)
                rule = f"channel {channel.name!r} needs a node that {need} {address}, but none does"
                found.append(Finding(binding.source, channel.line, "error", "absent-topic", rule, remedy))
                continue
            given = graph.types.get(address, "*")
            if given not in ("*", "", channel.type):
                who = ", ".join(sorted(table[address]))
                rule = f"channel {channel.name!r} is bound as {channel.type}, but {who} {need} {address} as {given}"
                found.append(Finding(binding.source, channel.line, "error", "topic-type", rule, "correct 'type'"))
    return found


def _needs(channel: BoundChannel, route: Route, graph: Graph) -> list[tuple[str, Mapping[str, Collection[str]], str]]:
    if channel.part != "topic":
        return [(route.into, graph.servers, "serves")] if route.into and channel.part == "request" else []
    needs = []
    if route.out:
        needs.append((route.out, graph.publishers, "publishes"))
    if route.into and channel.role != "provide":
        needs.append((route.into, graph.subscribers, "subscribes to"))
    return needs


def _hint(address: str, table: Mapping[str, Collection[str]]) -> str:
    known = sorted(name for name, nodes in table.items() if nodes)
    if not known:
        return "nothing of the kind is registered: are its nodes running?"
    for prefix in (OUT, INTO):
        if address.startswith(prefix):
            plain = address.split("/", 4)[-1]
            if f"/{plain}" in known:
                return f"the node does not obey the remapping: /{plain} is there under its own name"
    return one_of(address, known[:40])
