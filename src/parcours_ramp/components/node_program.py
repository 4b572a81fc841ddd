"""RAMP's components as programs of nodes: a component case, as the tester sends it, -> the component."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from parcours.run.port import Component, Step
from parcours.suite import Case
from parcours_ramp.components.components import PROMPTS, component_of, parameters_of, view
from parcours_ramp.planner.wire import FORMS, FormField, decode, encode, flatten, restore


class RampCodec:
    """RAMP's payloads <-> bytes, and <-> the fields of their flat forms."""

    encode, decode = staticmethod(encode), staticmethod(decode)
    flatten, restore = staticmethod(flatten), staticmethod(restore)

    def form(self, channel: str) -> Sequence[FormField] | None:
        """Return the fields of the channel's messages; None if RAMP has no such channel."""
        return FORMS.get(channel)


class ComponentNodeProgram(RampCodec):
    """One of RAMP's components, for component cases."""

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
