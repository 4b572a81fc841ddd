"""Reads the parts of a binding: which keys stand where, with what kind of value (docs/bindings.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from parcours.errors import BadModel
from parcours.model.documents import Mapping, Node, Scalar
from parcours.model.nodes import brief, shown
from parcours.run.binding import structure as parts
from parcours.run.binding.actions import WIRE, on_the_wire
from parcours.run.binding.domains import LAST_DOMAIN
from parcours.run.binding.formulas import PlacedFormula, parse_formula
from parcours.run.binding.places import Place, parse_place
from parcours.run.binding.quantities import QuantityReader, Table, constant, plain
from parcours.run.binding.standard import ACTIONS, COMMANDS, standard_channels

T = TypeVar("T")

NOTHING = parse_formula("0")
"""Stands for a formula that is missing or wrong."""

_ADDRESS = re.compile(r"/?[A-Za-z~][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+)*", re.ASCII)
_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(?:/(?:msg|srv))?/[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_READY = ("topic", "service", "node", "parameter", "message", "after")
_VERBS = ("set", "wait", "call", "publish", "life")
LIVES = ("unconfigured", "inactive", "active")
"""The states of a lifecycle node to which it can be led, in their order."""

_CALL, _RESULT = 2.0, 3600.0
"""How long a call may take, and how long until the result of a goal is there, if nobody says [s]."""

_QUANTITIES = ("radius", "v_max", "w_max", "a_max", "alpha_max")
"""What `robot` may say of the simulated robot [m, m/s, rad/s, m/s2, rad/s2]."""


class PartReader(QuantityReader):
    """Reads the parts of a binding; each method takes a node and returns the part, with stand-ins where it is wrong.

    Paths of files are taken from the folder `here`.
    """

    def __init__(self, origin: str, here: Path) -> None:
        super().__init__(origin)
        self.here = here

    # Values.

    def formula(self, node: Node, what: str) -> PlacedFormula:
        """Return a formula over places."""
        return self.parsed(node, what, lambda text, where: parse_formula(text, where, node.line), NOTHING)

    def path(self, node: Node, what: str) -> Path:
        """Return a path, from the folder of the file if it is relative."""
        return self.here / Path(self.text(node, what)).expanduser()

    def address(self, node: Node, what: str) -> str:
        """Return the global name of a topic, service, node or parameter; the leading slash may be left out."""
        text = self.text(node, what, "/absent")
        if not _ADDRESS.fullmatch(text) or len(text) > 250:
            self.add(node, "binding-name", f"{what} must be a name such as /cmd_vel, but is {brief(text)}")
            return "/absent"
        if text.startswith("~"):
            rule = f"{what} must be a global name, but {brief(text)} is private"
            self.add(node, "binding-name", rule, f"write /node_name/{text[1:]}")
        return text if text.startswith("/") else f"/{text}"

    def type_name(self, node: Node, what: str) -> str:
        """Return a type such as `geometry_msgs/Twist`; `geometry_msgs/msg/Twist` is the same."""
        text = self.text(node, what, "absent/Absent")
        if not _TYPE.fullmatch(text):
            self.add(node, "binding-type", f"{what} must be package/Type, but is {brief(text)}", "e.g. std_msgs/Bool")
            return "absent/Absent"
        package, _, name = text.partition("/")
        return f"{package}/{name.rpartition('/')[2]}"

    def constant_of(self, node: Node, what: str) -> parts.Constant:
        """Return a scalar as plain data."""
        if isinstance(node, Scalar):
            return constant(node)
        self.add(node, "kind", f"{what} must be a single value, but is {shown(node)}")
        return 0

    def domain(self, node: Node, what: str) -> int:
        """Return the number of a domain of ROS 2."""
        return self.integer(node, what, 0, LAST_DOMAIN)

    def identifiers(self, node: Node, what: str) -> tuple[str, ...]:
        """Return the names of a list."""
        return tuple(self.identifier(item, f"an item of {what}") for item in self.listed(node, what))

    def pairs(
        self, read: Callable[[Node, str], T], name: Callable[[Node, str], str] | None = None
    ) -> Callable[[Node, str], tuple[tuple[str, T], ...]]:
        """Return what reads a mapping from names of the user's choice as pairs."""
        return lambda node, what: tuple(
            (key, read(value, f"{key!r} of {what}")) for key, value, _ in self.entries(node, what, name)
        )

    # Sections.

    def process(self, name: str, node: Node, line: int) -> parts.NodeProcess:
        """Return an entry of `nodes`."""
        what = f"node {name!r}"
        table: Table = {
            "components": (self.identifiers, (name,)), "command": (self.words, ()), "running": (self.boolean, False),
            "env": (self.pairs(self.text, self.label), ()), "cwd": (self.path, self.here),
            "remap": (self.boolean, None), "ros_node": (self.address, ""), "ready": (self.conditions, ()),
            "timeout": (self.duration, parts.START), "after": (self.identifiers, ()), "stop": (self.duration, 2.0),
            "restart": (self.choice("every-case", "when-dead"), "every-case"), "life": (self.choice(*LIVES), ""),
            "realtime": (self.boolean, False), "domain": (self.domain, None),
        }  # fmt: skip
        said = self.section(node, what, table)
        running, timeout, life = said.pop("running"), said.pop("timeout"), said.pop("life")
        if life and not said["ros_node"]:
            rule = f"{what} is led to a state of its life, so 'ros_node' must say how to ask it, but it is missing"
            self.add(node, "missing-key", rule, "add e.g. ros_node: /planner")
        if running == bool(said["command"]):
            rule = f"{what} must have a command, or say 'running: true' if you start it yourself"
            self.add(node, "binding-start", f"{rule}, but has {'both' if running else 'neither'}")
        if running and not said["ros_node"]:
            rule = f"{what} is not started here, so 'ros_node' must say by what name it is seen, but it is missing"
            self.add(node, "missing-key", rule, "add e.g. ros_node: /planner")
        if running and said["realtime"]:
            rule = f"{what} is not started here, so it cannot be given real time, but it says 'realtime: true'"
            self.add(node, "binding-start", rule, "start it with chrt, or delete it")
        if running and said["remap"]:
            rule = f"{what} is not started here, so no arguments can be appended, but it says 'remap: true'"
            remedy = "remap it yourself, and say 'out' and 'in' of its channels"
            self.add(node, "binding-start", rule, remedy)
        if said["remap"] is None:
            said["remap"] = not running
        ready = said["ready"] or (parts.ReadyWhen("bound", line=line),)
        if life:
            ready = (parts.ReadyWhen("life", said["ros_node"], life, line=line), *ready)
        said["ready"] = tuple(replace(one, timeout=timeout) for one in ready)
        return parts.NodeProcess(name, line=line, **said)

    def conditions(self, node: Node, what: str) -> tuple[parts.ReadyWhen, ...]:
        """Return the conditions of `ready`: a list of mappings, each from one kind to a name or a time."""
        table: Table = {kind: (self.duration if kind == "after" else self.address, None) for kind in _READY}
        found = []
        for item in self.listed(node, what):
            said = self.section(item, f"a condition of {what}", {**table, "is": (self.constant_of, True)})
            kinds = [kind for kind in _READY if said[kind] is not None]
            if len(kinds) != 1:
                rule = f"a condition of {what} must name one of {', '.join(_READY)}, but names {len(kinds)}"
                self.add(item, "binding-ready", rule, "e.g. ready: [{service: /plan}]")
            elif kinds == ["after"]:
                found.append(parts.ReadyWhen("after", "", said["after"], line=item.line))
            else:
                found.append(parts.ReadyWhen(kinds[0], said[kinds[0]], said["is"], line=item.line))  # type: ignore[arg-type]
        return tuple(found)

    def channel(self, role: parts.Role, name: str, node: Node, line: int) -> parts.BoundChannel:
        """Return an entry of `channels`, `between`, `observe` or `provide`; `quiescence` is 0 if it says none."""
        what = f"channel {name!r}" if role == "model" else f"{role!r} entry {name!r}"
        table: Table = {
            "type": (self.type_name, "absent/Absent"), "topic": (self.address, ""),
            "fields": (self.pairs(self.formula), ()), "latch": (self.boolean, False),
            "queue": (lambda node, what: self.integer(node, what, 1, 100_000), 1),
            "out": (self.address, ""), "in": (self.address, ""), "observe": (self.boolean, role == "observe"),
            "quiescence": (self.duration, 0.0), "inject": (self.injection, None), "domain": (self.domain, None),
        }  # fmt: skip
        if role == "model":
            table["service"] = self.address, ""
            table["action"] = self.address, ""
            table["part"] = self.choice("request", "response", *WIRE), ""
            table["timeout"] = self.duration, 0.0
            table["answer"] = self.choice("tester", "node"), "tester"
        if role == "between":
            table |= {"from": (self.identifier, ""), "to": (self.identifier, "")}
        said = self.section(node, what, table, ("type", "from", "to") if role == "between" else ("type",))
        topic, service, action, part, sender, receiver = (
            said.pop(key, "") for key in ("topic", "service", "action", "part", "from", "to")
        )
        known = WIRE if action else ("request", "response") if service else ()
        n_named = sum(map(bool, (topic, service, action)))
        if n_named != 1:
            rule = f"{what} must have a topic, a service or an action, but has {'several' if n_named else 'none'}"
            self.add(node, "binding-address", rule)
        elif known and part not in known:
            rule = f"{what} is of {'an action' if action else 'a service'}: 'part' must be {' or '.join(known)}"
            self.add(node, "missing-key", rule, "add it")
        elif topic and part:
            self.add(
                node, "binding-address", f"only services and actions have parts, but {what} is a topic", "delete it"
            )
        said["into"] = said.pop("in")
        if "timeout" in said:
            said["timeout"] = said["timeout"] or (_RESULT if part == "result" else _CALL)
        address, said["part"] = service or topic or "/absent", part or "topic"
        if action and part in WIRE:
            address, said["type"], said["part"] = on_the_wire(action, said["type"], part)
            said["action"] = part
        return parts.BoundChannel(name, address, role=role, ends=(sender, receiver), line=line, **said)

    def injection(self, node: Node, what: str) -> parts.Injection:
        """Return how the tester makes messages of a channel."""
        said = self.section(
            node, what, {"base": (self.base, None), "set": (self.places, ()), "for each": (self.place, None)}
        )
        return parts.Injection(said["base"], said["set"], said["for each"], node.line)

    def base(self, node: Node, what: str) -> Mapping | None:
        """Return the tree that a message is made of."""
        if isinstance(node, Mapping):
            return node
        self.add(node, "kind", f"{what} must be a mapping, but is {shown(node)}")
        return None

    def place(self, node: Node, what: str) -> Place | None:
        """Return a place, or None if it is not one."""
        return self.parsed(node, what, parse_place, None)

    def places(self, node: Node, what: str) -> tuple[tuple[Place, PlacedFormula], ...]:
        """Return places, each with the formula that it is set to."""
        made: list[tuple[Place, PlacedFormula]] = []
        for text, value, line in self.entries(node, what, self.text):
            try:
                place = parse_place(text, what)
            except BadModel as error:
                self.add(Scalar(text, True, line), error.slug, f"{what}: {error.rule}", error.remedy)
                continue
            made.append((place, self.formula(value, f"{text!r} of {what}")))
        return tuple(made)

    def bound(self, name: str, node: Node, line: int) -> parts.BoundEntry:
        """Return an entry of `timing`: limits on an interaction, or from one channel to another."""
        what = f"timing {name!r}"
        if not isinstance(node, Mapping):
            return parts.BoundEntry(name, self.bounds(node, what), line=line)
        needed: Table = {"from": (self.identifier, ""), "to": (self.identifier, ""), "bound": (self.bounds, ())}
        said = self.section(node, what, {**needed, "through": (self.identifiers, ())}, tuple(needed))
        return parts.BoundEntry(name, said["bound"], said["from"], said["to"], said["through"], line)

    def bounds(self, node: Node, what: str) -> tuple[str, ...]:
        """Return one text, or those of a list."""
        texts = (self.text(node, what),) if isinstance(node, Scalar) else self.words(node, what)
        if not all(text.strip() for text in texts or ("",)):
            rule = f"{what} must say a bound, but is empty"
            self.add(node, "binding-timing", rule, "e.g. p99 < 20 ms over 200 repeats")
        return texts

    def actions(self, node: Node, what: str) -> tuple[parts.Action, ...]:
        """Return the steps of `before_case` or `after_case`."""
        return tuple(self.action(item, what) for item in self.listed(node, what))

    def action(self, node: Node, what: str) -> parts.Action:
        """Return one of these steps."""
        table: Table = {
            **dict.fromkeys(_VERBS, (self.address, "")), "is": (self.constant_of, None), "type": (self.type_name, ""),
            "to": (lambda node, what: plain(node), None), "formula": (self.formula, None),
            "inject": (self.injection, None), "timeout": (self.duration, 4.0), "domain": (self.domain, None),
        }  # fmt: skip
        said = self.section(node, f"a step of {what}", table)
        found = [verb for verb in _VERBS if said[verb]]
        if len(found) != 1:
            rule = f"a step of {what} must say one of {', '.join(_VERBS)}, but says {len(found)}"
            self.add(node, "binding-action", rule, "e.g. {set: /ready, to: true}")
            return parts.Action("set", "/absent", line=node.line)
        verb, spoken = found[0], f"{found[0]!r} of {what}"
        if verb in ("call", "publish") and not said["type"]:
            self.add(node, "missing-key", f"{spoken} must have the key 'type', but has not", "add it")
        if verb == "set" and (said["to"] is None) == (said["formula"] is None):
            self.add(node, "binding-action", f"{spoken} must have either 'to' or 'formula'")
        if verb == "life" and said["is"] not in LIVES:
            self.add(node, "binding-action", f"{spoken} must say one of {', '.join(LIVES)} under 'is'")
        value = next((said[key] for key in ("is", "to") if said[key] is not None), True)
        more = {key: said[key] for key in ("type", "formula", "inject", "timeout", "domain")}
        return parts.Action(verb, said[verb], value=value, line=node.line, **more)  # type: ignore[arg-type]

    def system(self, node: Node, what: str) -> parts.SystemEntry:
        """Return the section of system tests."""
        table: Table = {
            "sense": (self.pairs(self.duration), ()), "once": (self.identifiers, ()), "each": (self.identifiers, ()),
            "command": (self.command, parts.CommandEntry("", NOTHING, NOTHING, math.inf)), "robot": (self.robot, ()),
            "tolerance": (self.number, 0.2), "duration": (self.duration, 20.0),
            "imminent_collision": (self.alarm, None),
        }  # fmt: skip
        said = self.section(node, what, table, ("sense", "command"))
        return parts.SystemEntry(alarm=said.pop("imminent_collision"), line=node.line, **said)

    def stack(self, node: Node, what: str) -> tuple[parts.Stack, tuple[parts.BoundChannel, ...]]:
        """Return the section of a navigation stack, and the channels of the standard topics that it names."""
        known = standard_channels()
        table: Table = {
            **dict.fromkeys(known, (self.address, "")), "time": (self.choice("simulated", "real"), "simulated"),
            "step": (self.duration, 0.05), "hops": (lambda node, what: self.integer(node, what, 0, 20), 0),
            "quiet": (self.duration, 0.0), "network": (self.choice("own", "shared"), "own"),
        }  # fmt: skip
        said = self.section(node, what, table)
        named = [key for key in known if said[key]]
        commands = [key for key in named if key in COMMANDS]
        if len(commands) != 1:
            rule = f"{what} must name one of {' and '.join(COMMANDS)}, but names {len(commands) or 'neither'}"
            self.add(node, "binding-stack", rule, "e.g. command: /cmd_vel")
        roles: dict[bool, parts.Role] = {True: "observe", False: "provide"}
        channels = (self.channel(roles[key in COMMANDS], key, known[key], node.line) for key in named)
        stack = parts.Stack(commands[0] if commands else "", said["time"] == "simulated", said["step"], said["hops"],
                            said["quiet"], said["network"] == "own", node.line)  # fmt: skip
        return stack, tuple(
            replace(channel, address=said[channel.name], part="goal" if channel.name in ACTIONS else channel.part)
            for channel in channels
        )

    def robot(self, node: Node, what: str) -> tuple[tuple[str, float], ...]:
        """Return the description of the simulated robot."""
        said = self.section(node, what, dict.fromkeys(_QUANTITIES, (self.number, None)))
        return tuple((name, value) for name, value in said.items() if value is not None)

    def alarm(self, node: Node, what: str) -> tuple[str, PlacedFormula]:
        """Return the condition that tells of an imminent collision, with the channel of which it speaks."""
        formula = self.formula(node, what)
        return self.spoken_of(node, what, formula), formula

    def command(self, node: Node, what: str) -> parts.CommandEntry:
        """Return what drives the robot."""
        table: Table = dict.fromkeys(("linear", "angular"), (self.formula, NOTHING))
        said = self.section(node, what, {**table, "hold": (self.hold, math.inf)}, ("linear", "angular"))
        return parts.CommandEntry(self.spoken_of(node, what, said["linear"], said["angular"]), line=node.line, **said)

    def hold(self, node: Node, what: str) -> float:
        """Return how long a command counts [s]."""
        return math.inf if isinstance(node, Scalar) and node.text == "inf" else self.duration(node, what)

    def spoken_of(self, node: Node, what: str, *formulas: PlacedFormula) -> str:
        """Return the one channel of which formulas speak."""
        channels = sorted({str(place.steps[0]) for formula in formulas for place in formula.places})
        if len(channels) != 1 and all(formula != NOTHING for formula in formulas):
            rule = f"{what} must speak of one channel, but speaks of {', '.join(channels) or 'none'}"
            self.add(node, "binding-channel", rule, "write e.g. cmd_vel.linear.x")
        return channels[0] if channels else ""
