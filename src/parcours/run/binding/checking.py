"""Finds what is wrong with a binding: names that the model does not have, ends that do not fit."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from parcours.model.finding import Finding, advice
from parcours.run.binding.domains import domain_of, parts_on_domains, within
from parcours.run.binding.formulas import PlacedFormula
from parcours.run.binding.places import path_text
from parcours.run.binding.routes import separation_findings
from parcours.run.binding.structure import Binding, BoundChannel, BoundEntry, NodeProcess
from parcours.run.binding.worlds import ASKED, EACH_NAMES, STACK_NAMES, WAY_NAMES, WORLD_NAMES

_ITP = re.compile(r"ITP[0-9]{1,4}", re.ASCII)
_MASTER = re.compile(r"https?://[A-Za-z0-9._\-\[\]:]+:[0-9]{1,5}/?", re.ASCII)


def findings(binding: Binding) -> list[Finding]:
    """Return everything that is wrong with a binding whose form is right; an empty list if nothing is.

    What only a running system can tell, such as the fields of its message types, is not looked at
    (`compiling`, `graph`).
    """
    check = _Check(binding)
    check.nodes()
    check.channels()
    check.services()
    check.actions()
    check.timing()
    check.system()
    check.stack()
    check.life()
    check.domains()
    if not check.found:
        check.found += separation_findings(binding)
    return check.found


class _Check:
    def __init__(self, binding: Binding) -> None:
        self.binding, self.model = binding, binding.model
        self.found: list[Finding] = []
        self.modelled = {channel.name: channel for channel in self.model.channels}
        self.bound = {channel.name: channel for channel in binding.channels}
        self.classes = {message.name: message for message in self.model.messages}
        self.given = {*(name for name, _ in binding.constants), *binding.data, *WORLD_NAMES}
        self.each = {*EACH_NAMES}
        if binding.stack is not None:
            self.given |= {*STACK_NAMES}
            self.each |= {*WAY_NAMES}

    def add(self, line: int, slug: str, rule: str, remedy: str = "") -> None:
        self.found.append(Finding(self.binding.source, line, "error", slug, rule, remedy))

    def warn(self, line: int, slug: str, rule: str, remedy: str) -> None:
        self.found.append(Finding(self.binding.source, line, "warning", slug, rule, remedy))

    def known(self, name: str, known: Sequence[str], what: str, line: int) -> bool:
        if name in known:
            return True
        rule = f"{what} must be known, but {name[:60]!r} is not"
        self.add(line, "binding-unknown", rule, advice(name, known, self.found))
        return False

    def nodes(self) -> None:
        components = [component.name for component in self.model.components]
        counts = Counter(name for node in self.binding.nodes for name in node.components)
        for node in self.binding.nodes:
            for component in node.components:
                self.known(component, components, f"a component of node {node.name!r}", node.line)
                if counts[component] > 1:
                    rule = f"a component must run in one node, but {component!r} runs in {counts[component]}"
                    self.add(node.line, "duplicate", rule, "take it out of all but one")
            names = [Path(word).name for word in node.command[:2]]
            if node.remap and node.components and (names[:1] == ["roslaunch"] or names == ["ros2", "launch"]):
                rule = f"a launch file obeys no remapping arguments, but node {node.name!r} is to be remapped"
                remedy = (
                    "say 'components: []', and list its nodes with 'running: true' and 'after' it; or 'remap: false'"
                )
                self.add(node.line, "binding-start", rule, remedy)
        self.order()
        if self.binding.master and not _MASTER.fullmatch(self.binding.master):
            rule = f"'master' must be an address with a port, but is {self.binding.master[:60]!r}"
            self.add(0, "binding-master", rule, "e.g. http://127.0.0.1:11311")

    def order(self) -> None:
        """Each node starts after others that are there, and none after itself."""
        nodes = {node.name: node for node in self.binding.nodes}
        for node in self.binding.nodes:
            for name in node.after:
                self.known(name, list(nodes), f"a node that {node.name!r} starts after", node.line)
        started: set[str] = set()
        while fresh := {one.name for one in self.binding.nodes if set(one.after) & set(nodes) <= started} - started:
            started |= fresh
        for node in self.binding.nodes:
            if node.name not in started:
                rule = f"a node must start after nodes that can be there, but {node.name!r} is in a circle of 'after'"
                self.add(node.line, "binding-start", rule, "take one of them out")

    def channels(self) -> None:
        for name, count in Counter(channel.name for channel in self.binding.channels).items():
            if count > 1:
                rule = f"a name must be unique, but {name!r} stands under two of channels, between, observe and provide"
                self.add(self.bound[name].line, "duplicate", rule, "rename one")
        for channel in self.binding.channels:
            if channel.role != "model":
                self.injection(channel, channel.role == "provide")
                for end in channel.ends if channel.role == "between" else ():
                    names = [node.name for node in self.binding.nodes]
                    self.known(end, names, f"a node that {channel.name!r} is between", channel.line)
            elif self.known(channel.name, list(self.modelled), "a channel of the model", channel.line):
                self.fields(channel)
                self.injection(channel, self.is_ours(channel.name))
        first: dict[str, BoundChannel] = {}
        for channel in self.binding.channels:
            placed = self.names(channel)
            for other in [first.setdefault(name, channel) for name in sorted(placed)]:
                if (other.type, other.part == "topic") != (channel.type, channel.part == "topic"):
                    rule = f"{channel.address} must have one type, but is bound as {other.type} and as {channel.type}"
                    remedy = f"line {other.line} binds it first"
                    self.add(channel.line, "binding-address", rule, remedy)
                    break
            same = [one.name for one in self.binding.channels if one.role != "observe" and placed & self.names(one)]
            if channel.role == "observe" and same:
                rule = f"{channel.address} must be listened to once, but is bound as {same[0]!r}, too"
                self.add(channel.line, "binding-observed", rule, f"delete {channel.name!r}: traces have the other")

        for name, modelled in self.modelled.items():
            ends = [self.binding.process_of(end) for end in (modelled.sender, modelled.receiver)]
            if name not in self.bound and ends[0] is not ends[1]:
                rule = f"nothing of channel {name!r} of the model will be seen, since it is not bound"
                self.warn(0, "binding-unbound", rule, "add it to 'channels'")

    def fields(self, channel: BoundChannel) -> None:
        message = self.modelled[channel.name].message
        known = [field.name for field in self.classes[message].fields]
        for name, formula in channel.fields:
            self.known(name, known, f"a field of {message!r}, which channel {channel.name!r} carries,", formula.line)

    def injection(self, channel: BoundChannel, is_needed: bool) -> None:
        if channel.inject is None:
            if is_needed:
                rule = f"the tester sends on {channel.name!r}, but no 'inject' says what: all will be 0 or empty"
                self.warn(channel.line, "binding-inject", rule, "add inject: {base: {...}, set: {...}}")
            return
        if channel.inject.each is not None and channel.part != "response":
            rule = f"'for each' counts the items of a request, but {channel.name!r} answers none"
            self.add(channel.inject.line, "binding-inject", rule, "delete it")
        system = self.binding.system
        each = system is not None and channel.name in system.each
        for place, formula in channel.inject.set:
            names = self.given | self.each if each or place.is_each else self.given
            self.spoken(formula, sorted(names), f"{str(place)!r} of {channel.name!r}", channel)
            if place.steps.count("*") > 1:
                rule = f"a place that is set has one [*] at most, but {place} has {place.steps.count('*')}"
                self.add(formula.line, "binding-place", rule)

    def spoken(self, formula: PlacedFormula, known: Sequence[str], what: str, channel: BoundChannel) -> None:
        for place in formula.places:
            if channel.part == "response" and place.steps[0] in ASKED:
                continue
            self.known(str(place), known, f"a name in {what}", formula.line)

    def services(self) -> None:
        for channel in self.binding.channels:
            if channel.answer == "node" and channel.part != "request":
                rule = f"a node answers requests, but {channel.name!r} is not one"
                self.add(channel.line, "binding-service", rule, "write 'answer: node' where 'part: request' stands")
        parts: dict[tuple[str, str, str], list[BoundChannel]] = {}
        for channel in self.binding.channels:
            modelled = self.modelled.get(channel.name)
            if channel.part == "topic" or modelled is None:
                continue
            ends = (modelled.sender, modelled.receiver)
            client, server = ends if channel.part == "request" else ends[::-1]
            parts.setdefault((self.placed(channel, channel.address, server), client, server), []).append(channel)
        first: dict[str, str] = {}
        for (address, client, server), channels in parts.items():
            if first.setdefault(address, server) != server:
                rule = f"service {address} must have one server, but is bound as of {first[address]} and of {server}"
                self.add(channels[0].line, "binding-service", rule, "is 'part' of one of them wrong?")
            words = [channel.part for channel in channels]
            if channels[0].action:  # each of its services stands for one channel
                continue
            if words.count("request") != 1 or words.count("response") > 1:
                rule = f"service {address} from {client} to {server} must have one request and at most one response"
                said = f"{rule}, but has {words.count('request')} and {words.count('response')}"
                self.add(channels[0].line, "binding-service", said, "bind both directions of the service in the model")

    def actions(self) -> None:
        """Every part of an action belongs to a goal, and goes its way or back."""
        goals = [one for one in self.binding.channels if one.action == "goal"]
        for channel in self.binding.channels:
            if not channel.action:
                continue
            if self.binding.transport != "ros2":
                rule = f"only ros2 has actions, but 'transport' is {self.binding.transport}"
                self.add(channel.line, "binding-action-part", rule, "bind its topics")
                continue
            same = [one for one in goals if _action(one) == _action(channel)]
            if not same:
                rule = f"an action begins with a goal, but no channel is bound to that of {_action(channel)}"
                self.add(channel.line, "binding-action-part", rule, "bind one with part: goal")
                continue
            ends, is_forth = self.binding.ends(channel.name), channel.action in ("goal", "cancel")
            # Robots on domains of their own may serve one name each.
            goal = next((one for one in same if set(self.binding.ends(one.name)) == set(ends)), same[-1])
            sender, receiver = self.binding.ends(goal.name)[:: 1 if is_forth else -1]
            if ends != (sender, receiver):
                rule = f"the {channel.action} of {_action(channel)} must go from {sender} to {receiver}"
                said = f"{rule}, but {channel.name!r} goes from {ends[0]} to {ends[1]}"
                self.add(channel.line, "binding-action-part", said, f"line {goal.line} binds its goal")

    def prefixed(self, formula: PlacedFormula, what: str) -> None:
        """Places outside a channel's own section name their channel first."""
        constants = {name for name, _ in self.binding.constants}
        for place in formula.places:
            if path_text(place.steps) not in constants:
                said = f"the channel that a name in {what} starts with"
                self.known(str(place.steps[0]), list(self.bound), said, formula.line)

    def timing(self) -> None:
        interactions = [name for name, _ in self.model.interactions]
        for bound in self.binding.timing:
            if bound.begin or bound.end:
                said = f"a channel of timing {bound.name!r}"
                known = [self.known(name, list(self.bound), said, bound.line) for name in bound.channels]
                if all(known):
                    self.chain(bound)
            elif not _ITP.fullmatch(bound.name):
                self.known(bound.name, interactions, "an interaction of the model", bound.line)

    def chain(self, bound: BoundEntry) -> None:
        """Who receives one message of a chain is who sends the next."""
        for before, after in itertools.pairwise(bound.channels if bound.through else ()):
            receiver, sender = self.binding.ends(before)[1], self.binding.ends(after)[0]
            if receiver and sender and receiver != sender:
                rule = f"a chain must be linked, but {before!r} goes to {receiver}, and {after!r} comes from {sender}"
                self.add(bound.line, "binding-timing", rule, "name the channels between them under 'through'")

    def system(self) -> None:
        system = self.binding.system
        if system is None:
            return
        for name in [*(name for name, _ in system.sense), *system.once]:
            known = self.known(name, list(self.bound), "a channel that the tester sends on", system.line)
            if known and not self.is_ours(name):
                rule = f"the tester must be the sender of {name!r}, but a node is, or it is only observed"
                self.add(system.line, "binding-sense", rule, "take it out of 'sense' and 'once'")
        for name in system.each:
            self.known(name, [sensed for sensed, _ in system.sense], "a channel of 'each'", system.line)
        spoken = [(system.command.linear, "'linear'"), (system.command.angular, "'angular'")]
        for formula, what in spoken + ([(system.alarm[1], "'imminent_collision'")] if system.alarm else []):
            self.prefixed(formula, what)

    def stack(self) -> None:
        stack = self.binding.stack
        if stack is not None and self.binding.transport != "ros2":
            rule = f"a stack is driven on ros2, but 'transport' is {self.binding.transport}"
            self.add(stack.line, "binding-stack", rule, "write transport: ros2")
        if self.binding.clock and (stack is not None or self.binding.transport != "ros2"):
            rule = "the tester says the time on ros2, and to a stack by its own section, but 'clock' is given"
            self.add(0, "binding-clock", rule, "delete it")
        if self.binding.timing and (self.binding.clock or (stack is not None and stack.simulated)):
            rule = "durations are those of the machine's clock, but the nodes are led by /clock"
            instead = "delete 'clock'" if stack is None else "write time: real"
            self.add(self.binding.timing[0].line, "clock-domains", rule, f"delete 'timing', or {instead}")

    def life(self) -> None:
        if self.binding.transport == "ros2":
            return
        led = [node.line for node in self.binding.nodes for one in node.ready if one.kind == "life"]
        steps = (*self.binding.before_case, *self.binding.after_case)
        for line in led + [step.line for step in steps if step.kind == "life"]:
            rule = f"only nodes of ros2 have a life, but 'transport' is {self.binding.transport}"
            self.add(line, "binding-life", rule, "delete 'life'")

    def domains(self) -> None:
        binding = self.binding
        why = "are led on one domain" if binding.stack is not None else "of ros1 have no domains"
        for part in parts_on_domains(binding):
            if part.domain is not None and (binding.stack is not None or binding.transport != "ros2"):
                rule = f"nodes {'of a stack ' if binding.stack is not None else ''}{why}, but {part.domain} is named"
                self.add(part.line, "binding-domain", rule, "delete 'domain'; ROS_DOMAIN_ID chooses that of a run")
        for step in (*binding.before_case, *binding.after_case):
            node = step.name if step.kind == "life" else step.name.rpartition("/")[0]
            called = [one for one in binding.nodes if one.ros_node == node]
            if step.domain is None and len({one.domain for one in called}) > 1:
                names = " and ".join(one.name for one in called)
                rule = f"{node} must be one node, but {names} are called so, on domains of their own"
                self.add(step.line, "binding-domain", rule, "say the 'domain' of the step")

    def names(self, channel: BoundChannel) -> set[str]:
        """Return the names of a channel, each with the domain that an end of it is on."""
        found = [self.node(channel, end) for end in self.binding.ends(channel.name)]
        nodes = [one for one in found if one is not None] or found[:1]
        return {within(channel.address, domain_of(channel, node)) for node in nodes}

    def node(self, channel: BoundChannel, end: str) -> NodeProcess | None:
        """Return the node at an end of a channel, if one is."""
        if channel.role == "model":
            return self.binding.process_of(end)
        return next((node for node in self.binding.nodes if node.name == end), None)

    def placed(self, channel: BoundChannel, name: str, component: str) -> str:
        """Return a name with the domain of a component's end of a channel."""
        return within(name, domain_of(channel, self.binding.process_of(component)))

    def is_ours(self, name: str) -> bool:
        """Whether the tester makes the messages of a bound channel: no node runs its sender."""
        modelled = self.modelled.get(name)
        if modelled is None:
            return self.bound[name].role == "provide"
        return self.binding.process_of(modelled.sender) is None


def _action(channel: BoundChannel) -> str:
    """Return the name of the action that a channel is a part of."""
    return channel.address.rpartition("/_action/")[0]
