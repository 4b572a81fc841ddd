"""Where a model stands and what it may do next, as frozen values, with the tables that say what is where."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, replace

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.expression import Assignment, Expression, FieldAccess, names, type_of
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.typing import accepts
from parcours.model.scope import Scopes, is_local
from parcours.model.structure import BASE_TYPES, ENVIRONMENT, Cefsm, Component, Machine, Send, Transition, Variable

Message = tuple[tuple[str, object], ...]
"""The fields of a message whose values the model says, by name; the others are open."""

Inputs = tuple[tuple[str, object], ...]
"""Values of what is open, as ('Component.term', value), sorted by name."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """Where a model stands: three flat tuples in the order of `Layout`, so that they hash and pack well."""

    # states   (planning, idle, moving)      one for each machine, side by side
    # values   (3, False)                    the local variables of all components
    # queues   ((ask, ask), ())              one for each channel that holds messages, the oldest first

    states: tuple[str, ...]
    values: tuple[object, ...]
    queues: tuple[tuple[Message, ...], ...]


@dataclass(frozen=True, slots=True)
class Move:
    """A step that can be taken: a transition's id, its partner's in a rendezvous, and the tester's choice.

    >>> print(Move("p24", "p16"))
    p24+p16
    """

    transition: str
    partner: str = ""
    inputs: Inputs = ()

    def __str__(self) -> str:
        return f"{self.transition}+{self.partner}" if self.partner else self.transition


@dataclass(frozen=True, slots=True)
class Content:
    """What a send says of its message: an expression for each field, or one message passed on as a whole."""

    fields: tuple[tuple[str, Expression], ...]
    is_passed: bool = False


@dataclass(frozen=True, slots=True)
class TransitionSite:
    """A transition and where it lives.

    Args:
        component: the name of its component.
        slot: the index of its machine in `Configuration.states`.
        transition: the transition.
        contents: what each of its sends says, in their order.
        assigned: its assignments to variables that have values, with the index in `Configuration.values`.
        reads: (name, index in `Configuration.values`) of the component's local variables that matter to the
            choice.
    """

    component: str
    slot: int
    transition: Transition
    contents: tuple[Content, ...]
    assigned: tuple[tuple[int, Expression], ...]
    reads: tuple[tuple[str, int], ...]

    def effects(self) -> list[Expression]:
        """Return the expressions whose values outlive the step."""
        said = [value for content in self.contents if not content.is_passed for _, value in content.fields]
        return [value for _, value in self.assigned] + said


class Layout:
    """The tables of one model.

    Attributes:
        machines: (component, machine) names, the order of `Configuration.states`.
        variables: (component, variable) of the local variables that have values, the order of `.values`.
        channels: names of the channels that hold messages, the order of `.queues`.
        queue: the index of each channel that holds messages now: not opened.
        meetings: channels on which send and receive are one step.
        supplied: channels from which a message can always be received.
    """

    def __init__(self, cefsm: Cefsm, opened: Set[str] = frozenset()) -> None:
        self.cefsm, self.opened = cefsm, frozenset(opened)
        self.scopes = Scopes(cefsm)
        self.capacity = {channel.name: channel.capacity for channel in cefsm.channels}
        for name in sorted(opened):
            if name not in self.capacity:
                rule = f"only channels can be opened, but {name!r} is not one"
                raise BadRequest("opened", rule, one_of(name, list(self.capacity)), slug="unknown-channel")
        pairs = [(component, machine) for component in cefsm.components for machine in component.machines]
        self.machines = tuple((component.name, machine.name) for component, machine in pairs)
        self.initial_states = tuple(machine.initial for _, machine in pairs)
        self.variables = tuple((each.name, one) for each in cefsm.components for one in each.variables if is_local(one))
        self._index = {(owner, variable.name): at for at, (owner, variable) in enumerate(self.variables)}
        read = {each.event.channel for component in cefsm.components for each in component.transitions() if each.event}
        inner = [
            each for each in cefsm.channels if each.name in read and ENVIRONMENT not in (each.sender, each.receiver)
        ]
        self.channels = tuple(channel.name for channel in inner if channel.capacity)
        self.queue = {name: at for at, name in enumerate(self.channels) if name not in opened}
        self.meetings = {channel.name for channel in inner if not channel.capacity} - self.opened
        outer = {channel.name for channel in cefsm.channels if channel.sender == ENVIRONMENT}
        self.supplied = outer | self.opened
        self._messages = {channel.name: channel.message for channel in cefsm.channels}
        self.leaving = [self._by_source(slot, *pair) for slot, pair in enumerate(pairs)]
        self.sites = {site.transition.id: site for each in self.leaving for sites in each.values() for site in sites}

    def initial(self) -> Configuration:
        """Return the configuration with every machine in its initial state and every queue empty."""
        values = tuple(stored(variable, variable.initial, owner) for owner, variable in self.variables)
        return Configuration(self.initial_states, values, ((),) * len(self.channels))

    def local(self, configuration: Configuration, component: str) -> dict[str, object]:
        """Return the values of a component's local variables."""
        pairs = zip(self.variables, configuration.values, strict=True)
        return {variable.name: value for (owner, variable), value in pairs if owner == component}

    def _by_source(self, slot: int, component: Component, machine: Machine) -> dict[str, list[TransitionSite]]:
        leaving: dict[str, list[TransitionSite]] = {}
        for transition in machine.transitions:
            contents = tuple(self._content(component, transition, send) for send in transition.sends)
            assigned = tuple(
                (self._index[component.name, action.target], action.value)
                for action in transition.actions
                if isinstance(action, Assignment) and (component.name, action.target) in self._index
            )
            site = TransitionSite(component.name, slot, transition, contents, assigned, ())
            used = {name for value in site.effects() for name in names(value)}
            used |= names(transition.guard) if transition.guard is not None else set()
            index = {name: self._index.get((component.name, name)) for name in sorted(used)}
            reads = tuple((name, at) for name, at in index.items() if at is not None)
            leaving.setdefault(transition.source, []).append(replace(site, reads=reads))
        return leaving

    def _content(self, component: Component, transition: Transition, send: Send) -> Content:
        # A send on a channel where nobody of the model listens says nothing that matters later.
        if send.channel not in self.queue and send.channel not in self.meetings:
            return Content(())
        return content_of(self.scopes, self._messages[send.channel], component, transition, send)


