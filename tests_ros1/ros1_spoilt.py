"""RAMP's components with faults planted: one is silent, one breaks, one says what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from parcours.planners.ramp.messages import EvaluationResponse
from parcours.run.hosts.ros1.packing import Ros1Resident
from parcours.run.port import Component, Step
from parcours.studies.ramp_components.resident import ComponentResident
from parcours.studies.ramp_components.ros1 import CODEC


class _Spoilt:
    """A component whose steps are changed."""

    def __init__(self, sound: Component) -> None:
        self._sound = sound
        self.name = sound.name

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sound, name)

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Do what the sound one does, but for the fault."""
        for step in self._sound.handle(channel, message, now):
            yield self._changed(step)

    def _changed(self, step: Any) -> Step:
        if self.name == "TrajectoryGenerator" and step.sends:
            return step._replace(sends=())  # type: ignore[no-any-return]
        if self.name == "PathModification" and step.sends:
            raise ValueError("no operator \\ \"fits\" <&> 'here'")
        if self.name == "TrajectoryEvaluation":
            sends = tuple((channel, _praised(payload)) for channel, payload in step.sends)
            return step._replace(sends=sends)  # type: ignore[no-any-return]
        return step  # type: ignore[no-any-return]


def _praised(payload: object) -> object:
    return payload._replace(fitness=payload.fitness + 9.0) if isinstance(payload, EvaluationResponse) else payload


class _SpoiltResident(ComponentResident):
    def instance(self, case: bytes) -> Component:
        return _Spoilt(super().instance(case))


def resident(component: str) -> Ros1Resident:
    """Return the resident of one of RAMP's components with a fault, if there is one for it."""
    sound = component in ("Planner", "Control", "Sensing")
    return Ros1Resident((ComponentResident if sound else _SpoiltResident)(component), CODEC)
