"""A foreign navigation stack as a planner: told of its world on standard topics, driving by what it publishes.

The world is that of every planner (`parcours_navigation.stage`). The nodes are started once, and serve many cases. In
simulated time nobody waits for a clock: an observation is a step of /clock, which ends when all nodes are quiet.

    observe(t):  /clock to just before t -> odometry, scan, ... -> /clock to t, where timers are due -> last command
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.binding import Compiled, read_binding
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.slots import whole
from parcours.run.binding.structure import Binding, BoundChannel, Stack
from parcours.run.binding.worlds import body, odometry
from parcours.run.recording import Raw
from parcours.run.trace import TraceEvent
from parcours.study.loading import Source
from parcours_navigation.protocol import Answer, Command, Observation, Task, Velocity

if TYPE_CHECKING:
    from parcours.run.hosts.foreign.session import Session
    from parcours.run.hosts.ros2.stepping import SteppedClock

Values = dict[str, object]

_FOLDER = "parcours-stack-"

_BEFORE = 1_000_000
"""How long before timers are due the sensors speak [ns]."""

_PATIENCE = 2.0
"""How long nodes whose topics are there may take to be found on /clock [s]."""

_SENSES = {"scan.": "scan", "map.": "map", "waypoint.": "path"}
"""How names begin that a world gives only if it has such a sense."""


def read_stack(path: Path | str) -> Binding:
    """Return the binding of a navigation stack. Raises BadRequest if it is wrong, or has no section `stack`."""
    binding = read_binding(path)
    if binding.stack is None:
        rule = "a binding that is driven as a planner needs a section 'stack', but has none"
        raise BadRequest(str(path), rule, "see docs/ros2.md, or run it by a study of kind ros", slug="binding-stack")
    return binding


def source_of_stack(path: Path | str) -> Source:
    """Return what the results of a stack depend on: its binding, and the files that it names."""
    binding = read_stack(path)
    files = [Path(path).absolute(), *binding.files]
    return Source(files[0], b"\0".join(file.read_bytes() for file in files))


_RUNNING: dict[str, StackNodes | ParcoursError] = {}
"""The nodes of this process by the file of their binding, or why they cannot be had."""


def running(path: str) -> StackNodes:
    """Return the nodes of a stack in this process, started once: they serve all its planners, one case after the other.

    Raises as `StackNodes`, the same each time.
    """
    if path not in _RUNNING:
        try:
            _RUNNING[path] = StackNodes(read_stack(path))
            atexit.register(end, path)
        except ParcoursError as error:
            _RUNNING[path] = error
    found = _RUNNING[path]
    if isinstance(found, ParcoursError):
        raise found
    return found


def end(path: str) -> None:
    """End the nodes of a stack, if they run: they are started again when they are needed."""
    found = _RUNNING.pop(path, None)
    if isinstance(found, StackNodes):
        found.close()


class StackPlanner:
    """The nodes of a binding as a planner; they are started with the first one, and again when one has died.

    Args:
        path: of a binding with a section `stack`.

    Attributes:
        needs: what its binding tells it of.

    Raises:
        BadRequest: the binding is wrong, or does not fit the nodes.
        HostFailure: the nodes cannot be had here.
    """

    def __init__(self, path: Path | str) -> None:
        self._path = str(Path(path).absolute())
        self._binding = read_stack(path)
        self.needs = senses_of(self._binding)
        self._told: tuple[float, ...] = ()
        self._start: dict[str, float] = {}
        running(self._path)

    def reset(self, task: Task) -> None:
        """Begin a case: nothing of the last one is left but what the nodes remember of their own.

        Raises:
            HostFailure: the nodes cannot be had here, or one has died.
            BadRequest: the binding does not fit them.
        """
        self._told = ()
        with self._ended_if_lost():
            running(self._path).begin()

    @contextlib.contextmanager
    def _ended_if_lost(self) -> Iterator[None]:
        try:
            yield
        except HostFailure:
            end(self._path)
            raise

    def observe(self, observation: Observation) -> Answer:
        """Return the last command of the nodes, once they have seen what is to be seen.

        Raises HostFailure if a node has died, or does not come to rest.
        """
        with self._ended_if_lost():
            command = self._driven(running(self._path), observation)
        if command is None:
            return None
        ahead, aside, turn = command
        return Velocity(ahead, aside, turn) if observation.task.robot.kind == "holonomic" else Command(ahead, turn)

    def _driven(self, nodes: StackNodes, observation: Observation) -> tuple[float, float, float] | None:
        task, now = observation.task, round(observation.time * 1e9)
        due = now + round(task.period * 1e9)
        nodes.await_time(now, due)
        goal = (*task.goal, task.goal_heading or 0.0)
        every = nodes.channels if goal != self._told else nodes.continual
        self._told = goal
        values = self._values(observation, nodes.stamp())
        for channel in sorted(every, key=lambda one: one.latch):  # where it is, then where to go
            nodes.tell(channel.name, values, _items(channel, observation))
        nodes.pass_on(due)
        return nodes.command()

    def _values(self, observation: Observation, stamp: float) -> Values:
        task = observation.task
        x, y, heading, v, w = observation.robot.tolist()
        if not observation.time:
            self._start = {"start.x": x, "start.y": y, "start.heading": heading}
        values: Values = {
            **dict(self._binding.constants), **body("robot", x, y, heading, v, w, task.robot_radius),
            **odometry(self._start, x, y, heading), **self._start,
            "goal.x": task.goal[0], "goal.y": task.goal[1], "goal.heading": task.goal_heading or 0.0,
            "tolerance": task.goal_tolerance, "obstacles": len(observation.obstacles), "time": observation.time,
            "wall_time": time.time(), "stamp": stamp,
        }  # fmt: skip
        scan, ground = observation.scan, observation.map
        if scan is not None:
            last = scan.first + scan.step * (len(scan.ranges) - 1)
            values |= {"scan.ranges": scan.ranges.tolist(), "scan.first": scan.first, "scan.last": last,
                       "scan.step": scan.step, "scan.reach": scan.reach}  # fmt: skip
        if ground is not None:
            rows, columns = ground.cells.shape
            values |= {"map.cells": ground.cells.astype(np.int8).ravel().tolist(), "map.rows": rows,
                       "map.columns": columns, "map.resolution": ground.resolution, "map.x": ground.origin[0],
                       "map.y": ground.origin[1]}  # fmt: skip
        return values


def check_stack(binding: Binding) -> None:
    """Start the nodes of a stack once, in this network, and see that they have what is bound, and follow its clock.

    Raises as `StackNodes`.
    """
    assert binding.stack is not None
    nodes = StackNodes(replace(binding, stack=replace(binding.stack, own=False)))
    try:
        nodes.begin()
    finally:
        nodes.close()


def _folder() -> Path:
    """Return this process's folder for the output of nodes. Workers are killed when they are done: others clean up."""
    here = Path(tempfile.gettempdir())
    for old in here.glob(f"{_FOLDER}*"):
        if not Path("/proc", old.name.removeprefix(_FOLDER)).exists():
            shutil.rmtree(old, ignore_errors=True)
    return here / f"{_FOLDER}{os.getpid()}"


