"""The tester of RAMP's components: a case -> what it supplies, and how it moves idle components on.

The same tester drives components of this process and those of nodes, so it names what it does to them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import msgspec

from parcours.abtc import Event, Visits
from parcours.elementary import sin_cos
from parcours.kernels import Record
from parcours.run.port import Component, Send, Step
from parcours.suite import Case
from parcours_ramp.components.components import LATER, PROMPT_OF, PROMPTS, component_of, parameters_of, robot_of
from parcours_ramp.components.environment_messages import FIRST, Supply
from parcours_ramp.planner.messages import StateReport


class ComponentTester:
    """Everything one component case needs from outside.

    Args:
        case: values motion [m/s], path [knots], trajectory [m], population [members], odometry [m].
        parameters: of RAMP, guarded by default; the population is the case's.
        visits: the events of the case where an instance has several conversations, and what comes beside them.
    """

    def __init__(self, case: Case, visits: Visits | None = None) -> None:
        events = visits.events if visits is not None else ()
        self._again = visits.again if visits is not None else {}
        self._case = case
        self._parameters = parameters_of(case)
        self._begin = robot_of(case, self._parameters)
        self._serials: dict[int, int] = {}  # event -> the number of its planner's sensing conversation
        self._controls: dict[int, int] = {}  # event -> the number of the control conversation that has to end before it
        self._plans: dict[int, int] = {}  # ... of the planning conversation
        opened: Counter[int] = Counter()
        asked: dict[int, int] = {}
        plans: dict[int, int] = {}
        controls: dict[int, int] = {}
        for event in events:
            planner, opens = event.reference, event.transition in ("p11", "p12", "p15")
            opened[planner] += opens
            if event.transition == "p11":
                plans[planner] = FIRST - 1 + opened[planner]
            elif event.transition == "p12" and planner in plans:
                self._plans[event.position] = plans.pop(planner)
            if event.transition == "p12":
                controls[planner] = FIRST - 1 + opened[planner]
            elif event.transition == "p15":
                asked[planner] = FIRST - 1 + opened[planner]
                if planner in controls:
                    self._controls[event.position] = controls.pop(planner)
            self._serials[event.position] = asked.get(planner, FIRST)
        reports = [event for event in events if event.transition == "p48"]
        self._later = {two.position for one, two in pairwise(reports) if one.reference == two.reference}

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
        return LATER if event.position in self._later else PROMPT_OF.get(event.transition, "poll")

    def given(self, event: Event) -> tuple[str, object] | None:
        """Return the message that does: p17 and p19 follow the last answers, which Table II leaves out."""
        if event.transition == "p17":
            return "trajectory_response", self._supply(event).message("trajectory_response")
        return ("evaluation_response", self._supply(event).last_evaluation()) if event.transition == "p19" else None

    def settling(self, event: Event) -> Sequence[Send]:
        """Return the messages beside, for a node."""
        return self.beside(event)

    def beside(self, event: Event) -> Sequence[Send]:
        """Return what sets the model's input variables: the robot's pose and limit, imminent collision.

        A planner is told where the robot is, also while it talks with a service; it ends its planning cycle before a
        control cycle, and that before the next sensing cycle, by answers which Table II leaves out; an answer to an
        earlier request, which it has to ignore, comes again before the one it waits for.
        """
        supply = self._supply(event)
        if event.position in self._plans:
            return (supply.update(), *supply.planning_answers(self._plans[event.position]))
        if event.position in self._controls:
            return (*supply.control_answers(self._controls[event.position]), supply.update())
        if event.transition == "p15" and event.position not in self._again:
            return (supply.update(),)
        if event.position in self._again and event.receives is not None:  # the answer to an earlier request, once more
            stray = replace(event, position=self._again[event.position])
            again = event.receives.channel, self._supply(stray).message(event.receives.channel)
            return (again, supply.update()) if event.transition in ("p16", "p18") else (again,)
        if event.transition in ("p16", "p18"):  # it waits until the conversation is over
            return (supply.update(),)
        if event.component != "Control":
            return ()
        pose: Send = ("pose", StateReport(0, supply.beside(self._pose(max(event.reference, event.visit)))))
        if event.transition in ("p43", "p44"):
            return pose, ("imminent_collision", event.transition == "p43")
        return (pose, ("speed_limit", supply.limit())) if event.transition == "p46" else (pose,)

    def move(self, event: Event, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component of this process."""
        given = self.given(event)
        return component.handle(*given, now) if given else PROMPTS[self.prompt(event)](component, now)

    def prepare(self, event: Event, component: Component) -> None:
        """Do nothing: messages set what the model calls input variables."""

    def _supply(self, event: Event) -> Supply:
        serial = self._serials.get(event.position, FIRST)
        return Supply(self._case, self._parameters, self._begin, event, serial)

    def _pose(self, reference: int) -> Record:
        """Return where the robot is for a reference: it has moved on since the one before."""
        pose = self._begin.copy()
        s, c = sin_cos(pose.heading)
        way = reference * (0.01 + 0.1 * pose.v)
        pose.x, pose.y = way * c, way * s
        return pose
