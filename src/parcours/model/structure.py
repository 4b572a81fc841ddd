"""What a model is: communicating extended finite state machines (paper, section IV-A).

A `Cefsm` has components (processes); each runs one or more machines side by side; machines take transitions,
each with a predicate (event, [guard], actions, messages); channels link components and carry messages of a
declared class.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from parcours.model.expression import Assignment, Call, Expression

ENVIRONMENT = "environment"
"""The partner of every channel whose other end lies outside the model: the tester."""

BASE_TYPES = ("bool", "int", "real", "enum", "text")
"""The value types that guards compute with; any other names a message class and is carried, not computed."""

CLOCK = "clock"
"""The type of a variable that grows with time [s]; actions may set it, guards and invariants compare it."""


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message class: type, SI unit and shape (empty for a scalar; names are free lengths)."""

    name: str
    type: str
    unit: str = "1"
    shape: tuple[int | str, ...] = ()
    doc: str = ""


@dataclass(frozen=True, slots=True)
class MessageClass:
    """A class of the structural model (Fig. 4, Fig. 6). A field's type may name another message class."""

    name: str
    fields: tuple[Field, ...]
    doc: str = ""
    # Lines are for messages only: two models are equal wherever they were read.
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Formula:
    """What must hold: of a message on a channel, of a transition, of the variables of a component (`ensures:`)."""

    name: str
    condition: Expression
    text: str = field(default="", compare=False)
    """As it was written: `condition` has the values of constants in it."""
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Channel:
    """A directed link between two components (one row of Table I).

    `capacity` 0 is a rendezvous: send and receive are one step. A positive capacity is a bounded queue.
    """

    name: str
    sender: str
    receiver: str
    message: str
    topic: str = ""
    capacity: int = 1
    ensures: tuple[Formula, ...] = ()
    """Of every message on it: `it`, the `request` that it answers, the `last` one before, the sender's variables."""
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a component, its initial value and its finite domain, if it has one.

    An `input` variable is set by the environment at will (a monitored variable); a `local` one only by
    actions. One of type `clock` starts at 0 s and grows with time; untimed, it may have any value.
    """

    name: str
    type: str
    initial: object
    role: Literal["local", "input"] = "local"
    domain: tuple[object, ...] | range = ()
    unit: str = "1"
    line: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Receive:
    """The event of a transition: a message arrives on `channel`; guard and actions call it `name`."""

    channel: str
    name: str = ""


@dataclass(frozen=True, slots=True)
class Send:
    """A message leaves on `channel`; `payload` is what the model says of its content."""

    channel: str
    payload: tuple[Expression, ...] = ()


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition with its predicate event/[guard]/actions/messages. `id` is the paper's name, e.g. p22.

    `duration` bounds the time [s] from entering the source state to reaching the target, (least, most); None
    if the model says nothing. `weight` is how likely a weighted walk takes it beside its rivals. `tags` name what it
    shows, such as requirements of the system.
    """

    id: str
    source: str
    target: str
    event: Receive | None = None
    guard: Expression | None = None
    actions: tuple[Assignment | Call, ...] = ()
    sends: tuple[Send, ...] = ()
    duration: tuple[float, float] | None = None
    weight: float = 1.0
    ensures: tuple[Formula, ...] = ()
    """Of the variables after it and `old` before it, what it received, and by channel what it sent and sent `last`."""
    line: int = field(default=0, compare=False)
    tags: tuple[str, ...] = ()

    @property
    def is_loop(self) -> bool:
        """Whether the transition leaves the state unchanged."""
        return self.source == self.target


@dataclass(frozen=True, slots=True)
class Machine:
    """One extended finite state machine. States and transitions keep the order of the file.

    `final` are the states where a test may end; empty leaves it to the graph. `invariants` are (state,
    condition on clocks): the state must be left before its condition fails. `tags` are (state, tag). `exclusive` are
    groups of transitions that leave one state, of which no two guards hold together.
    """

    name: str
    initial: str
    states: tuple[str, ...]
    transitions: tuple[Transition, ...]
    final: tuple[str, ...] = ()
    invariants: tuple[tuple[str, Expression], ...] = ()
    line: int = field(default=0, compare=False)
    tags: tuple[tuple[str, str], ...] = ()
    exclusive: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Component:
    """A process: one or more machines that share variables (orthogonal regions of one EFSM in the paper)."""

    name: str
    machines: tuple[Machine, ...]
    variables: tuple[Variable, ...] = ()
    title: str = ""
    invariants: tuple[Formula, ...] = ()
    """Of its variables, after every transition."""
    line: int = field(default=0, compare=False)

    def transitions(self) -> Iterator[Transition]:
        """Yield the transitions of all machines, in file order."""
        for machine in self.machines:
            yield from machine.transitions


_Named = TypeVar("_Named", Component, Channel)


@dataclass(frozen=True, slots=True)
class Cefsm:
    """A checked model: components, the channels between them and the classes of what flows there."""

    name: str
    components: tuple[Component, ...]
    channels: tuple[Channel, ...] = ()
    messages: tuple[MessageClass, ...] = ()
    source: str = field(default="", compare=False)
    doc: str = ""
    serialisation: str = ""
    """How rendezvous serialisation chooses start points: a policy of `parcours.abtc`; empty is its default."""
    interactions: tuple[tuple[str, tuple[str, ...]], ...] = field(default=())
    """Specified interaction test paths, (name, components visited), for specified path coverage."""
    interaction_lines: tuple[int, ...] = field(default=(), compare=False)
    """The line of the file where each of `interactions` stands; empty if the model was not read from text."""
    signals: tuple[Channel, ...] = ()
    """Links whose messages no transition sends or receives: their data are described, their behaviour is not."""

    @property
    def carriers(self) -> tuple[Channel, ...]:
        """All links whose messages the model knows the class of: channels, then signals."""
        return (*self.channels, *self.signals)

    def component(self, name: str) -> Component:
        """Return the component called `name`. Raises KeyError if there is none."""
        return _named(self.components, name)

    def channel(self, name: str) -> Channel:
        """Return the channel called `name`. Raises KeyError if there is none."""
        return _named(self.channels, name)

    def transition(self, id: str) -> tuple[Component, Machine, Transition]:
        """Return the transition called `id` with its component and machine, or raise KeyError."""
        for component in self.components:
            for machine in component.machines:
                for transition in machine.transitions:
                    if transition.id == id:
                        return component, machine, transition
        raise KeyError(id)


def _named(elements: tuple[_Named, ...], name: str) -> _Named:
    for element in elements:
        if element.name == name:
            return element
    raise KeyError(name)
