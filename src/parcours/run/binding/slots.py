"""Plans which processes are run as what, and at which names the tester meets each of them.

`whole` runs every node once, as its user would, by the routes of the binding. `apart` runs one process for each
reference of an abstract case, each behind names of its own: any message can be withheld from it or generated for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from parcours.errors import HostFailure
from parcours.model.structure import ENVIRONMENT
from parcours.run.binding.domains import domain_of, within
from parcours.run.binding.routes import INTO, OUT, remapping_words, remappings, routes
from parcours.run.binding.structure import Binding, BoundChannel, NodeProcess, Transport

BESIDE = "beside"
"""Stands for the number of a reference in the names of a node that is run beside an abstract case."""

Side = Literal["out", "into"]
"""out: where the tester hears a node, or serves it. into: where it speaks to a node, or calls it."""


@dataclass(frozen=True, slots=True)
class ProcessSlot:
    """A process of a node.

    Attributes:
        name: in traces and messages: the node's, with the number of its reference if it runs for one.
        node: what it runs.
        reference: of the abstract case; None outside of such.
        ros_node: the name under which the graph knows it; empty if nobody said.
        remap: (address, name instead), sorted.
    """

    name: str
    node: NodeProcess
    reference: int | None = None
    ros_node: str = ""
    remap: tuple[tuple[str, str], ...] = ()

    @property
    def graph_name(self) -> str:
        """The name of its node on its domain; empty if nobody said."""
        return within(self.ros_node, self.node.domain)

    def arguments(self, transport: Transport) -> tuple[str, ...]:
        """Return what is appended to the command of its node, which may be one of several in its process on ROS 2."""
        if self.ros_node == self.node.ros_node:
            return remapping_words(transport, self.remap)
        own, instead = self.node.ros_node.rpartition("/")[2], self.ros_node.rpartition("/")[2]
        key = "__name" if transport == "ros1" else f"{own}:__node" if own else "__node"
        return remapping_words(transport, ((key, instead), *self.remap))

    def component(self, name: str) -> str:
        """Return how a component that runs here is called in a trace."""
        return name if self.reference is None else f"{name}#{self.reference}"


@dataclass(frozen=True, slots=True)
class Spoke:
    """A name at which the tester meets a slot: a topic, or a service.

    Attributes:
        slot: its name; empty for all who listen there.
        side: which way messages go, of a service requests.
        address: its name, with its domain (`domains`).
        channels: that pass here; of a service its requests and then its responses, each empty if it is not bound.
        overheard: whether its messages reach their receivers without the tester.
    """

    slot: str
    side: Side
    address: str
    type: str
    channels: tuple[str, ...]
    is_service: bool = False
    overheard: bool = False


@dataclass(frozen=True, slots=True)
class SlotPlan:
    """Who sits where."""

    slots: tuple[ProcessSlot, ...]
    spokes: tuple[Spoke, ...]
    absent: frozenset[str] = frozenset()
    """Nodes of the binding that are not run."""

    def slot(self, name: str) -> ProcessSlot | None:
        """Return the slot of that name, or None."""
        return next((slot for slot in self.slots if slot.name == name), None)

    def speaking(self, channel: str) -> tuple[Spoke, ...]:
        """Return where messages of a channel go to."""
        return tuple(one for one in self.spokes if one.side == "into" and channel in one.channels)


@dataclass(slots=True)
class _Spokes:
    binding: Binding
    found: dict[tuple[str, Side, str, str], Spoke] = field(default_factory=dict)

    def node(self, channel: BoundChannel, slot: str) -> NodeProcess | None:
        """Return the node of a slot; where a channel is overheard, the one that sends."""
        sender = self.binding.ends(channel.name)[0]
        name = slot.partition("#")[0]
        return next((one for one in self.binding.nodes if one.name == name), None) or self.binding.process_of(sender)

    def add(self, channel: BoundChannel, slot: str, side: Side, address: str, client: str = "", *,
            overheard: bool = False) -> None:  # fmt: skip
        """Let a channel pass there; of a service those of each client by themselves, so that answers are told apart."""
        if not address or channel.part == "goal":  # the tester asks action servers itself
            return
        address = within(address, domain_of(channel, self.node(channel, slot)))
        key = slot, side, address, client if channel.part != "topic" else ""
        before = self.found.get(key)
        if channel.part == "topic":
            names = tuple(dict.fromkeys((*(before.channels if before else ()), channel.name)))
        else:
            halves = before.channels if before else ("", "")
            names = (channel.name, halves[1]) if channel.part == "request" else (halves[0], channel.name)
        overheard = overheard and (before is None or before.overheard)
        self.found[key] = Spoke(slot, side, address, channel.type, names, channel.part != "topic", overheard)


def whole(binding: Binding) -> SlotPlan:
    """Return the plan in which every node runs once."""
    spokes = _Spokes(binding)
    for channel, route in zip(binding.channels, routes(binding), strict=True):
        client, server = (route.receiver, route.sender) if route.part == "response" else (route.sender, route.receiver)
        spokes.add(channel, client, "out", route.out, client, overheard=route.access == "observe")
        spokes.add(channel, server, "into", route.into, client)
    moved = remappings(binding)
    slots = tuple(ProcessSlot(one.name, one, None, one.ros_node, moved.get(one.name, ())) for one in binding.nodes)
    return SlotPlan(slots, tuple(spokes.found.values()))


def apart(binding: Binding, references: Mapping[int, str]) -> SlotPlan:
    """Return the plan in which each reference of an abstract case has a process of its own.

    Args:
        binding: whose nodes.
        references: number of a reference -> its component. One whose component no node runs is the tester's.

    Raises:
        HostFailure: a node that cannot be run twice is needed twice.
    """
    spokes, slots = _Spokes(binding), []
    taken: dict[str, int] = {}
    for number, component in references.items():
        node = binding.process_of(component)
        if node is None:
            continue
        taken[node.name] = taken.get(node.name, 0) + 1
        is_first = taken[node.name] == 1
        if not is_first and not (node.is_ours and node.remap):
            why = "it obeys no remapping" if node.is_ours else "it is not started here"
            rule = f"must run once for each reference, here {sum(c == component for c in references.values())} times"
            raise HostFailure(f"node {node.name}", f"{rule}, but {why}", slug="foreign-instances")
        own = node.ros_node or f"/{node.name.lower()}"
        slots.append(_seated(binding, node, f"{node.name}#{number}", number, "" if is_first else own, spokes))
    for node in dict.fromkeys(_asked_beside(binding) if slots else ()):
        own = node.ros_node or f"/{node.name.lower()}"
        slots.append(_seated(binding, node, node.name, None, own if node.name in taken else "", spokes))
    if not slots:
        rule = "needs at least one component that a node runs, but has none"
        raise HostFailure("abstract case", rule, "add the node to the binding", slug="foreign-instances")
    running = {slot.node.name for slot in slots}
    for launcher in (node for node in binding.nodes if node.is_launcher):
        launched = binding.launched_by(launcher)
        if not launched or any(node.name in running for node in launched):
            slots.append(ProcessSlot(launcher.name, launcher, None, launcher.ros_node, ()))
            running.add(launcher.name)
    absent = frozenset(node.name for node in binding.nodes if node.name not in running)
    return SlotPlan(tuple(slots), tuple(spokes.found.values()), absent)


def _asked_beside(binding: Binding) -> Iterator[NodeProcess]:
    """Yield the nodes that answer what is no part of a case; only one that can be run once more is one."""
    for channel in binding.channels:
        if channel.answer == "node" and channel.part == "request":
            node = binding.process_of(binding.model.channel(channel.name).receiver)
            if node is not None and node.is_ours and node.remap:
                yield node


def _seated(
    binding: Binding, node: NodeProcess, name: str, number: int | None, renamed: str, spokes: _Spokes
) -> ProcessSlot:
    tag = BESIDE if number is None else str(number)
    ros_node = f"{renamed}_{tag}" if renamed else node.ros_node
    remap: set[tuple[str, str]] = set()
    for channel in binding.channels:
        if channel.role in ("provide", "observe") or channel.observe:
            side: Side = "into" if channel.role == "provide" else "out"
            spokes.add(channel, "", side, channel.address, overheard=side == "out")
            continue
        sends, receives = _ends(binding, channel, node)
        if channel.part == "response":
            sends, receives = receives, sends
        both: tuple[tuple[bool, Side, str], ...] = (sends, "out", channel.out), (receives, "into", channel.into)
        for is_mine, side, given in both:
            if not is_mine:
                continue
            prefix = OUT if side == "out" else INTO
            address = f"{prefix}/{node.name}_{tag}{channel.address}" if node.remap else given or channel.address
            spokes.add(channel, name, side, address, _client(binding, channel))
            if node.remap:
                key = channel.address
                if renamed and key.startswith(f"{node.ros_node}/"):
                    key = ros_node + key.removeprefix(node.ros_node)
                remap.add((key, address))
    return ProcessSlot(name, node, number, ros_node, tuple(sorted(remap)))


def _client(binding: Binding, channel: BoundChannel) -> str:
    """Return who asks, where a channel is part of a service."""
    if channel.role == "between":
        return channel.ends[channel.part == "response"]
    declared = binding.model.channel(channel.name)
    return declared.receiver if channel.part == "response" else declared.sender


def _ends(binding: Binding, channel: BoundChannel, node: NodeProcess) -> tuple[bool, bool]:
    if channel.role == "between":
        return channel.ends[0] == node.name, channel.ends[1] == node.name
    declared = binding.model.channel(channel.name)
    sender, receiver = (end != ENVIRONMENT and end in node.components for end in (declared.sender, declared.receiver))
    return sender, receiver