def content_of(scopes: Scopes, message: str, component: Component, transition: Transition, send: Send) -> Content:
    """Return what a send says of its message, which is of the class `message`."""
    fields = scopes.classes[message]
    types = scopes.types(component.name, transition)
    given = [type_of(value, types, scopes.classes) for value in send.payload]
    base = [name for name, type_ in fields.items() if type_.name in BASE_TYPES and not type_.rank]
    if len(given) == 1 and given[0].name == message and not given[0].rank:
        return Content(tuple((name, FieldAccess(send.payload[0], name)) for name in base), is_passed=True)
    if len(given) != len(fields) or not all(map(accepts, fields.values(), given)):
        return Content(())
    said = dict(zip(fields, send.payload, strict=True))
    return Content(tuple((name, said[name]) for name in base))


def stored(variable: Variable, value: object, owner: str) -> object:
    """Return the value as the variable keeps it: an integer becomes a real where one is declared."""
    if variable.type == "real" and isinstance(value, int | float):
        value = float(value)
    if (
        (bool(variable.domain) and value not in variable.domain)
        or (isinstance(value, float) and not math.isfinite(value))
        or (isinstance(value, int) and abs(value) > INTEGER_LIMIT)
    ):
        domain = variable.domain
        allowed = f"{domain[0]} .. {domain[-1]}" if isinstance(domain, range) else f"{list(domain)}"
        rule = f"'{owner}.{variable.name}' must stay in its domain {allowed}, but would become {value!r}"
        raise BadModel("step", rule, "guard the transition, or widen the domain", slug="out-of-range")
    return value
