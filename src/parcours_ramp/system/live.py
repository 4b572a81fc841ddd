"""One system case in real time: RAMP's components as nodes of a host, the world in the tester's own process.

The world moves by the clock of the machine; what the nodes do late, they do late. Facts come from the world and from
the messages that passed, as a tester of a foreign planner would see them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypedDict

import msgspec
import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours.run.faults import FaultPlan
from parcours.run.hosts.node_program import Codec, Transport
from parcours.run.hosts.realtime import DIED, RealTimeHost
from parcours.run.port import Component, Step
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.conformance import check
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.arena.observing import freeze_world
from parcours_navigation.arena.world import advance
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes
from parcours_ramp.components.model import OUTSIDE, component_model
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.planner.component_factory import component
from parcours_ramp.planner.control import COMMAND_PERIOD
from parcours_ramp.planner.messages import StateReport
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import WorldComponent, as_track, start_pose, system_links
from parcours_ramp.system.ramp_facts import FACTS
from parcours_ramp.system.study import SystemStudy, system_study

QUIESCENCE = dict.fromkeys(("trajectory_response", "evaluation_response", "modification_response"), 2_000_000_000)
"""How long a service that owes an answer may keep silent [ns]: it needs milliseconds, and a busy machine more."""

_STRETCH = 100_000_000  # How long the host runs on [ns] before it is asked whether the case has ended


class NodeTold(TypedDict):
    """What a node gets to know of its case."""

    schedule: str
    seed: int
    number: int


class SystemNodeProgram(RampCodec):
    """One of RAMP's components, for system cases."""

    def __init__(self, component_name: str) -> None:
        self._component = component_name

    def instance(self, case: bytes) -> Component:
        """Return a fresh component for the case."""
        told = msgspec.json.decode(case, type=NodeTold)
        study = system_study(told["schedule"], seed=told["seed"])
        setting = study.setting()
        goal = float(setting.goal_x), float(setting.goal_y)
        return component(self._component, study.parameters, told["seed"], told["number"], start_pose(study), goal)

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Poll; system cases prompt nobody."""
        return component.handle(None, None, now)

    def view(self, component: Component) -> tuple[str, object] | None:
        """Show nothing."""
        return None


class Observer:
    """Follows robot and obstacles whenever the world is about to go on, and sees the case end.

    Attributes:
        world: the component that it follows.
        ended: whether the goal is reached, or the time is over.
    """

    def __init__(self, study: SystemStudy, number: int) -> None:
        self._limit = int(study.setting().limit)
        self._number, self._next = number, 0
        self._entries: list[tuple[float, ...]] = []
        self._facts = np.zeros(1, FACTS)
        self.ended = False
        self.world = WorldComponent(study, number, self.look)

    def look(self, now: int) -> None:
        """See how things stand at `now` [ns]."""
        if self.ended:
            return
        world, obstacles = self.world.world, self.world.obstacles
        advance(world, obstacles, min(now, self._limit))
        if now >= self._next:
            self._next = now - now % COMMAND_PERIOD + COMMAND_PERIOD
            self._entries.append(self.world.seen(now, 0))
        if now >= self._limit or world["t_goal"] != NEVER:
            facts = self._facts.view(np.recarray)[0]
            freeze_world(world, obstacles, facts)
            self._facts[0] = facts
            self.ended = True

    def facts(self, trace: Trace) -> NDArray[np.void]:
        """Return the facts, array of FACTS of shape (1,), completed by what the messages say."""
        facts = self._facts.copy()
        facts["number"], facts["t_goal_after"], facts["t_last_moving"] = self._number, NEVER, NEVER
        halted, since, total = False, 0, 0
        for event in trace.events:
            if event.kind == "take":
                facts["n_planning_cycles"] += event.transition == "p11"
                facts["n_control_cycles"] += event.transition == "p12"
            if event.kind != "receive":
                continue
            if event.channel == "imminent_collision" and bool(event.payload) != halted:
                halted = not halted
                total += 0 if halted else event.time - since
                since = event.time
                facts["n_halts"] += halted
            elif event.channel == "best_trajectory":
                best: Record = event.payload
                facts["feasible"], facts["time_left"] = int(best["feasible"]), float(best["duration"])
        facts["halted"] = halted
        facts["halted_time"] = total + (int(facts["t_end"][0]) - since if halted else 0)
        return facts

    def track(self) -> tuple[NDArray[np.void], NDArray[np.float64]]:
        """Return the robot's track, array of TRACK of shape (n,), and the obstacles' places, (n, n_obstacles, 2)."""
        return as_track(self._entries)


@dataclass(frozen=True, slots=True)
class LiveRun:
    """What a case leaves behind that ran in real time."""

    facts: NDArray[np.void]  # array of FACTS, shape (1,)
    track: NDArray[np.void]  # array of TRACK, shape (n,)
    places: NDArray[np.float64]  # of the obstacles at the same times [m], shape (n, n_obstacles, 2)
    trace: Trace  # every message and transition
    deaths: dict[str, str]  # component -> how it ended, of those that did
    conformance: Judgement  # whether the components did what the model allows
    judgement: Judgement  # of the outcome, of that, and of all components' being alive


def run_live(
    study: SystemStudy, number: int, transport: Transport, codec: Codec | None = None, *,
    faults: FaultPlan | None = None, listener: Callable[[TraceEvent], None] | None = None,
) -> LiveRun:  # fmt: skip
    """Run one case of the study on the transport's nodes until the goal is reached or its time limit is over.

    Args:
        study: its latencies are not applied: they are whatever they are.
        transport: started, with a node for each of `COMPONENTS`; stays open, its nodes at rest.
        codec: of the transport's messages; MessagePack's if not given.

    Raises:
        BadRequest: a fault names what RAMP does not have.
        HostFailure: a node is gone before the case begins, or sends on a channel that is not its own.
    """
    observer = Observer(study, number)
    told: NodeTold = {"schedule": study.parameters.schedule, "seed": study.cases.seed, "number": number}
    host = RealTimeHost(
        transport, system_links(), codec or RampCodec(), case=msgspec.json.encode(told), local=(observer.world,),
        faults=faults, listener=listener,
    )  # fmt: skip
    until = 0
    while not observer.ended:
        until += _STRETCH
        host.run(until)
    host.rest()
    trace = host.trace(study.cases.id(number))
    return _run(study, observer, trace, host.deaths)


def rerun(study: SystemStudy, number: int, trace: Trace) -> LiveRun:
    """Return a run made again from its trace: the same world, driven by the commands that reached it when they did."""
    observer = Observer(study, number)
    deaths = {event.component: event.text.removeprefix(DIED) for event in trace.events
              if event.kind == "note" and event.text.startswith(DIED)}  # fmt: skip
    for event in trace.events:
        if event.kind == "send" and event.channel == "pose" and isinstance(event.payload, StateReport):
            for _ in observer.world.wake(event.payload.stamp):
                pass
        elif event.kind == "receive" and event.channel == "cmd_vel":
            for _ in observer.world.handle("cmd_vel", event.payload, event.time):
                pass
    return _run(study, observer, trace, deaths)


def _run(study: SystemStudy, observer: Observer, trace: Trace, deaths: dict[str, str]) -> LiveRun:
    facts = observer.facts(trace)
    model = component_model(study.parameters.schedule)
    conforms = check(trace, model, quiescence=QUIESCENCE, allowance=OUTSIDE, data=message_of).judgement
    return LiveRun(facts, *observer.track(), trace, deaths, conforms, judge_live(facts, deaths, conforms))


NOT_REACHED = "not reached"
"""The outcome of a case that ended before the goal was reached; what would have followed is not known."""


def outcome_of(facts: NDArray[np.void]) -> str:
    """Return what came of a case: its Outcome in words, or `NOT_REACHED`. `facts` is an array of FACTS, shape (1,)."""
    outcome = Outcome(int(outcomes(facts)[0]))
    known = (Outcome.COLLIDED, Outcome.REACHED, Outcome.BLOCKED)
    return outcome.name.lower() if outcome in known else NOT_REACHED


def judge_live(facts: NDArray[np.void], deaths: dict[str, str], conforms: Judgement) -> Judgement:
    """Return the verdict on a case.

    A system with a dead component fails, wherever its robot has coasted to; so does one that deviates from its model.
    """
    outcome, last = Outcome(int(outcomes(facts)[0])), facts[0]
    verdict, why = VERDICT_OF[outcome], explain(last)
    if outcome_of(facts) == NOT_REACHED:
        halted = ", halted for imminent collision" if last["halted"] else ""
        place = f"({last['x']:.2f}, {last['y']:.2f}) m, {last['to_goal']:.2f} m from it{halted}"
        verdict, why = (
            Verdict.FAIL,
            f"the goal was not reached within {last['t_end'] * 1e-9:g} s: the robot is at {place}",
        )
    if deaths:
        died = ", ".join(f"{name} ({how})" for name, how in deaths.items())
        return Judgement(Verdict.FAIL, f"dead at the end: {died}; {why}")
    if conforms.verdict is Verdict.FAIL:
        return Judgement(Verdict.FAIL, f"{conforms.why}; {why}")
    return Judgement(verdict, why)
