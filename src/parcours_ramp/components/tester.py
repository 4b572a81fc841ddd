"""The tester of RAMP's components: a case -> what it supplies, and how it moves idle components on.

The same tester drives components of this process and those of nodes, so it names what it does to them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from parcours.abtc import Event
from parcours.elementary import sin_cos
from parcours.kernels import Record
from parcours.run.port import Component, Step
from parcours.suite import Case
from parcours_ramp.components.components import PROMPT_OF, PROMPTS, component_of, parameters_of, robot_of
from parcours_ramp.components.supplying import Supply
from parcours_ramp.planner.messages import Report
from parcours_ramp.planner.parameters import Parameters


class ComponentTester:
    """Everything one component case needs from outside.

    Args:
        case: values motion [m/s], path [knots], trajectory [m], population [members], odometry [m].
        parameters: of RAMP, guarded by default; the population is the case's.
    """

    def __init__(self, case: Case, parameters: Parameters | None = None) -> None:
        self._case = case
        self._parameters = parameters_of(case, parameters)
        self._begin = robot_of(case, self._parameters)

    def component(self, name: str) -> Component:
        """Return a fresh component of that name."""
        return component_of(name, self._case, self._parameters)

    def supply(self, event: Event) -> object:
        """Return the message the environment gives to a receiving event."""
        assert event.receives is not None
        return self._supply(event).message(event.receives.channel)

    def case(self) -> bytes:
        """Return the case as `ComponentNodeProgram` knows it."""
        return msgspec.json.encode(self._case)

    def prompt(self, event: Event) -> str:
        """Return the name of what moves an idle component to a transition that no message starts."""
        return PROMPT_OF.get(event.transition, "poll")

    def given(self, event: Event) -> tuple[str, object] | None:
        """Return the message that does: p17 and p19 follow the last answers, which Table II leaves out."""
        if event.transition == "p17":
            return "trajectory_response", self._supply(event).message("trajectory_response")
        return ("evaluation_response", self._supply(event).last_evaluation()) if event.transition == "p19" else None

    def settling(self, event: Event) -> Sequence[tuple[str, object]]:
        """Return what sets the model's input variables: the robot's pose, imminent collision before p43 and p44."""
        if event.component != "Control":
            return ()
        pose: tuple[str, object] = ("pose", Report(0, self._pose(event.reference)))
        imminent: tuple[str, object] = ("imminent_collision", event.transition == "p43")
        return (pose, imminent) if event.transition in ("p43", "p44") else (pose,)

    def move(self, event: Event, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component of this process."""
        given = self.given(event)
        return component.handle(*given, now) if given else PROMPTS[self.prompt(event)](component, now)

    def prepare(self, event: Event, component: Component) -> None:
        """Set the input variables of a component of this process."""
        for channel, payload in self.settling(event):
            for _ in component.handle(channel, payload, 0):
                pass

    def _supply(self, event: Event) -> Supply:
        return Supply(self._case, self._parameters, self._begin, event)

    def _pose(self, reference: int) -> Record:
        """Return where the robot is for a reference: it has moved on since the one before."""
        pose = self._begin.copy()
        s, c = sin_cos(pose.heading)
        way = reference * (0.01 + 0.1 * pose.v)
        pose.x, pose.y = way * c, way * s
        return pose
