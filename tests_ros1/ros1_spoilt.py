"""RAMP's components with faults planted: some are silent or break, others keep their order and say what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from parcours.run.hosts.ros1.packing import Ros1NodeProgram
from parcours.run.port import Component, Step
from parcours_ramp.components.node_program import ComponentNodeProgram
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.planner.messages import (
    PATH,
    POSE,
    EvaluationResponse,
    ModificationRequest,
    ModificationResponse,
    StateReport,
    TrajectoryResponse,
    many,
    one,
)

Change = Callable[[Any, object], Any]
"""(a step, the message that was handed over) -> the step, changed."""


def _silent(step: Any, message: object) -> Any:
    return step._replace(sends=())


def _breaking(step: Any, message: object) -> Any:
    if step.sends:
        raise ValueError("no operator \\ \"fits\" <&> 'here'")
    return step


def _lying(step: Any, message: object) -> Any:
    return step._replace(sends=tuple((channel, _lie(payload, message)) for channel, payload in step.sends))


def _lie(payload: object, message: object) -> object:
    match payload:
        case EvaluationResponse():
            return payload._replace(fitness=payload.fitness + 9.0)
        case TrajectoryResponse():
            short = payload.trajectories.copy()
            short["n"] = 5
            return payload._replace(trajectories=short)
        case ModificationResponse() if isinstance(message, ModificationRequest):
            same = many(PATH, 1)
            same[0] = message.modification.first
            return payload._replace(paths=same)
        case StateReport():
            return payload._replace(pose=one(POSE))
    return payload


class _Spoilt:
    """A component whose steps are changed."""

    def __init__(self, sound: Component, change: Change) -> None:
        self._sound, self._change = sound, change

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sound, name)

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Do what the sound one does, but for the fault."""
        return (self._change(step, message) for step in self._sound.handle(channel, message, now))


class _SpoiltControl:
    """A node_program of a Control that always reports the same pose, and shows another trajectory than it was sent."""

    def __init__(self, sound: ComponentNodeProgram) -> None:
        self._sound = sound
        self.instance, self.encode, self.decode = sound.instance, sound.encode, sound.decode

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Do what the sound one does, but for the fault."""
        return (_lying(step, None) for step in self._sound.prompt(name, component, now))

    def view(self, component: Component) -> tuple[str, object] | None:
        """Show a trajectory elsewhere."""
        shown: Any = self._sound.view(component)
        shown[1]["pieces"]["x"] += 1.0
        return shown  # type: ignore[no-any-return]


class _SpoiltNodeProgram(ComponentNodeProgram):
    def __init__(self, component: str, change: Change) -> None:
        super().__init__(component)
        self._change = change

    def instance(self, case: bytes) -> Component:
        """Return a component with the fault."""
        return _Spoilt(super().instance(case), self._change)


def deviating(component: str) -> Ros1NodeProgram:
    """Return a node_program of one of RAMP's components: TrajectoryGenerator is silent, PathModification breaks."""
    faults: dict[str, Change] = {"TrajectoryGenerator": _silent, "PathModification": _breaking}
    sound = component not in faults
    node_program = ComponentNodeProgram(component) if sound else _SpoiltNodeProgram(component, faults[component])
    return Ros1NodeProgram(node_program, CODEC)


def lying(component: str) -> Ros1NodeProgram:
    """Return a node_program of one of RAMP's components; most tell what Table VIII does not expect."""
    if component == "Control":
        return Ros1NodeProgram(_SpoiltControl(ComponentNodeProgram(component)), CODEC)
    sound = component in ("Planner", "Sensing")
    return Ros1NodeProgram(ComponentNodeProgram(component) if sound else _SpoiltNodeProgram(component, _lying), CODEC)
