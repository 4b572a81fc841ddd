"""Turns a graph that runs into a first binding of it, and the skeleton of a model.

Each node becomes a component. What one publishes and another one subscribes to is a channel between them that is
observed, since nodes that run already cannot be parted; what nobody else sends or takes comes from the environment or
goes to it; services and actions are asked by the environment.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from parcours.model.structure import ENVIRONMENT
from parcours.run.binding.actions import WIRE
from parcours.run.binding.graph import RegisteredGraph
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.structure import Transport

_INFRASTRUCTURE = re.compile(
    r"/(rosout(_agg)?|parameter_events|clock)"
    r"|.*/(describe_parameters|(get|set)_parameters|get_parameter_types|list_parameters|set_parameters_atomically"
    r"|get_type_description|get_loggers|set_logger_level|(get|change)_state|get_available_(states|transitions)"
    r"|get_transition_graph|transition_event)"
)
"""Topics and services that every node has, whatever it is for."""

_ACTION = "/_action/"
_MOST_FIELDS, _DEEPEST = 12, 4
_KINDS = {"int": "int", "real": "real", "bool": "bool"}


@dataclass(frozen=True, slots=True)
class BindingDraft:
    """The texts of two files, and what was left out of them, one sentence each."""

    model: str
    binding: str
    notes: tuple[str, ...]


@dataclass(slots=True)
class _Channel:
    """A channel: its name, its ends, what the binding says of it, and the type of its messages."""

    name: str
    sender: str
    receiver: str
    said: list[str]
    type: str
    front: str = ""
    """What places start with: the field of an action's message that is its own."""


def draft(graph: RegisteredGraph, types: MessageTypes, transport: Transport, name: str, master: str = "",
          interfaces: Sequence[str] = ()) -> BindingDraft:  # fmt: skip
    """Return a first binding of what runs, and a model that allows it everything.

    Args:
        graph: with the types of its services.
        types: of its messages; of one that is not known the fields are left out.
        transport: of the graph.
        name: of the binding and of the model.
        master: its address, on ROS 1.
        interfaces: the folders of types that are not installed.
    """
    heads = [f"master: {master}"] if master else []
    heads += ["interfaces:", *(f"- {json.dumps(folder)}" for folder in interfaces)] if interfaces else []
    return _Drafting(graph, types).draft(transport, name, heads)


