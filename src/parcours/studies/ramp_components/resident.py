"""RAMP's components as residents of nodes: a component case, as the tester sends it, -> the component."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from parcours.planners.ramp.wire import decode, encode
from parcours.run.port import Component, Step
from parcours.studies.ramp_components.components import PROMPTS, component_of, followed_by, parameters_of
from parcours.suite import Case


class RampCodec:
    """RAMP's payloads <-> bytes."""

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the payload's bytes."""
        return encode(channel, payload)

    def decode(self, channel: str, data: bytes) -> object:
        """Return the payload. Raises BadRequest, naming channel and field, if these bytes are none."""
        return decode(channel, data)


class ComponentResident(RampCodec):
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
        followed = followed_by(component)
        return None if followed is None else ("best_trajectory", followed)
