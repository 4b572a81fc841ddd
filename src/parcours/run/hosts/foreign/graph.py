"""What the tester needs of a ROS graph, whatever its generation: ends of topics and services, parameters, life.

Messages are bytes here. `hosts.ros1.foreign_graph` and `hosts.ros2.foreign_graph` are the two implementations.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Mapping
from typing import Any, Protocol

from parcours.run.binding import Binding, MessageTypes, RegisteredGraph
from parcours.run.binding.in_transit import Answered
from parcours.run.binding.slots import ProcessSlot
from parcours.run.binding.structure import Value
from parcours.run.hosts.graph_line import Reply
from parcours.run.recording import Raw


class TesterEnd(Protocol):
    """The tester's end of a topic."""

    @property
    def peers(self) -> Collection[str]:
        """The full names of the nodes at the other end to which it is connected."""


class TesterPublisher(TesterEnd, Protocol):
    """The end that publishes."""

    def send(self, data: bytes) -> int:
        """Publish; return to how many listeners the message was lost."""


class TesterClient(Protocol):
    """The end of a service that calls."""

    @property
    def is_matched(self) -> bool:
        """Whether the server is there."""

    def ask(self, data: bytes, answered: Answered) -> None:
        """Call; `answered` gets the response, or None and why there is none."""

    def abandon(self, answered: Answered) -> None:
        """Wait no longer for a response."""


class ForeignGraph(Protocol):
    """The tester on a graph. Types are written `package/Type`, names of nodes, topics and services are global.

    On ROS 2 they may have a domain (`binding.domains`).

    Attributes:
        binding: as it is on this graph.
        label: `ros1` or `ros2`.
        environment: what a node needs in its environment to be on this graph.
        types: of its messages.
        refusals: connections that were declined, or could not be made, and why.
        ending: how long a node may take to leave the graph in order when a case of its own is over [s].
    """

    binding: Binding
    label: str
    environment: Mapping[str, str]
    types: MessageTypes
    refusals: list[str]
    ending: float

    def renew(self) -> None:
        """Begin a run: nothing of an earlier one is heard, and latched messages are dropped."""

    # Topics and services. The same end is returned if it is there already.

    def publish(self, topic: str, type_: str, *, queue: int, latch: bool, like: str = "") -> TesterPublisher | None:
        """Publish a topic in the quality of the publishers of `like`, if any; None while the type is unknown."""

    def subscribe(self, topic: str, type_: str, heard: Callable[[bytes], None]) -> TesterEnd:
        """Call `heard` with each message of a topic."""

    def serve(self, service: str, type_: str, asked: Callable[[bytes, Reply], None]) -> None:
        """Call `asked` with each request. Raises HostFailure if the type is unknown."""

    def call(self, service: str, type_: str) -> TesterClient:
        """Return what calls a service. Raises HostFailure if the type is unknown."""

    def leave(self, topic: str) -> None:
        """Publish a topic no longer."""

    def knows_service(self, type_: str) -> bool:
        """Return whether a service's type is known."""

    # The thread that waits.

    def spin(self, until: int) -> bool:
        """Hear what arrives before the monotonic clock shows `until` [ns]; return whether anything happened."""

    def watch(self, descriptor: int, ready: Callable[[], None]) -> None:
        """Call `ready`, in the thread that spins, whenever the descriptor can be read."""

    def unwatch(self, descriptor: int) -> None:
        """Watch it no longer."""

    # Who is there.

    def state(self, services: Collection[str] = ()) -> RegisteredGraph:
        """Return who is there without the tester; types of these services, too."""

    def require_alone(self) -> None:
        """Raise HostFailure if somebody is there already."""

    def answers(self, node: str) -> bool:
        """Return whether a node is on the graph, and lives as far as can be told; callable from any thread."""

    def forget(self, node: str) -> None:
        """Remove what a node that was killed has left on the graph."""

    # Parameters.

    def declare(self, values: Mapping[str, Value]) -> None:
        """Set parameters before any node starts."""

    def arguments(self, slot: ProcessSlot) -> tuple[str, ...]:
        """Return what is appended to the command of a slot's node."""

    def parameter(self, key: str) -> Any:
        """Return the value of a parameter; None if it is not set."""

    def set_parameter(self, key: str, value: Value) -> None:
        """Set a parameter. Raises HostFailure if that is refused."""

    def lead(self, node: str, state: str) -> bool:
        """Lead a lifecycle node towards a state; return whether it is in it. Raises HostFailure if it refuses."""

    # Recordings.

    def kind(self, type_: str) -> Raw | None:
        """Return an empty message of a type, as recordings name it; None if the type is unknown."""

    def close(self) -> None:
        """Leave the graph. Again: do nothing."""


def open_graph(binding: Binding, master: str = "") -> ForeignGraph:
    """Return the graph of a binding's transport, entered.

    Args:
        binding: whose transport, types and parameters.
        master: of a ROS 1 master that runs; the binding's, if empty; one of the tester's own, if that is empty, too.

    Raises:
        HostFailure: there is no such ROS, no master answers, or the domain is in use.
        BadRequest: a file of message definitions cannot be read.
    """
    if binding.transport == "ros2":
        from parcours.run.hosts.ros2.foreign_graph import Ros2Graph

        return Ros2Graph(binding)
    from parcours.run.hosts.ros1.foreign_graph import Ros1Graph

    return Ros1Graph(binding, master or binding.master)


def types_of(binding: Binding, learned: Collection[Raw] = ()) -> MessageTypes:
    """Return what is known of the message types of a binding's transport, without a graph.

    Args:
        binding: whose transport, folders of packages and definitions.
        learned: recorded messages that tell their types.

    Raises:
        HostFailure: there is no such ROS.
        BadRequest: a file of message definitions cannot be read.
    """
    if binding.transport == "ros2":
        from parcours.run.hosts.ros2.foreign_types import Ros2Types

        return Ros2Types(binding).types
    from parcours.run.hosts.ros1.endpoints import Kind
    from parcours.run.hosts.ros1.foreign_types import ForeignTypes

    found = ForeignTypes(binding.python_paths, binding.interfaces)
    for raw in learned:
        found.learn(Kind(raw.type, raw.md5, raw.definition))
    return MessageTypes(found.find)


def installed_type(name: str, kind: str) -> Any:
    """Return the class of an installed type of a kind (msg, srv, action), or None."""
    package, _, base = name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), base, None)
    except ImportError:
        return None
