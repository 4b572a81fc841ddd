"""Reads the parts of a binding: which keys stand where, with what kind of value (docs/bindings.md)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, cast

from parcours.errors import BadModel
from parcours.model.documents import Mapping, Node, Scalar
from parcours.model.nodes import brief, shown
from parcours.run.binding.formulas import Formula, parse_formula
from parcours.run.binding.places import Place, parse_place
from parcours.run.binding.quantities import QuantityReader, constant, plain
from parcours.run.binding.structure import (
    Action,
    Bound,
    BoundChannel,
    Constant,
    Injection,
    Part,
    Process,
    Ready,
    Role,
    Transport,
    Value,
)

FORMAT = "binding/1"
"""The number of the format that this version reads."""

_ADDRESS = re.compile(r"/?[A-Za-z~][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+)*", re.ASCII)
_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(?:/(?:msg|srv))?/[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_CHANNEL = ("type", "fields", "queue", "latch", "out", "in", "observe", "quiescence", "inject")
_READY = ("topic", "service", "node", "parameter", "message", "after")


class PartReader(QuantityReader):
    """Reads the parts of a binding; each method takes a node and returns the part, with stand-ins where it is wrong.

    Paths of files are taken from the folder `here`.
    """

    def __init__(self, origin: str, here: Path) -> None:
        super().__init__(origin)
        self.here = here

    def formula(self, node: Node | None, what: str) -> Formula:
        """Return a formula over places."""

        def parse(text: str, where: str) -> Formula:
            return parse_formula(text, where, node.line if node is not None else 0)

        return self.parsed(node, what, parse, NOTHING)

    def path(self, node: Node | None, what: str) -> Path:
        """Return a path, from the folder of the file if it is relative."""
        return self.here / Path(self.text(node, what)).expanduser()

    def address(self, node: Node | None, what: str) -> str:
        """Return the global name of a topic, service, node or parameter; the leading slash may be left out."""
        text = self.text(node, what, "/absent")
        if node is not None and (not _ADDRESS.fullmatch(text) or len(text) > 250):
            rule = f"{what} must be a name such as /cmd_vel, but is {brief(text)}"
            self.add(node, "binding-name", rule)
            return "/absent"
        if text.startswith("~"):
            rule = f"{what} must be a global name, but {brief(text)} is private"
            self.add(node, "binding-name", rule, f"write /node_name/{text[1:]}")
        return text if text.startswith("/") else f"/{text}"

    def type_name(self, node: Node | None, what: str) -> str:
        """Return a type such as `geometry_msgs/Twist`; `geometry_msgs/msg/Twist` is the same."""
        text = self.text(node, what, "absent/Absent")
        if not _TYPE.fullmatch(text):
            self.add(node, "binding-type", f"{what} must be package/Type, but is {brief(text)}", "e.g. std_msgs/Bool")
            return "absent/Absent"
        package, _, name = text.partition("/")
        return f"{package}/{name.rpartition('/')[2]}"

    def process(self, name: str, node: Node, line: int) -> Process:
        """Return an entry of `nodes`."""
        what = f"node {name!r}"
        optional = ("components", "command", "running", "env", "cwd", "remap", "ros_node", "ready", "timeout")
        items = self.record(node, what, (), (*optional, "restart", "stop"))
        running = self.boolean(items.get("running"), f"'running' of {what}", False)
        command = self.words(items.get("command"), f"'command' of {what}")
        if running == bool(command):
            rule = f"{what} must have a command, or say 'running: true' if you start it yourself"
            self.add(node, "binding-start", f"{rule}, but has {'both' if running else 'neither'}")
        if running and "ros_node" not in items:
            rule = (
                f"{what} is not started here, so 'ros_node' must say by what name its life is seen, but it is missing"
            )
            self.add(node, "missing-key", rule, "add e.g. ros_node: /planner")
        remap = self.boolean(items.get("remap"), f"'remap' of {what}", not running)
        if running and remap:
            rule = f"{what} is not started here, so no arguments can be appended, but it says 'remap: true'"
            remedy = "remap it yourself, and say 'out' and 'in' of its channels"
            self.add(items.get("remap"), "binding-start", rule, remedy)
        env = self.entries(items.get("env"), f"variables of {what}", self.label)
        components: tuple[str, ...] = (name,)
        if "components" in items:
            listed = self.listed(items["components"], f"'components' of {what}")
            components = tuple(self.identifier(item, f"a component of {what}") for item in listed)
        restart = self.one_of(items.get("restart"), f"'restart' of {what}", ("when-dead", "every-case"), "every-case")
        return Process(
            name,
            components,
            command,
            tuple((key, self.text(value, f"{key!r} of {what}")) for key, value, _ in env),
            self.path(items["cwd"], f"'cwd' of {what}") if "cwd" in items else self.here,
            remap,
            self.address(items["ros_node"], f"'ros_node' of {what}") if "ros_node" in items else "",
            self.ready(items, what, line),
            cast(Literal["when-dead", "every-case"], restart),
            self.duration(items.get("stop"), f"'stop' of {what}", 2.0),
            line,
        )

    def ready(self, items: dict[str, Node], what: str, line: int) -> tuple[Ready, ...]:
        """Return the conditions of `ready`: a list of one-entry mappings; left out, all that is bound."""
        timeout = self.duration(items.get("timeout"), f"'timeout' of {what}", 4.0)
        found = []
        for node in self.listed(items.get("ready"), f"'ready' of {what}"):
            parts = self.record(node, f"a condition of {what}", (), (*_READY, "is"))
            kinds = [kind for kind in _READY if kind in parts]
            if len(kinds) != 1:
                rule = f"a condition of {what} must name one of {', '.join(_READY)}, but names {len(kinds)}"
                self.add(node, "binding-ready", rule, "e.g. ready: [{service: /plan}]")
                continue
            kind = cast(Literal["topic", "service", "node", "parameter", "message", "after"], kinds[0])
            named = f"{kind!r} of {what}"
            if kind == "after":
                found.append(Ready(kind, "", self.duration(parts[kind], named, 1.0), timeout, node.line))
                continue
            value = self.constant_of(parts["is"], f"'is' of {what}") if "is" in parts else True
            found.append(Ready(kind, self.address(parts[kind], named), value, timeout, node.line))
        return tuple(found) or (Ready("bound", timeout=timeout, line=line),)

    def constant_of(self, node: Node, what: str) -> Constant:
        """Return a scalar as plain data."""
        if isinstance(node, Scalar):
            return constant(node)
        self.add(node, "kind", f"{what} must be a single value, but is {shown(node)}")
        return 0

    def channel(self, name: str, node: Node, line: int, role: Role, silence: float) -> BoundChannel:
        """Return an entry of `channels`, `between`, `observe` or `provide`."""
        what = f"channel {name!r}" if role == "model" else f"{role!r} entry {name!r}"
        more = ("topic", "service", "part", "timeout") if role == "model" else ("topic",)
        named = ("from", "to") if role == "between" else ()
        items = self.record(node, what, ("type", *named), (*_CHANNEL, *more))
        sender, receiver = (self.identifier(items.get(key), f"{key!r} of {what}") for key in ("from", "to"))
        part: Part = "topic"
        if ("topic" in items) == ("service" in items):
            rule = f"{what} must have a topic or a service, but has {'both' if 'topic' in items else 'neither'}"
            self.add(node, "binding-address", rule)
        elif "service" in items:
            word = self.one_of(items.get("part"), f"'part' of {what}", ("request", "response"), "request")
            part = "request" if word == "request" else "response"
            if "part" not in items:
                self.add(node, "missing-key", f"{what} is of a service: 'part' must be request or response", "add it")
        elif "part" in items:
            self.add(items["part"], "binding-address", f"only a service has parts, but {what} is a topic", "delete it")
        address = items.get("service", items.get("topic"))
        fields = self.entries(items.get("fields"), f"fields of {name!r}")
        return BoundChannel(
            name,
            self.address(address, f"the address of {what}"),
            self.type_name(items.get("type"), f"'type' of {what}"),
            part,
            role,
            tuple((key, self.formula(value, f"field {key!r} of {what}")) for key, value, _ in fields),
            self.integer(items["queue"], f"'queue' of {what}", 1, 100_000) if "queue" in items else 1,
            self.boolean(items.get("latch"), f"'latch' of {what}", False),
            self.address(items["out"], f"'out' of {what}") if "out" in items else "",
            self.address(items["in"], f"'in' of {what}") if "in" in items else "",
            self.boolean(items.get("observe"), f"'observe' of {what}", role == "observe"),
            self.duration(items.get("quiescence"), f"'quiescence' of {what}", silence),
            self.duration(items.get("timeout"), f"'timeout' of {what}", 2.0),
            self.injection(items.get("inject"), what),
            (sender, receiver),
            line,
        )

    def injection(self, node: Node | None, what: str) -> Injection | None:
        """Return how the tester makes messages of a channel."""
        if node is None:
            return None
        items = self.record(node, f"'inject' of {what}", (), ("base", "set"))
        entries = self.entries(items.get("set"), f"places of {what}", self.text)
        made: list[tuple[Place, Formula]] = []
        for text, value, line in entries:
            try:
                place = parse_place(text, what)
            except BadModel as error:
                self.add(Scalar(text, True, line), error.slug, f"{what}: {error.rule}", error.remedy)
                continue
            made.append((place, self.formula(value, f"{text!r} of {what}")))
        base = items.get("base")
        if base is not None and not isinstance(base, Mapping):
            self.add(base, "kind", f"'base' of {what} must be a mapping, but is {shown(base)}")
            base = None
        return Injection(base, tuple(made), node.line)

    def bound(self, name: str, node: Node, line: int) -> Bound:
        """Return an entry of `timing`."""
        what = f"timing {name!r}"
        if not isinstance(node, Mapping):
            return Bound(name, self.bounds(node, what), line=line)
        items = self.record(node, what, ("from", "to", "bound"), ())
        begin, end = (self.identifier(items.get(key), f"{key!r} of {what}") for key in ("from", "to"))
        return Bound(name, self.bounds(items.get("bound"), what), begin, end, line)

    def bounds(self, node: Node | None, what: str) -> tuple[str, ...]:
        """Return one text, or those of a list."""
        texts = (self.text(node, what),) if node is None or isinstance(node, Scalar) else self.words(node, what)
        if node is not None and not all(text.strip() for text in texts or ("",)):
            rule = f"{what} must say a bound, but is empty"
            self.add(node, "binding-timing", rule, "e.g. p99 < 20 ms over 200 repeats")
        return texts

    def action(self, node: Node, what: str) -> Action:
        """Return a step of `before_case` or `after_case`."""
        verbs = ("set", "wait", "call", "publish")
        more = ("to", "formula", "is", "type", "inject", "timeout")
        items = self.record(node, f"a step of {what!r}", (), (*verbs, *more))
        found = [verb for verb in verbs if verb in items]
        if len(found) != 1:
            rule = f"a step of {what!r} must say one of {', '.join(verbs)}, but says {len(found)}"
            self.add(node, "binding-action", rule, "e.g. {set: /ready, to: true}")
            return Action("set", "/absent", line=node.line)
        verb = cast(Literal["set", "wait", "call", "publish"], found[0])
        spoken = f"{verb!r} of {what!r}"
        if verb in ("call", "publish") and "type" not in items:
            self.add(node, "missing-key", f"{spoken} must have the key 'type', but has not", "add it")
        if verb == "set" and ("to" in items) == ("formula" in items):
            self.add(node, "binding-action", f"{spoken} must have either 'to' or 'formula'")
        value: Value = plain(items["to"]) if "to" in items else True
        if "is" in items:
            value = self.constant_of(items["is"], f"'is' of {spoken}")
        return Action(
            verb,
            self.address(items[verb], f"the name after {verb!r}"),
            self.type_name(items["type"], f"'type' of {spoken}") if "type" in items else "",
            value,
            self.formula(items["formula"], f"'formula' of {spoken}") if "formula" in items else None,
            self.injection(items.get("inject"), spoken),
            self.duration(items.get("timeout"), f"'timeout' of {spoken}", 4.0),
            node.line,
        )

    def transport(self, node: Node | None) -> Transport:
        """Return `ros1` or `ros2`."""
        return cast(Transport, self.one_of(node, "'transport'", ("ros1", "ros2"), "ros1"))


NOTHING = parse_formula("0")