def senses_of(binding: Binding) -> tuple[str, ...]:
    """Return which senses a binding tells its nodes of, some of `protocol.SENSES`."""
    names = [
        str(place)
        for channel in binding.channels if channel.inject is not None
        for _, formula in channel.inject.set
        for place in formula.places
    ]  # fmt: skip
    return tuple(sense for prefix, sense in _SENSES.items() if any(name.startswith(prefix) for name in names))


def _items(channel: BoundChannel, observation: Observation) -> list[Values]:
    """Return what stands for `[*]` on a channel: the points of the path, or the obstacles that are seen."""
    said = () if channel.inject is None else channel.inject.set
    if any(str(place).startswith("waypoint.") for _, formula in said for place in formula.places):
        points: Any = () if observation.path is None else observation.path.tolist()
        return [{"waypoint.x": x, "waypoint.y": y} for x, y in points]
    if not any(place.is_each for place, _ in said):
        return []
    rows = observation.obstacles.tolist()
    return [{**body("obstacle", *row), "obstacle.index": k} for k, row in enumerate(rows)]


class StackNodes:
    """The nodes of a stack, running, and the tester beside them.

    Args:
        binding: of the stack.

    Raises:
        HostFailure: the nodes cannot be had here: no ROS 2, no network, something absent or of another type.
        BadRequest: the binding does not fit the message types.
    """

    def __init__(self, binding: Binding) -> None:
        from parcours.run.hosts.foreign.host import ForeignHost
        from parcours.run.hosts.foreign.session import Session

        assert binding.stack is not None
        self._stack: Stack = binding.stack
        self.channels = [one for one in binding.channels if one.role == "provide"]
        self.continual = [one for one in self.channels if not one.latch]
        self._closing = contextlib.ExitStack()
        self._last: bytes | None = None
        self._clock: SteppedClock | None = None
        self._began = 0
        try:
            if self._stack.own:
                from parcours.run.hosts.isolation import enter_own_network

                enter_own_network()
            host = self._closing.enter_context(ForeignHost(binding, _folder()))
            self._session: Session = Session(host, whole(binding), listener=self._hear)
            self._closing.callback(self._session.end)
            self._session.start()
            self._compiled: Compiled = host.compile()
            self._decoder = Decoder(binding, self._compiled.types)
            self._make_clock()
        except BaseException:
            self._closing.close()
            raise

    def _make_clock(self) -> None:
        from parcours_navigation.foreign.tester_messages import Maker

        self._maker = Maker(self._compiled)
        if not self._stack.simulated:
            return
        from parcours.run.hosts.ros2.stepping import SteppedClock

        graph: Any = self._session.host.graph
        nodes = [slot.ros_node for slot in self._session.slot_plan.slots]
        self._clock = SteppedClock(
            graph.participant, nodes, step=round(self._stack.step * 1e9), hops=self._stack.hops,
            quiet=round(self._stack.quiet * 1e9), discovery=_PATIENCE, look=self._look,
        )  # fmt: skip

    def _hear(self, event: TraceEvent) -> None:
        if event.kind == "receive" and event.channel == self._stack.command and isinstance(event.payload, Raw):
            self._last = event.payload.content
            if self._clock is not None:
                self._clock.stirred()

    def _look(self) -> None:
        """See whether all nodes live. Raises HostFailure if one does not."""
        self._session.poll(self._session.now())
        for name, how in self._session.deaths.items():
            raise HostFailure(f"node {name}", f"must live, but {how}", "look into its output", slug="foreign-dead")

    @property
    def processes(self) -> list[int]:
        """The ids of the processes that were started."""
        return [process.pid for _, process in self._session.host.running.values()]

    def begin(self) -> None:
        """Begin a case: time starts again, the binding's steps are done, and what was said before is forgotten."""
        from parcours_navigation.foreign.setup_steps import act

        self._look()
        if self._clock is not None:
            self._clock.begin()
        act(self._session, "before_case")
        if self._clock is not None:
            self._clock.settle()
        self._session.relay.events.clear()
        self._last, self._began = None, time.perf_counter_ns()

    def await_time(self, now: int, due: int) -> None:
        """Let time pass to just before timers are due at the end of a period [ns since the case began]."""
        if self._clock is not None:
            self._clock.advance(due - _BEFORE)
            return
        while (left := self._began + now - time.perf_counter_ns()) > 0:
            self._session.poll(self._session.now() + left)
            self._look()

    def stamp(self) -> float:
        """Return what the nodes' clock shows [s]."""
        return time.time() if self._clock is None else self._clock.instant * 1e-9

    def tell(self, channel: str, values: Mapping[str, object], items: Sequence[Mapping[str, object]]) -> None:
        """Publish a message on a channel, and let the nodes work on it: what comes next finds it done."""
        self._session.relay.inject(channel, self._maker.message(channel, values, items))
        if self._clock is not None:
            self._clock.settle()

    def pass_on(self, due: int) -> None:
        """Let the timers of the nodes fire that are due at `due` [ns]."""
        if self._clock is None:
            self._look()
        else:
            self._clock.advance(due)

    def command(self) -> tuple[float, float, float] | None:
        """Return the last command of the case: speed ahead and to the left [m/s], yaw rate [rad/s]; None before.

        Raises HostFailure if it cannot be read.
        """
        self._session.relay.events.clear()
        if self._last is None:
            return None
        channel = self._stack.command
        message = self._decoder.message(channel, self._last)
        twist = message.twist if channel == "command_stamped" else message
        return twist.linear.x, twist.linear.y, twist.angular.z

    def close(self) -> None:
        """End the nodes."""
        self._closing.close()