class _Drafting:
    def __init__(self, graph: RegisteredGraph, types: MessageTypes) -> None:
        self.graph, self.types = graph, types
        self.notes: list[str] = []
        self.channels: list[_Channel] = []
        self.names: Counter[str] = Counter()
        tables = [
            {name: nodes for name, nodes in table.items() if nodes and not _INFRASTRUCTURE.fullmatch(name)}
            for table in (graph.publishers, graph.subscribers, graph.servers)
        ]
        self.publishers, self.subscribers, self.servers = tables
        seen = {node for table in tables for nodes in table.values() for node in nodes}
        self.components = _components(node for node in seen if not node.rpartition("/")[2].startswith("_"))

    def draft(self, transport: Transport, name: str, heads: Sequence[str]) -> BindingDraft:
        for topic in sorted({*self.publishers, *self.subscribers}):
            if _ACTION not in topic:
                self.topic(topic)
        for service in sorted(self.servers):
            if service.endswith(f"{_ACTION}send_goal"):
                self.action(service.removesuffix(f"{_ACTION}send_goal"))
            elif _ACTION not in service:
                self.service(service)
        for node in self.graph.twice:
            self.notes.append(f"two nodes are called {node}: end one of them, or give it a name of its own")
        used = {end for channel in self.channels for end in (channel.sender, channel.receiver)}
        self.components = {node: said for node, said in self.components.items() if said in used}
        return BindingDraft(self.model(name), self.binding(transport, name, heads), tuple(self.notes))

    # What there is.

    def known(self, nodes: Iterable[str]) -> list[str]:
        """Return the components of nodes, in the order of their names."""
        return [self.components[node] for node in sorted(nodes) if node in self.components]

    def add(self, base: str, sender: str, receiver: str, said: list[str], type_: str, front: str = "") -> None:
        plain = re.sub(r"[^a-z0-9]+", "_", base.lower()).strip("_") or "channel"
        plain = plain if plain[0].isalpha() else f"t_{plain}"
        self.names[plain] += 1
        count = self.names[plain]
        unique = plain if count == 1 else f"{plain}_{count}"
        self.channels.append(_Channel(unique, sender, receiver, said, type_, front))

    def is_known(self, name: str, type_: str, asked: str) -> bool:
        """Whether the class of a type is there; it is noted if it is not."""
        if type_ not in ("*", "") and self.types.class_of(asked) is not None:
            return True
        self.notes.append(f"{name} was left out: its type {type_ or '*'} is not known here, see --interfaces")
        return False

    def topic(self, topic: str) -> None:
        type_ = self.graph.types.get(topic, "*")
        if not self.is_known(topic, type_, type_):
            return
        senders, receivers = (self.known(table.get(topic, ())) for table in (self.publishers, self.subscribers))
        if len(senders) > 1:
            others = ", ".join(senders[1:])
            self.notes.append(f"{topic} is bound as of {senders[0]} alone: what {others} publishes is not told apart")
            senders = senders[:1]
        sender = senders[0] if senders else ENVIRONMENT
        receivers = [one for one in receivers if one != sender] or ([ENVIRONMENT] if senders else [])
        said = [f"topic: {topic}", f"type: {type_}"]
        qualities = [*self.graph.offered.get(topic, {}).values(), *self.graph.requested.get(topic, {}).values()]
        if any(one.latched for one in qualities):
            said.append("latch: true")
        for receiver in receivers:
            is_inner = ENVIRONMENT not in (sender, receiver)
            self.add(topic, sender, receiver, [*said, *(["observe: true"] if is_inner else [])], type_)

    def service(self, service: str) -> None:
        type_, servers = self.graph.types.get(service, "*"), self.known(self.servers[service])
        if not servers or not self.is_known(service, type_, f"{type_}Request"):
            return
        for half, ends in (("request", (ENVIRONMENT, servers[0])), ("response", (servers[0], ENVIRONMENT))):
            said = [f"service: {service}", f"type: {type_}", f"part: {half}"]
            self.add(f"{service}_{half}", *ends, said, f"{type_}{half.capitalize()}")

    def action(self, action: str) -> None:
        servers = self.known(self.servers[f"{action}{_ACTION}send_goal"])
        type_ = self.graph.types.get(f"{action}{_ACTION}send_goal", "").removesuffix("_SendGoal")
        if not servers or not self.is_known(action, type_, f"{type_}_SendGoalRequest"):
            return
        for part, (_, kind, wire) in WIRE.items():
            ends = (servers[0], ENVIRONMENT) if part in ("feedback", "result") else (ENVIRONMENT, servers[0])
            said = [f"action: {action}", f"type: {type_}", f"part: {part}"]
            half = "" if wire == "topic" else wire.capitalize()
            self.add(f"{action}_{part}", *ends, said, kind.format(type_) + half, "" if part == "cancel" else part)

    # What is written.

    def fields(self, channel: _Channel) -> dict[str, tuple[str, str]]:
        """Return the numbers and truths of a channel's messages: name of a field -> its place, its kind."""
        front = f"{channel.front}." if channel.front else ""
        found = {place: kind for place, kind in self.leaves(channel.type, _DEEPEST) if place.startswith(front)}
        short = dict(list(found.items())[:_MOST_FIELDS])
        return {place.removeprefix(front).replace(".", "_"): (place, kind) for place, kind in short.items()}

    def leaves(self, type_: str, depth: int) -> Iterator[tuple[str, str]]:
        for name, slot in (self.types.fields(type_) or {}).items():
            if slot.length is not None or name.startswith("_") or name in ("header", "goal_id"):
                continue
            if slot.is_message and depth:
                for place, kind in self.leaves(slot.item, depth - 1):
                    yield f"{name}.{place}", kind
            elif slot.type.name in _KINDS:
                yield name, _KINDS[slot.type.name]

    def model(self, name: str) -> str:
        messages: dict[str, str] = {}
        lines = ["channels:"]
        for one in self.channels:
            made = messages.setdefault(one.type, f"{re.sub(r'[^A-Za-z0-9]', '', one.type.partition('/')[2])}")
            if list(messages.values()).count(made) > 1:
                made = messages[one.type] = "".join(part.capitalize() for part in re.split(r"[/_]", one.type))
            kind, _, where = one.said[0].partition(": ")
            where += f"/{one.said[-1].partition(': ')[2]}" if kind == "action" else ""
            lines.append(f"  {one.name}: {{from: {one.sender}, to: {one.receiver}, message: {made}, topic: {where}}}")
        heads = [
            "# The skeleton of a model, drafted from a graph that ran: components may send anything at any time.\n"
            "# Say what they really do: states, guards, what follows on what (docs/model-format.md).\n"
            f"parcours: model/1\nname: {name}\n\nmessages:"
        ]
        first = {one.type: one for one in reversed(self.channels)}
        for type_, made in messages.items():
            kinds = {field: kind for field, (_, kind) in self.fields(first[type_]).items()}
            units = {field: ", unit: '1'" if kind == "real" else "" for field, kind in kinds.items()}
            fields = ", ".join(f"{field}: {{type: {kind}{units[field]}}}" for field, kind in kinds.items())
            heads.append(f"  {made}: {{fields: {{{fields}}}}}")
        return "\n".join([*heads, "", *lines, "", "components:", *self.machines(messages)]) + "\n"

    def machines(self, messages: Mapping[str, str]) -> Iterator[str]:
        for component in self.components.values():
            own = [one for one in self.channels if component in (one.sender, one.receiver)]
            yield f"  {component}:"
            sent = [one for one in own if one.sender == component]
            if sent:
                yield "    variables:"
                yield from (f"      {one.name}_sent: {{type: {messages[one.type]}}}" for one in sent)
            yield "    machines:"
            yield "      talking:"
            yield "        initial: ready"
            yield "        transitions:"
            for number, one in enumerate(own, 1):
                is_sent = one.sender == component
                what = f"message: {one.name}({one.name}_sent)" if is_sent else f"event: {one.name}({one.name}_given)"
                yield f"          {component.lower()}{number}: {{from: ready, to: ready, {what}}}"

    def binding(self, transport: Transport, name: str, heads: Sequence[str]) -> str:
        lines = [
            "# A first binding, drafted from a graph that ran. Its nodes are only watched: give one a 'command'",
            "# instead of 'running: true', and the tester starts it, parts its channels, and can hold messages.",
            *(f"# Note: {note}." for note in self.notes),
            "parcours: binding/1", f"name: {name}", "model: model.yaml", f"transport: {transport}",
            *heads, "", "nodes:",
        ]  # fmt: skip
        for node, component in self.components.items():
            lines += [f"  {component}: {{running: true, ros_node: {node}}}"]
        lines += ["", "channels:"]
        for one in self.channels:
            lines += [f"  {one.name}:", *(f"    {said}" for said in one.said)]
            if fields := self.fields(one):
                lines.append("    fields: {" + ", ".join(f"{field}: {at}" for field, (at, _) in fields.items()) + "}")
            if one.sender == ENVIRONMENT:
                lines.append("    inject: {base: {}}")
            lines += [f"    # {said}" for said in self.qualities(one)]
        return "\n".join(lines) + "\n"

    def qualities(self, channel: _Channel) -> Iterator[str]:
        """Yield in what quality each end speaks or listens, where it is not the usual one."""
        topic = channel.said[0].removeprefix("topic: ")
        for verb, table in (("offers", self.graph.offered), ("requests", self.graph.requested)):
            for node, quality in sorted(table.get(topic, {}).items()):
                if said := str(quality):
                    yield f"{node} {verb} {said}; the tester does as the other end"


def _components(nodes: Iterable[str]) -> dict[str, str]:
    """Return the name of a component for each node.

    >>> _components(["/obstacle_filter", "/left/camera", "/right/camera"])
    {'/left/camera': 'LeftCamera', '/obstacle_filter': 'ObstacleFilter', '/right/camera': 'RightCamera'}
    """
    every = sorted(set(nodes))
    last = Counter(_camel(node.rpartition("/")[2]) for node in every)
    found = {}
    for node in every:
        short = _camel(node.rpartition("/")[2])
        found[node] = short if last[short] == 1 else _camel(node)
    return found


def _camel(text: str) -> str:
    joined = "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", text) if part)
    return joined if joined[:1].isalpha() else f"Node{joined}"
