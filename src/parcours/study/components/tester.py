"""The tester's half of a component case: what it supplies, how it moves idle components on, here and in nodes.

In this process components are moved by calls; in nodes by names and messages, so that whatever the tester does has a
form that travels. `StudyTester` does both for every study made of `study.yaml`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import msgspec

from parcours.abtc import Event
from parcours.model.structure import Component as Modelled
from parcours.run.hosts.live_enforcement import LiveStimuli
from parcours.run.port import Component, Send, Step
from parcours.study.components.messages import INPUTS
from parcours.study.components.stimuli import Stimulus
from parcours.study.components.systems import System
from parcours.study.parameters import Scalar, Settings
from parcours.suite import Case


class Tester(LiveStimuli, Protocol):
    """Everything that one case needs from outside its components."""

    def component(self, name: str) -> Component:
        """Return a fresh component of that name."""

    def supply(self, event: Event) -> object:
        """Return the message that the environment gives to a receiving event."""

    def move(self, event: Event, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component of this process to a transition that no message starts."""

    def prepare(self, event: Event, component: Component) -> None:
        """Set the input variables of a component of this process."""

    def beside(self, event: Event) -> Sequence[Send]:
        """Return the messages that reach the event's instance just before it, beside the one that it receives."""


class Sent(msgspec.Struct, frozen=True):
    """A case as it travels to the nodes of a study: its settings, and the case."""

    settings: dict[str, Scalar]
    case: Case


class StudyTester:
    """The tester of a study whose stimuli were chosen beforehand."""

    def __init__(
        self, system: System, components: Mapping[str, Modelled], case: Case, settings: Settings, known: Settings,
        stimuli: Mapping[int, Stimulus], early: Mapping[int, Sequence[Event]] | None = None,
    ) -> None:  # fmt: skip
        self._early = early or {}  # event -> those whose messages arrive just before it, while its instance is busy
        self._system, self._components = system, components
        self._case, self._settings, self._known, self._stimuli = case, settings, known, stimuli

    def component(self, name: str) -> Component:
        """Return a fresh component of that name."""
        return self._system.component(self._components[name], self._case, self._known)

    def supply(self, event: Event) -> object:
        """Return the message the environment gives to a receiving event."""
        return self._stimuli[event.position].message

    def move(self, event: Event, component: Component, now: int) -> Iterator[Step]:
        """Ask the component for the transition by its name, or wake or poll it."""
        return prompted(event.transition, component, now)

    def prepare(self, event: Event, component: Component) -> None:
        """Set the input variables that the event's guard reads."""
        set_inputs(component, self._stimuli[event.position].inputs)

    def case(self) -> bytes:
        """Return the case as `node_program` knows it."""
        return msgspec.json.encode(Sent(dict(self._settings), self._case))

    def prompt(self, event: Event) -> str:
        """Return the transition's name."""
        return event.transition

    def given(self, event: Event) -> tuple[str, object] | None:
        """Return None: no message takes the place of a prompt."""
        return None

    def settling(self, event: Event) -> Sequence[tuple[str, object]]:
        """Return the input variables to set, as one message, and the messages that arrive beside the event's own."""
        inputs = self._stimuli[event.position].inputs
        return (*([(INPUTS, dict(inputs))] if inputs else []), *self.beside(event))

    def beside(self, event: Event) -> Sequence[Send]:
        """Return the messages of visits that begin while this one goes on, and a stray answer."""
        found: list[Send] = []
        for visit in self._early.get(event.position, ()):
            assert visit.receives is not None
            found.append((visit.receives.channel, self._stimuli[visit.position].message))
        stray = self._stimuli[event.position].stray
        if stray is not None and event.receives is not None:
            found.append((event.receives.channel, stray))
        return found


def prompted(transition: str, component: Component, now: int) -> Iterator[Step]:
    """Ask a component for a transition by its name if it can be asked, else wake or poll it."""
    ask = getattr(component, "prompt", None)
    if ask is not None:
        steps: Iterator[Step] = ask(transition, now)
        return steps
    due = component.next_wake()
    return component.wake(now) if due is not None and due <= now else component.handle(None, None, now)


def set_inputs(component: Component, values: Mapping[str, object]) -> None:
    """Set input variables of a component: by its `set_inputs`, else as attributes that it has."""
    if not values:
        return
    tell = getattr(component, "set_inputs", None)
    if tell is not None:
        tell(values)
        return
    for name, value in values.items():
        if hasattr(component, name):
            setattr(component, name, value)


class Wrapped:
    """A component inside another one that changes some of what reaches it."""

    def __init__(self, component: Component) -> None:
        self._component = component
        self.name, self.reset = component.name, component.reset
        self.next_wake, self.wake = component.next_wake, component.wake

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take up a message."""
        return self._component.handle(channel, message, now)

    def prompt(self, transition: str, now: int) -> Iterator[Step]:
        """Ask the component for a transition."""
        return prompted(transition, self._component, now)

    def set_inputs(self, values: Mapping[str, object]) -> None:
        """Set the component's input variables."""
        set_inputs(self._component, values)

    def close(self) -> None:
        """Let go of what the component holds."""
        close = getattr(self._component, "close", None)
        if close is not None:
            close()
