"""Under which names the tester hears senders and speaks to receivers, and how nodes are remapped for it.

Every relayed channel is parted in two: its sender is moved to a name of its own, `/parcours/out/<node>/...`, and the
tester passes on what it hears there to the address itself, where the receiver listens. Where the tester sends one topic
to several nodes, they are moved, too, to `/parcours/in/<node>/...`, so that each may be kept waiting on its own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal

from parcours.model.finding import Finding
from parcours.model.structure import ENVIRONMENT
from parcours.run.binding.domains import domain_of, within
from parcours.run.binding.structure import Binding, BoundChannel, NodeProcess, Part, Transport

Access = Literal["relay", "observe", "inject", "collect"]
"""relay: between two nodes, by way of the tester. observe: between nodes, overheard. inject: from the tester to a node.
collect: from a node to the tester."""

OUT, INTO = "/parcours/out", "/parcours/in"


@dataclass(frozen=True, slots=True)
class BindingRoute:
    """How messages of one channel pass: the tester hears them at `out` and says them at `into`.

    Of a service, the tester serves requests at `out` and calls `into`; the response goes the same way back. `sender`
    and `receiver` are names of nodes, empty for the tester; an empty `out` or `into` is not used.
    """

    channel: str
    part: Part
    type: str
    access: Access
    sender: str
    receiver: str
    out: str
    into: str


def routes(binding: Binding, absent: Collection[str] = ()) -> tuple[BindingRoute, ...]:
    """Return one route for each bound channel, in the order of the binding.

    Args:
        binding: whose channels.
        absent: nodes that are not run: the tester stands in for their components.
    """
    return _Routing(binding, absent).routes


def remappings(binding: Binding, absent: Collection[str] = ()) -> dict[str, tuple[tuple[str, str], ...]]:
    """Return, for each node that is run and remapped, the (address, name instead) that it is given, sorted."""
    return _Routing(binding, absent).remappings()


def arguments(binding: Binding, process: str, absent: Collection[str] = ()) -> tuple[str, ...]:
    """Return what is appended to the command of a process, in the form of the binding's transport."""
    return remapping_words(binding.transport, remappings(binding, absent).get(process, ()))


