"""A foreign navigation stack as a planner: told of its world on standard topics, driving by what it publishes.

The world is that of every planner (`parcours_navigation.stage`). The nodes are started once, and serve many cases. In
simulated time nobody waits for a clock: an observation is a step of /clock, which ends when all nodes are quiet.

    observe(t):  /clock to just before t -> odometry, scan, ... -> /clock to t, where timers are due -> last command
"""

from __future__ import annotations

import atexit
import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.binding import read_binding
from parcours.run.binding.structure import Binding, BoundChannel
from parcours.run.binding.worlds import body, odometry
from parcours.run.hosts.scheduling import real_time
from parcours.study.loading import SourceFile
from parcours_navigation.foreign.stack_nodes import StackNodes, Values
from parcours_navigation.protocol import Answer, Command, Observation, Task, Velocity

_SENSES = {"scan.": "scan", "map.": "map", "waypoint.": "path"}
"""How names begin that a world gives only if it has such a sense."""


def read_stack(path: Path | str) -> Binding:
    """Return the binding of a navigation stack. Raises BadRequest if it is wrong, or has no section `stack`."""
    binding = read_binding(path)
    if binding.stack is None:
        rule = "a binding that is driven as a planner needs a section 'stack', but has none"
        raise BadRequest(str(path), rule, "see docs/ros2.md, or run it by a study of kind ros", slug="binding-stack")
    return binding


def source_of_stack(path: Path | str) -> SourceFile:
    """Return what the results of a stack depend on: its binding, and the files that it names."""
    binding = read_stack(path)
    files = [Path(path).absolute(), *binding.files]
    return SourceFile(files[0], b"\0".join(file.read_bytes() for file in files))


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
        with self._at_work() as nodes:
            nodes.begin()

    @contextlib.contextmanager
    def _at_work(self) -> Iterator[StackNodes]:
        """Give the nodes, which are started first if need be; they are ended if one is lost meanwhile."""
        try:
            nodes = running(self._path)
            with real_time():  # a tester that gives way to who answers asks its next question late
                yield nodes
        except HostFailure:
            end(self._path)
            raise

    def observe(self, observation: Observation) -> Answer:
        """Return the last command of the nodes, once they have seen what is to be seen.

        Raises HostFailure if a node has died, or does not come to rest.
        """
        with self._at_work() as nodes:
            command = self._driven(nodes, observation)
        if command is None:
            return None
        ahead, aside, turn = command
        return Velocity(ahead, aside, turn) if observation.task.robot.kind == "holonomic" else Command(ahead, turn)

    def _driven(self, nodes: StackNodes, observation: Observation) -> tuple[float, float, float] | None:
        task, now = observation.task, round(observation.time * 1e9)
        due = now + round(task.period * 1e9)
        nodes.await_time(now, due)
        goal = (*task.goal, task.goal_heading or 0.0)
        values = self._values(observation, nodes.stamp())
        for channel in (*nodes.continual, *(nodes.once if goal != self._told else ())):  # where it is, then where to go
            nodes.tell(channel.name, values, _items(channel, observation))
        self._told = goal
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
