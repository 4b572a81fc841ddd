"""Keeps RAMP's nodes on the graph of a ROS 1 master, for one tester after the other.

A host starts its own nodes and ends them. These stand by themselves: as soon as a tester is on the graph they join it,
and when it leaves they start again and wait for the next.
"""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from parcours.errors import HostFailure
from parcours.run.hosts.interfaces import TESTER, command_topic, interfaces, node_name
from parcours.run.hosts.launching import Processes, ending
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros1.graph import ask, leave, require_free
from parcours.run.hosts.ros1.interfaces import package_routes, write_package
from parcours.run.hosts.ros1.master import require_master
from parcours.run.hosts.ros1.transport import NodePlan, frame_kind, ros1_line
from parcours.run.port import links
from parcours_ramp.components.model import component_model
from parcours_ramp.gtest.export import PACKAGE
from parcours_ramp.planner.wire import FORMS

NODE_PROGRAM = "parcours_ramp.components.ros1:node_program"  # What the nodes run if nothing else is named

_PRELOAD = ("parcours.run.hosts.ros1.transport", "parcours_ramp.components.ros1",
            "parcours_ramp.components.warm")  # fmt: skip
_LOOK = 0.1  # How often it is looked for a tester, and after the nodes [s]

Say = Callable[[str], None]


class StandingNodes:
    """The nodes of RAMP's components; as a context manager: they end, and leave the graph, at its end.

    Args:
        node_program: dotted name `module:callable` of what runs in the nodes; RAMP's own components if not given.

    Raises HostFailure: there is no ROS 1 or no master, or a name is taken on its graph.
    """

    def __init__(self, master: str, node_program: str = NODE_PROGRAM, say: Say = lambda text: None) -> None:
        require_master(master)
        self._master, self._say = master, say
        model = component_model()
        self._nodes = nodes_of(links(model), [one.name for one in model.components], node_program)
        require_free(master, [node_name(node.component) for node in self._nodes])
        with tempfile.TemporaryDirectory(prefix="parcours-ros1-") as folder:
            write_package(Path(folder), PACKAGE, interfaces(model), FORMS)
            self._plan = NodePlan(master, package_routes(Path(folder)), frame_kind())
        self._processes = Processes([*_PRELOAD, node_program.partition(":")[0]])
        self._running: set[str] = set()

    def __enter__(self) -> StandingNodes:
        # The server that nodes are forked from loads, and on its first day compiles, what they run.
        first = multiprocessing.get_context("forkserver").Process(target=int)
        first.start()
        first.join()
        return self

    def __exit__(self, *exception: object) -> None:
        for name in self._running:
            self._processes.signal(name, signal.SIGTERM)
        self._processes.stop()
        leave(self._master, [node_name(node.component) for node in self._nodes])

    def look(self) -> None:
        """Start nodes if a tester waits for them, and clear away those that have ended.

        Raises HostFailure: the master does not answer any more, or a node cannot be started.
        """
        for name in sorted(self._running):
            status = self._processes.status(name)
            if status is not None:
                self._running.discard(name)
                leave(self._master, [node_name(name)])
                self._say(f"{name} has left" if status == 0 else f"{name} has ended: {ending(status)}")
        missing = [node for node in self._nodes if node.component not in self._running]
        if missing and self._is_awaited():
            for node in missing:
                self._processes.start(node, ros1_line, self._plan)
                self._running.add(node.component)
            self._say(f"joined the tester: {', '.join(node.component for node in missing)}")

    def stay(self) -> None:
        """Look again and again, until interrupted."""
        while True:
            self.look()
            time.sleep(_LOOK)

    def _is_awaited(self) -> bool:
        """Whether a tester lives that has offered a command topic to every node, which it does last."""
        publishers, _, _ = ask(self._master, "getSystemState", TESTER)
        offered = {topic for topic, names in publishers if TESTER in names}
        if not all(command_topic(node.component) in offered for node in self._nodes):
            return False
        try:
            ask(ask(self._master, "lookupNode", TESTER, TESTER), "getPid", TESTER, within=1.0)
        except HostFailure:
            return False  # killed, and still registered
        return True
