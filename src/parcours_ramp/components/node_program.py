"""RAMP's components as programs of nodes: a component case, as the tester sends it, -> the component."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from parcours.run.port import Component, Step
from parcours.suite import Case
from parcours_ramp.components.components import PROMPTS, component_of, parameters_of, view
from parcours_ramp.planner.wire import FORMS, Field, decode, encode, flatten, restore


class RampCodec:
    """RAMP's payloads <-> bytes."""

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the payload's bytes."""
        return encode(channel, payload)

    def decode(self, channel: str, data: bytes) -> object:
        """Return the payload. Raises BadRequest, naming channel and field, if these bytes are none."""
        return decode(channel, data)

    def form(self, channel: str) -> Sequence[Field] | None:
        """Return the fields of the channel's messages; None if RAMP has no such channel."""
        return FORMS.get(channel)

    def flatten(self, channel: str, payload: object) -> tuple[object, ...]:
        """Return the payload's fields."""
        return flatten(channel, payload)

    def restore(self, channel: str, values: Sequence[object]) -> object:
        """Return the payload of these fields. Raises BadRequest if they make none."""
        return restore(channel, values)


class ComponentNodeProgram(RampCodec):
    """One of RAMP's components, for component cases.

    Args:
        component: its name in the model.
    """

    def __init__(self, component: str) -> None:
        self._component = component

    def instance(self, case: bytes) -> Component:
        """Return a fresh component for the case."""
        known = msgspec.json.decode(case, type=Case)
        return component_of(self._component, known, parameters_of(known))

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component by one of `PROMPTS`."""
        return PROMPTS[name](component, now)

    def view(self, component: Component) -> tuple[str, object] | None:
        """Return the trajectory that a Control follows."""
        return view(component)
