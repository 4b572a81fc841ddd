"""Plain Python classes and functions as components: a method for each message, and what it took as the answer.

    class Door:
        def open(self, message):            # called when a message comes on the channel `open`
            return took("d1", opened={"floor": message["floor"]})

        def d2(self):                       # called when it is the turn of d2, which no message starts
            return took("d2")

A method may also yield several steps, one at a time: the tester decides when it goes on after each. Attributes that are
called as variables of the model are reported with each step, so that guards and actions are judged.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from parcours.errors import HostFailure, one_of

if TYPE_CHECKING:
    from parcours.model.structure import Component as Modelled
    from parcours.run.port import Component, Send, Step, StepReport

MOST_SENDS = 10_000  # A transition that sends more messages floods its host, and fails


@dataclass(frozen=True, slots=True)
class Took:
    """One transition taken, with what it sent; make it with `took`."""

    transition: str
    sends: tuple[Send, ...] = ()
    reported: StepReport | None = field(default=None, compare=False, repr=False)


def took(transition: str, *sends: Send, **messages: object) -> Took:
    """Return the step of a transition of the model, with its messages by channel.

    Args:
        transition: its name in the model.
        sends: (channel, message), for channels whose name is no Python word, or several messages on one channel.
        messages: channel = message.

    >>> took("d1", opened={"floor": 2})
    Took(transition='d1', sends=(('opened', {'floor': 2}),))
    """
    return Took(transition, (*sends, *messages.items()))


Answer = Took | Iterable[Took] | None  # what a method may return: one step, several, or none


class Simple:
    """An object with a method for each message -> a component."""

    def __init__(self, modelled: Modelled, make: Callable[[], object]) -> None:
        self._make = make
        self.name = modelled.name
        self._transitions = {transition.id for transition in modelled.transitions()}
        from parcours.model.structure import BASE_TYPES  # a user's file imports `took` only, which takes no time

        self._variables = [each.name for each in modelled.variables if each.type in BASE_TYPES]
        self.reset()

    def reset(self) -> None:
        """Make the object again."""
        self._object = self._make()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Call the method of the channel's name with the message; polled, call `poll` if there is one."""
        method = getattr(self._object, channel or "poll", None)
        if method is None:
            if channel is None:
                return
            kind = type(self._object).__name__
            raise AttributeError(f"{kind} has no method {channel!r} for the messages of that channel")
        yield from self._steps(_called(method, message) if channel is not None else method())

    def prompt(self, transition: str, now: int) -> Iterator[Step]:
        """Call the method of the transition's name, or `wake` if its time has come, or `poll`."""
        method = getattr(self._object, transition, None)
        if callable(method):
            yield from self._steps(method())
            return
        due = self.next_wake()
        yield from self.wake(now) if due is not None and due <= now else self.handle(None, None, now)

    def next_wake(self) -> int | None:
        """Return what the object's `next_wake` says [ns]; None if it has none."""
        ask = getattr(self._object, "next_wake", None)
        return None if ask is None else ask()

    def wake(self, now: int) -> Iterator[Step]:
        """Call the object's `wake`, with the time [ns] if it takes one."""
        method = getattr(self._object, "wake", None)
        if method is not None:
            yield from self._steps(_called(method, now))

    def set_inputs(self, values: Mapping[str, object]) -> None:
        """Set the model's input variables: attributes of the object of the same names."""
        for name, value in values.items():
            setattr(self._object, name, value)

    def _steps(self, answer: object) -> Iterator[Step]:
        if answer is None:
            return
        steps = (answer,) if isinstance(answer, Took) else answer
        if isinstance(steps, str | bytes | Mapping) or not isinstance(steps, Iterable):
            kind = type(answer).__name__
            raise TypeError(f"a method returns took(...), several of them, or None, but returned {kind}")
        for step in steps:
            if not isinstance(step, Took):
                raise TypeError(f"a step is made by took(...), but {type(step).__name__} was given")
            require_allowed(step, self.name, self._transitions if step.transition else {step.transition})
            yield replace(step, reported=self._reported()) if step.reported is None else step

    def _reported(self) -> StepReport:
        """Return the model's variables that the object has as attributes of the same names."""
        from parcours.run.port import StepReport

        found = {name: getattr(self._object, name, None) for name in self._variables}
        return StepReport({name: value for name, value in found.items() if isinstance(value, bool | int | float | str)})


def require_allowed(step: Took, component: str, transitions: Collection[str]) -> None:
    """Raise ValueError unless the component has the transition, and sends a bounded number of messages."""
    if step.transition not in transitions:
        remedy = one_of(str(step.transition), sorted(transitions))
        raise ValueError(f"took {step.transition!r}, which is no transition of {component}; {remedy}")
    if len(step.sends) > MOST_SENDS:
        raise ValueError(f"sent {len(step.sends)} messages in one transition; at most {MOST_SENDS} are allowed")


def _called(method: Callable[..., object], message: object) -> object:
    """Call a method with the message, or without if it takes none."""
    try:
        inspect.signature(method).bind(message)
    except TypeError:
        return method()
    except ValueError:
        pass
    return method(message)


def is_full(made: object) -> bool:
    """Return whether an object keeps the port's protocol (`parcours.run.port.Component`) itself."""
    return all(callable(getattr(made, method, None)) for method in ("handle", "next_wake", "wake", "reset"))


def component_of(modelled: Modelled, make: Callable[[], object]) -> Component:
    """Return the component that a maker's objects stand for: as they are if they keep the port, else `Simple`.

    Raises HostFailure: the object keeps the port but has another name.
    """
    made = make()
    if not is_full(made):
        return Simple(modelled, make)
    component: Component = made  # type: ignore[assignment]
    if getattr(component, "name", modelled.name) != modelled.name:
        rule = f"the component must be called {modelled.name!r} as in the model, but is called {component.name!r}"
        raise HostFailure(f"component {modelled.name}", rule, slug="component-name")
    return component


class Functions:
    """Plain functions of (state, message) as the methods of an object whose state is a namespace."""

    def __init__(self, functions: Mapping[str, Callable[..., object]]) -> None:
        from types import SimpleNamespace

        self.state: SimpleNamespace
        state = SimpleNamespace()
        object.__setattr__(self, "state", state)
        for event, function in functions.items():
            object.__setattr__(self, event, _bound(function, state))

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self.state, name, value)  # input variables are seen by the functions in their state


def _bound(function: Callable[..., object], state: object) -> Callable[..., object]:
    if len(inspect.signature(function).parameters) > 1:
        return lambda message: function(state, message)
    return lambda: function(state)
