"""Compares a binding with what nodes have registered on a graph: all there, of the bound types and qualities?"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from parcours.errors import one_of
from parcours.model.finding import Finding
from parcours.run.binding.domains import parted
from parcours.run.binding.routes import INTO, OUT
from parcours.run.binding.slots import SlotPlan, Spoke, whole
from parcours.run.binding.structure import Binding, BoundChannel

_NUMBER = re.compile(r"_?[0-9]+$")

_LIVELINESS = ("automatic", "manual by topic")


@dataclass(frozen=True, slots=True)
class Quality:
    """What a publisher offers or a subscriber requests on ROS 2 (QoS), as far as it decides whether they connect.

    Args:
        reliable: whether lost messages are sent again.
        latched: whether messages are kept for those who come later (transient local).
        deadline: the longest time between two messages [ns]; None for any.
        manual: whether a publisher must say that it lives by publishing.
        lease: after how long without a sign of life it counts as dead [ns]; None for never.
    """

    reliable: bool = True
    latched: bool = False
    deadline: int | None = None
    manual: bool = False
    lease: int | None = None

    def lacks(self, requested: Quality) -> str:
        """Return what this, offered, lacks of what is requested; empty if they connect.

        >>> Quality(reliable=False).lacks(Quality())
        'offers best effort, but reliable is requested'
        >>> Quality(latched=True).lacks(Quality())
        ''
        """
        lacking = [
            f"offers {one}, but {other} is requested"
            for is_lacking, one, other in (
                (requested.reliable and not self.reliable, "best effort", "reliable"),
                (requested.latched and not self.latched, "volatile", "transient local"),
                (_is_longer(self.deadline, requested.deadline), _time(self.deadline, "deadline"),
                 _time(requested.deadline, "deadline")),
                (requested.manual and not self.manual, _LIVELINESS[0] + " liveliness", _LIVELINESS[1]),
                (_is_longer(self.lease, requested.lease), _time(self.lease, "lease"), _time(requested.lease, "lease")),
            )
            if is_lacking
        ]  # fmt: skip
        return "; ".join(lacking)

    def __str__(self) -> str:
        """What differs from the usual quality; empty if nothing does."""
        words = (
            "" if self.reliable else "best effort", "transient local" if self.latched else "",
            "" if self.deadline is None else _time(self.deadline, "deadline"), _LIVELINESS[1] if self.manual else "",
            "" if self.lease is None else _time(self.lease, "lease"),
        )  # fmt: skip
        return ", ".join(word for word in words if word)


def _is_longer(offered: int | None, requested: int | None) -> bool:
    return requested is not None and (offered is None or offered > requested)


def _time(value: int | None, what: str) -> str:
    return f"no {what}" if value is None else f"a {what} of {value * 1e-6:g} ms"


@dataclass(frozen=True, slots=True)
class RegisteredGraph:
    """What is registered: who publishes, subscribes and serves what, without the tester's own registrations.

    Names of topics and services, and those in `twice`, have their domain (`domains`).

    Args:
        publishers: topic -> names of ROS nodes.
        subscribers: topic -> names of ROS nodes.
        servers: service -> names of ROS nodes.
        types: topic or service -> type, as far as it is known; `*` is any.
        offered: topic -> name of a node that publishes it -> in what quality. Empty on ROS 1.
        requested: topic -> name of a node that subscribes to it -> the quality that it requests.
        twice: names that more than one node has.
    """

    publishers: Mapping[str, Collection[str]] = field(default_factory=dict)
    subscribers: Mapping[str, Collection[str]] = field(default_factory=dict)
    servers: Mapping[str, Collection[str]] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    offered: Mapping[str, Mapping[str, Quality]] = field(default_factory=dict)
    requested: Mapping[str, Mapping[str, Quality]] = field(default_factory=dict)
    twice: Collection[str] = ()


def graph_findings(binding: Binding, graph: RegisteredGraph, plan: SlotPlan | None = None) -> list[Finding]:
    """Return which bound topics and services a running system does not have, or has otherwise.

    That nobody calls a service is not looked at: on ROS 1 clients do not register.

    Args:
        binding: a checked binding.
        graph: what is registered once every node is up.
        plan: who is run, and where they are met; every node once if not given.
    """
    plan = whole(binding) if plan is None else plan
    is_apart = any(slot.reference is not None for slot in plan.slots)
    found = [finding for slot in plan.slots for finding in _named(binding, slot.node.line, slot.graph_name, graph)]
    for spoke in plan.spokes:
        need = _need(binding, spoke, graph)
        if need is None or (is_apart and not spoke.slot):
            continue
        table, verb = need
        channel = next(binding.channel(name) for name in spoke.channels if name)
        what, who = f"channel {channel.name!r}", sorted(table.get(spoke.address, ()))
        slot = plan.slot(spoke.slot)
        if not who:
            rule = f"{what} needs a node that {verb} {spoke.address}, but none does"
            found.append(_finding(binding, channel, "absent-topic", rule, _hint(spoke.address, table)))
        elif (given := graph.types.get(spoke.address, "*")) not in ("*", "", channel.type):
            rule = f"{what} is bound as {channel.type}, but {', '.join(who)} {verb} {spoke.address} as {given}"
            found.append(_finding(binding, channel, "topic-type", rule, "correct 'type'"))
        elif slot is not None and slot.ros_node and graph.offered and slot.ros_node not in who:
            rule = f"{what} needs {slot.ros_node}, which {verb} {spoke.address}, but {', '.join(who)} does"
            found.append(_finding(binding, channel, "absent-topic", rule, f"correct 'ros_node' of {slot.node.name!r}"))
    return [*found, *_unlike(binding, graph, plan), *_bridged(binding, graph, plan), *_clocks(binding, graph)]


def _finding(binding: Binding, channel: BoundChannel, slug: str, rule: str, remedy: str) -> Finding:
    return Finding(binding.source, channel.line, "error", slug, rule, remedy)


def _named(binding: Binding, line: int, node: str, graph: RegisteredGraph) -> list[Finding]:
    if not node or node not in graph.twice:
        return []
    rule = f"a node's name must be its own, but two nodes on the graph are called {node}"
    return [
        Finding(binding.source, line, "error", "node-twice", rule, "end the other one, or use a network of your own")
    ]


def _unlike(binding: Binding, graph: RegisteredGraph, plan: SlotPlan) -> list[Finding]:
    """Return which relayed channels would not connect without the tester: it speaks in the quality of the sender."""
    found = []
    for channel in binding.channels:
        ends = [spoke for spoke in plan.spokes if channel.name in spoke.channels and not spoke.is_service]
        for out in (one for one in ends if one.side == "out"):
            for into in (one for one in ends if one.side == "into"):
                for sender, offered in graph.offered.get(out.address, {}).items():
                    for receiver, requested in graph.requested.get(into.address, {}).items():
                        if lacking := offered.lacks(requested):
                            rule = (
                                f"channel {channel.name!r} cannot connect {sender} with {receiver}: {sender} {lacking}"
                            )
                            remedy = f"correct the QoS of {channel.address} in one of the two"
                            found.append(_finding(binding, channel, "qos-mismatch", f"{rule} by {receiver}", remedy))
    return found


def _bridged(binding: Binding, graph: RegisteredGraph, plan: SlotPlan) -> list[Finding]:
    """Return which channels somebody else brings to another domain, too: their receivers would hear all twice."""
    found = []
    for channel in binding.channels:
        ends = [spoke for spoke in plan.spokes if channel.name in spoke.channels and not spoke.is_service]
        for out, into in itertools.product(
            (one for one in ends if one.side == "out"), (one for one in ends if one.side == "into")
        ):
            if parted(out.address)[1] == parted(into.address)[1]:
                continue
            # A bridge has a node on each side, often numbered as its domain is.
            hear = {_NUMBER.sub("", name): name for name in graph.subscribers.get(out.address, ())}
            for name in graph.publishers.get(into.address, ()):
                if (there := hear.get(_NUMBER.sub("", name))) is not None:
                    rule = f"channel {channel.name!r} passes the tester from {out.address} to {into.address}"
                    said = f"{rule}, but {there} hears it there, and {name} says it, too"
                    remedy = "end that bridge; or say 'observe: true' for the channel, and keep the bridge"
                    found.append(_finding(binding, channel, "bridged-twice", said, remedy))
    return found


def _clocks(binding: Binding, graph: RegisteredGraph) -> list[Finding]:
    """Return who says the time beside the tester."""
    who = {name: nodes for name, nodes in graph.publishers.items() if parted(name)[0] == "/clock" and nodes}
    return [
        Finding(binding.source, 0, "error", "clock-twice",
                f"the tester says the time on {name}, but {', '.join(sorted(nodes))} says it, too",
                "delete 'clock' of the binding, or end that node")
        for name, nodes in sorted(who.items()) if binding.clock
    ]  # fmt: skip


def _need(binding: Binding, spoke: Spoke, graph: RegisteredGraph) -> tuple[Mapping[str, Collection[str]], str] | None:
    if spoke.is_service:
        return (graph.servers, "serves") if spoke.side == "into" and spoke.channels[0] else None
    if spoke.side == "out":
        return graph.publishers, "publishes"
    if binding.stack is None and all(binding.channel(name).role == "provide" for name in spoke.channels):
        return None  # of a stack, somebody must listen
    return graph.subscribers, "subscribes to"


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
