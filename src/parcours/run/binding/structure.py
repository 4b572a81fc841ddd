"""What a binding says: which processes, topics and services of a foreign system stand for which parts of a model."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from parcours.model.documents import Node as Tree
from parcours.model.structure import Cefsm
from parcours.run.binding.actions import ActionPart
from parcours.run.binding.formulas import PlacedFormula
from parcours.run.binding.places import Place

Transport = Literal["ros1", "ros2"]
Role = Literal["model", "between", "observe", "provide"]
"""A channel of the model, or a topic beside it: relayed between two nodes, listened to, or published by the tester."""

Part = Literal["topic", "request", "response", "goal"]
"""What a channel is on the wire: a topic, or one half of a service."""

Value: TypeAlias = "bool | int | float | str | tuple[Value, ...] | tuple[tuple[str, Value], ...]"
"""A plain value: a scalar, a list, or a mapping as pairs."""

Constant: TypeAlias = "bool | int | float | str"


START = 60.0
"""How long a node that says nothing else may take to start [s]; a graph that lacks something is complete earlier."""


@dataclass(frozen=True, slots=True)
class ReadyWhen:
    """What must be seen before a node counts as started, and for how long it is waited for [s].

    `bound` is everything that the binding says the node sends or serves. `name` is a global name; `value` what a
    parameter must be, the state of a lifecycle node, to which it is led, or the seconds of `after`.
    """

    kind: Literal["bound", "topic", "service", "node", "parameter", "message", "after", "life"]
    name: str = ""
    value: Constant = True
    timeout: float = START
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class NodeProcess:
    """An operating-system process (an entry of `nodes`) that runs one or more components of the model.

    An empty `command` is a node that the user starts. `ros_node` is the name under which the graph knows it. `remap`
    tells whether it obeys remapping arguments that are appended to its command. It is started when the nodes `after`
    are ready, asked to stop, and ended after `stop` [s]. `realtime` asks for it to run before all ordinary processes.
    `domain` is that of ROS 2 on which it runs; None for that of the environment.
    """

    name: str
    components: tuple[str, ...]
    command: tuple[str, ...] = ()
    env: tuple[tuple[str, str], ...] = ()
    cwd: Path = Path()
    remap: bool = True
    ros_node: str = ""
    ready: tuple[ReadyWhen, ...] = ()
    after: tuple[str, ...] = ()
    restart: Literal["when-dead", "every-case"] = "every-case"
    stop: float = 2.0
    realtime: bool = False
    domain: int | None = None
    line: int = field(default=0, compare=False)

    @property
    def is_ours(self) -> bool:
        """Whether the tester starts it."""
        return bool(self.command)

    @property
    def is_launcher(self) -> bool:
        """Whether it runs no component itself: it is there to start others, such as those of a launch file."""
        return bool(self.command) and not self.components


@dataclass(frozen=True, slots=True)
class Injection:
    """How a message of the tester is made: a base (plain data, as a tree with lines), then places set to formulas.

    A place of a response with `[*]` is set once for each item of the list `each` of its request.
    """

    base: Tree | None = None
    set: tuple[tuple[Place, PlacedFormula], ...] = ()
    each: Place | None = None
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class BoundChannel:
    """A channel of the model, or a topic beside it, on the wire.

    Args:
        name: the channel of the model; of `observe` and `provide`, a name of the user's choice.
        address: the global name of the topic or service.
        type: e.g. `geometry_msgs/Twist`.
        part: a topic, or which half of the service, or the goal of an action.
        role: whether it is a channel of the model, and if not, what is done with it.
        fields: (field of the model's message, formula over the places of the ROS message).
        queue: how many messages wait at either end.
        latch: whether the last message is given to those who come later.
        out: under what name a sender that is not remapped sends; empty for the address itself.
        into: under what name its receiver listens; empty for the address itself.
        observe: listened to, not relayed: nothing can be held, delayed or dropped.
        quiescence: after how long without a message it counts as silent [s].
        timeout: how long a service may take [s].
        inject: how the tester makes its messages.
        answer: who answers calls of a service that are no part of an abstract case: the tester, or a node run for it.
        ends: the nodes that send and receive it, for role `between` only.
        action: which part of an action of ROS 2 it is, if it is one.
        domain: of ROS 2, where both ends of it are; None for those of its nodes.
    """

    name: str
    address: str
    type: str
    part: Part = "topic"
    role: Role = "model"
    fields: tuple[tuple[str, PlacedFormula], ...] = ()
    queue: int = 1
    latch: bool = False
    out: str = ""
    into: str = ""
    observe: bool = False
    quiescence: float = 0.5
    timeout: float = 2.0
    inject: Injection | None = None
    answer: Literal["tester", "node"] = "tester"
    ends: tuple[str, str] = ("", "")
    action: ActionPart = ""
    domain: int | None = None
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class BoundEntry:
    """Limits on how long something takes, as texts; from a message on one channel to the next on another.

    `begin` and `end` are empty where `name` is an interaction of the model. A chain passes `through` the channels
    between them: its time is that from a message to its effect.
    """

    name: str
    texts: tuple[str, ...]
    begin: str = ""
    end: str = ""
    through: tuple[str, ...] = ()
    line: int = field(default=0, compare=False)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that a chain passes, in order."""
        return self.begin, *self.through, self.end


@dataclass(frozen=True, slots=True)
class Action:
    """Something to do before or after a case: set or await a parameter, call a service, publish, lead a node's life."""

    kind: Literal["set", "wait", "call", "publish", "life"]
    name: str
    type: str = ""
    value: Value = True
    formula: PlacedFormula | None = None
    inject: Injection | None = None
    timeout: float = 4.0
    domain: int | None = None
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """Which message drives the simulated robot: speed [m/s], yaw rate [rad/s]; it counts for `hold` [s]."""

    on: str
    linear: PlacedFormula
    angular: PlacedFormula
    hold: float
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class SystemEntry:
    """A system test: the tester simulates the world, tells of it on `sense`, and obeys `command`.

    Args:
        sense: (channel, period [s]) of what is published all the time.
        once: channels published once when a case begins, such as the goal.
        each: channels of which the i-th tells of the i-th obstacle only; they stand in `sense`, too.
        command: what drives the robot.
        alarm: (channel, condition) that tells of an imminent collision.
        robot: (quantity, value): radius [m], v_max [m/s], w_max [rad/s], a_max [m/s2], alpha_max [rad/s2].
        tolerance: how near the goal counts as reached [m].
        duration: how long a case lasts at most [s].
    """

    sense: tuple[tuple[str, float], ...]
    command: CommandEntry
    once: tuple[str, ...] = ()
    each: tuple[str, ...] = ()
    alarm: tuple[str, PlacedFormula] | None = None
    robot: tuple[tuple[str, float], ...] = ()
    tolerance: float = 0.2
    duration: float = 20.0
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Stack:
    """A navigation stack that is driven in worlds through its standard topics (docs/ros2.md).

    Args:
        command: the channel on which its commands come.
        simulated: whether time passes on /clock, as fast as its nodes can work; else it is the machine's.
        step: the longest time that passes at once on /clock [s].
        hops: how many messages may follow on each other between its nodes, unheard by the tester.
        quiet: how long nothing must be heard of its nodes after each step, for those with threads of their own [s].
        own: whether its nodes run in a network of their own.
    """

    command: str
    simulated: bool = True
    step: float = 0.05
    hops: int = 0
    quiet: float = 0.0
    own: bool = True
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Binding:
    """A checked binding and the model that it binds. Paths are absolute or relative to the working directory."""

    name: str
    model: Cefsm
    transport: Transport
    nodes: tuple[NodeProcess, ...]
    channels: tuple[BoundChannel, ...]
    timing: tuple[BoundEntry, ...] = ()
    warm_up: int = 10
    system: SystemEntry | None = None
    stack: Stack | None = None
    clock: float = 0.0
    """How often the tester says on /clock what time it is [s]; 0 if it does not."""
    constants: tuple[tuple[str, Constant], ...] = ()
    data: tuple[str, ...] = ()
    """The names of the test inputs that formulas may use."""
    data_file: str = ""
    """Where they come from; empty if there are none."""
    parameters: tuple[tuple[str, Value], ...] = ()
    before_case: tuple[Action, ...] = ()
    after_case: tuple[Action, ...] = ()
    interfaces: tuple[Path, ...] = ()
    python_paths: tuple[Path, ...] = ()
    master: str = ""
    source: str = field(default="", compare=False)
    doc: str = ""

    @property
    def files(self) -> list[Path]:
        """The files that results depend on beside the binding itself: model, data, and what its commands name."""
        named = [Path(file) for file in (self.model.source, self.data_file) if file]
        words = [node.cwd / word for node in self.nodes for word in node.command if not Path(word).is_absolute()]
        return [file for file in dict.fromkeys([*named, *words]) if file.is_file()]

    def channel(self, name: str) -> BoundChannel:
        """Return the bound channel called `name`. Raises KeyError if there is none."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise KeyError(name)

    def ends(self, name: str) -> tuple[str, str]:
        """Return who sends and who receives on a bound channel, components or nodes; empty for one that is unknown."""
        channel = self.channel(name)
        if channel.role != "model":
            return channel.ends
        return next(((one.sender, one.receiver) for one in self.model.channels if one.name == name), ("", ""))

    def process_of(self, component: str) -> NodeProcess | None:
        """Return the process that runs a component, or None if none does: the tester stands in for it."""
        return next((node for node in self.nodes if component in node.components), None)

    @property
    def starts_all(self) -> bool:
        """Whether the tester starts every node, itself or by a launcher: none is the user's."""
        launched = [node for launcher in self.nodes for node in self.launched_by(launcher)]
        return all(node.is_ours or node in launched for node in self.nodes)

    def launched_by(self, launcher: NodeProcess) -> tuple[NodeProcess, ...]:
        """Return the nodes that a launcher starts: those that run already when they come `after` it."""
        nodes = self.nodes if launcher.is_launcher else ()
        return tuple(node for node in nodes if not node.is_ours and launcher.name in node.after)