def remapping_words(transport: Transport, pairs: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """Return the arguments that remap (address, name instead) for a node of a transport."""
    if transport == "ros1":
        return tuple(f"{address}:={name}" for address, name in pairs)
    remaps = tuple(part for address, name in pairs for part in ("-r", f"{address}:={name}"))
    return ("--ros-args", *remaps) if remaps else ()


def separation_findings(binding: Binding) -> list[Finding]:
    """Return which channels cannot be relayed, since the names of their ends cannot be parted."""
    return _Routing(binding, ()).findings()


class _Routing:
    def __init__(self, binding: Binding, absent: Collection[str]) -> None:
        self.binding = binding
        self.runs = {c: node for node in binding.nodes if node.name not in absent for c in node.components}
        self.named = {node.name: node for node in binding.nodes if node.name not in absent}
        self.ends = {channel.name: (channel.sender, channel.receiver) for channel in binding.model.channels}
        self.shared = self.with_several_receivers()
        self.routes = tuple(self.route(channel) for channel in binding.channels)

    def nodes(self, channel: BoundChannel) -> tuple[NodeProcess | None, NodeProcess | None]:
        if channel.role == "between":
            sender, receiver = channel.ends
            return self.named.get(sender), self.named.get(receiver)
        if channel.role != "model":
            return None, None
        sender, receiver = self.ends.get(channel.name, (ENVIRONMENT, ENVIRONMENT))
        return self.runs.get(sender), self.runs.get(receiver)

    def access(self, channel: BoundChannel) -> Access:
        sender, receiver = self.nodes(channel)
        if channel.role in ("observe", "provide"):
            return "observe" if channel.role == "observe" else "inject"
        if sender is None:
            return "inject"
        if channel.observe:
            return "observe"
        return "collect" if receiver is None else "relay"

    def route(self, channel: BoundChannel) -> BindingRoute:
        access = self.access(channel)
        sender, receiver = self.nodes(channel)
        # A service has one pair of names for both halves: its client is moved, its server keeps the address.
        client, server = (receiver, sender) if channel.part == "response" else (sender, receiver)
        out = channel.out or (self.moved_out(client, channel) if self.is_parted(channel) else channel.address)
        is_shared = self.placed(channel.address, channel, server) in self.shared
        into = channel.into or (self.moved_in(server, channel) if is_shared else channel.address)
        if channel.part == "topic":
            out, into = ("" if access == "inject" else out), ("" if access in ("observe", "collect") else into)
        else:
            out, into = ("" if client is None else out), ("" if server is None else into)
        ends = (sender.name if sender else "", receiver.name if receiver else "")
        return BindingRoute(channel.name, channel.part, channel.type, access, *ends, out, into)

    def placed(self, name: str, channel: BoundChannel, node: NodeProcess | None) -> str:
        """Return a name with the domain of a node's end of a channel."""
        return within(name, domain_of(channel, node))

    def moved_out(self, node: NodeProcess | None, channel: BoundChannel) -> str:
        return f"{OUT}/{node.name}{channel.address}" if node is not None and node.remap else channel.address

    def moved_in(self, node: NodeProcess | None, channel: BoundChannel) -> str:
        return f"{INTO}/{node.name}{channel.address}" if node is not None and node.remap else channel.address

    def is_parted(self, channel: BoundChannel) -> bool:
        """Whether the sender of a channel is moved: for this channel, or for another one of the same topic."""
        sender, _ = self.nodes(channel)
        if channel.part != "topic" or self.access(channel) == "relay":
            return self.access(channel) == "relay"
        return sender is not None and any(
            other.address == channel.address and self.access(other) == "relay" and self.nodes(other)[0] == sender
            for other in self.binding.channels
        )

    def with_several_receivers(self) -> set[str]:
        """Topics that the tester sends to several nodes of a domain: these listen under names of their own."""
        receivers: dict[str, set[str]] = {}
        for channel in self.binding.channels:
            _, receiver = self.nodes(channel)
            if channel.part == "topic" and receiver is not None and self.access(channel) in ("relay", "inject"):
                receivers.setdefault(self.placed(channel.address, channel, receiver), set()).add(receiver.name)
        return {address for address, names in receivers.items() if len(names) > 1}

    def remappings(self) -> dict[str, tuple[tuple[str, str], ...]]:
        found: dict[str, set[tuple[str, str]]] = {}
        for channel, route in zip(self.binding.channels, self.routes, strict=True):
            sender, receiver = self.nodes(channel)
            if channel.part == "response":
                sender, receiver = receiver, sender
            for node, name in ((sender, route.out), (receiver, route.into)):
                if node is not None and node.remap and name and name != channel.address:
                    found.setdefault(node.name, set()).add((channel.address, name))
        return {name: tuple(sorted(pairs)) for name, pairs in found.items()}

    def sides(self, node: str, address: str) -> tuple[list[BoundChannel], list[BoundChannel]]:
        """Return the channels on which a node sends to others under an address, and receives; of services, requests."""
        found: tuple[list[BoundChannel], list[BoundChannel]] = [], []
        for channel in self.binding.channels:
            names = [one.name if one is not None else "" for one in self.nodes(channel)]
            if channel.address == address and names.count(node) == 1:
                found[names.index(node) ^ (channel.part == "response")].append(channel)
        return found

    def findings(self) -> list[Finding]:
        found = []
        for channel, route in zip(self.binding.channels, self.routes, strict=True):
            what = f"channel {channel.name!r}"
            sender, receiver = self.nodes(channel)
            into = self.placed(route.into, channel, receiver)
            if channel.observe and channel.part != "topic":
                rule = f"{what} is of a service, which cannot be overheard, but says 'observe: true'"
                found.append(self.at(channel, "binding-service", rule, "delete it"))
            if receiver is not None and route.into == channel.address and into in self.shared:
                rule = f"{what} shares {channel.address} with others, but its receiver is not remapped and has no 'in'"
                remedy = f"start node {receiver.name!r} with {channel.address} remapped and give that name as 'in'"
                found.append(self.at(channel, "binding-separation", rule, remedy))
            if route.access != "relay":
                continue
            if route.sender == route.receiver:
                rule = f"{what} must link two nodes to be relayed, but both its ends are in node {route.sender!r}"
                found.append(self.at(channel, "binding-inner", rule, "say 'observe: true', or do not bind it"))
            elif self.placed(route.out, channel, sender) == into:
                rule = (
                    f"{what} must reach the tester first, but its sender is not remapped and no 'out' or 'in' is given"
                )
                remedy = f"start it with {channel.address} remapped and give that name as 'out', or say 'observe: true'"
                found.append(self.at(channel, "binding-separation", rule, remedy))
        for name, pairs in self.remappings().items():
            for address in dict.fromkeys(address for address, _ in pairs):
                sent, received = self.sides(name, address)  # which move together: a name is remapped to one other
                if sent and received:
                    rule = f"node {name!r} must send or receive on {address}, but the channels make it do both"
                    is_moved_in = any(key == address and instead.startswith(INTO) for key, instead in pairs)
                    remedy = "bind only one of the two" if is_moved_in else f"say 'observe: true' for {sent[0].name!r}"
                    found.append(self.at(sent[0], "binding-loop", rule, remedy))
        return found

    def at(self, channel: BoundChannel, slug: str, rule: str, remedy: str) -> Finding:
        return Finding(self.binding.source, channel.line, "error", slug, rule, remedy)
