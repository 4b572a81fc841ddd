"""The tester on the graph of a foreign ROS 1 system (`hosts.foreign.graph`)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping
from typing import Any

from parcours.errors import HostFailure
from parcours.run.binding import Binding, MessageTypes, RegisteredGraph
from parcours.run.binding.slots import ProcessSlot
from parcours.run.binding.structure import Value
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.interfaces import TESTER
from parcours.run.hosts.ros1.client import Ros1Node
from parcours.run.hosts.ros1.endpoints import ANY, WITHIN, Kind, Ros1Client, Ros1Publisher, Subscriber, called
from parcours.run.hosts.ros1.foreign_types import ForeignTypes
from parcours.run.hosts.ros1.graph import LOOPBACK, ask, ask_all, leave
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.recording import Raw

_MASTER = 3.0
"""How long a master that runs already may take to answer [s]."""

_LANES = 64
"""How many calls of a foreign service may be open at once."""


def plain_value(value: Value) -> Any:
    """Return a value of the binding as XML-RPC knows it.

    >>> plain_value((("a", (1, 2)), ("b", ())))
    {'a': [1, 2], 'b': []}
    """
    if isinstance(value, tuple):
        if value and all(isinstance(one, tuple) and len(one) == 2 and isinstance(one[0], str) for one in value):
            return {str(one[0]): plain_value(one[1]) for one in value if isinstance(one, tuple)}
        return [plain_value(one) for one in value]
    return value


class Ros1Graph:
    """The tester's name on a master, its own or one that runs.

    Raises HostFailure if there is no ROS 1, or no master answers at the address within 3 s.
    """

    label = "ros1"
    ending = 0.2

    def __init__(self, binding: Binding, master: str = "") -> None:
        self.binding = binding
        self._known = ForeignTypes(binding.python_paths, binding.interfaces)
        self.types = MessageTypes(self._known.find)
        self.refusals: list[str] = []
        self._callers: dict[str, Ros1Client] = {}
        self._closing = contextlib.ExitStack()
        self.environment: Mapping[str, str]
        if master:
            require_master(master, _MASTER)
            self._uri = master
            self.environment = {"ROS_MASTER_URI": master, "ROS_IP": LOOPBACK, "ROS_HOSTNAME": LOOPBACK}
        else:
            own = self._closing.enter_context(Master())
            self._uri, self.environment = own.uri, own.environment
        try:
            self._client = Ros1Node(TESTER, self._uri, self._refused)
            self._closing.callback(self._client.close)
        except BaseException:
            self.close()
            raise
        self.spin, self.watch, self.unwatch = self._client.spin, self._client.watch, self._client.unwatch

    def _refused(self, text: str) -> None:
        if text not in self.refusals:
            self.refusals.append(text)

    def close(self) -> None:
        """Leave the graph, and stop the master if it is the tester's own."""
        self._closing.close()

    def renew(self) -> None:
        """Forget latched messages; ends stay, since nodes find them again by their names."""
        self.refusals.clear()
        for publisher in self._client.publishers.values():
            publisher.forget_last()

    # Ends.

    def publish(self, topic: str, type_: str, *, queue: int, latch: bool, like: str = "") -> Ros1Publisher | None:
        """Publish a topic; None while the type is unknown."""
        if topic not in self._client.publishers:
            kind = self._known.kind(type_)
            if kind is None:
                return None
            self._client.publish(topic, kind, queue=max(queue, 16), latch=latch)
        return self._client.publishers[topic]

    def subscribe(self, topic: str, type_: str, heard: Callable[[bytes], None]) -> Subscriber:
        """Call `heard` with each message of a topic."""
        if topic not in self._client.subscribers:
            kind = self._known.kind(type_) or Kind(type_, ANY)
            self._client.subscribe(topic, kind, heard, joined=self._known.learn)
        return self._client.subscribers[topic]

    def serve(self, service: str, type_: str, asked: Callable[[bytes, Reply], None]) -> None:
        """Call `asked` with each request."""
        if service not in self._client.servers:
            self._client.serve(service, self._service(type_), asked)

    def call(self, service: str, type_: str) -> Ros1Client:
        """Return what calls a service."""
        if service not in self._callers:
            self._callers[service] = self._client.call(service, self._service(type_), _LANES)
        return self._callers[service]

    def leave(self, topic: str) -> None:
        """Publish a topic no longer."""
        self._client.leave([topic])

    def knows_service(self, type_: str) -> bool:
        """Return whether a service's type is known."""
        return self._known.service(type_) is not None

    def _service(self, type_: str) -> Kind:
        kind = self._known.service(type_)
        if kind is None:
            raise HostFailure(type_, "a service's type must be known, but is not", slug="unknown-message-type")
        return kind

    # Who is there.

    def state(self, services: Collection[str] = ()) -> RegisteredGraph:
        """Return who publishes, subscribes to and serves what; no master holds the types of services: they are asked.

        Raises HostFailure if the master does not answer.
        """
        calls: list[tuple[str, tuple[object, ...]]] = [("getSystemState", (TESTER,)), ("getTopicTypes", (TESTER,))]
        state, listed = ask_all(self._uri, calls)
        publishers, subscribers, servers = (_table(rows) for rows in state)
        types = {str(topic): str(type_) for topic, type_ in listed}
        for service in sorted({*services} & {name for name, nodes in servers.items() if nodes}):
            with contextlib.suppress(HostFailure):  # it is registered, but not served
                header = {"service": service, "md5sum": ANY, "probe": "1"}
                connection, theirs = called(TESTER, self._uri, header)
                connection.close()
                types[service] = theirs.get("type", ANY)
        return RegisteredGraph(publishers, subscribers, servers, types)

    def require_alone(self) -> None:
        """Do nothing: a master that runs is joined because the user names it."""

    def answers(self, node: str) -> bool:
        """Return whether a node is registered and answers at its address."""
        at = str(ask_all(self._uri, [("lookupNode", (TESTER, node))])[0] or "")
        if not at:
            return False
        try:
            ask(at, "getPid", TESTER, within=WITHIN)
        except HostFailure:
            return False
        return True

    def forget(self, node: str) -> None:
        """Remove what a node that was killed has left registered."""
        leave(self._uri, [node])

    # Parameters.

    def declare(self, values: Mapping[str, Value]) -> None:
        """Set parameters."""
        ask_all(self._uri, [("setParam", (TESTER, key, plain_value(value))) for key, value in values.items()])

    def arguments(self, slot: ProcessSlot) -> tuple[str, ...]:
        """Return a slot's remappings; under another name it gets a copy of the parameters of its own."""
        source, target = slot.node.ros_node, slot.ros_node
        if source and source != target and (values := self.parameter(source)) is not None:
            ask_all(self._uri, [("setParam", (TESTER, target, values))])
        return slot.arguments("ros1")

    def parameter(self, key: str) -> Any:
        """Return the value of a parameter; None if it is not set."""
        return ask_all(self._uri, [("getParam", (TESTER, key))])[0]

    def set_parameter(self, key: str, value: Value) -> None:
        """Set a parameter."""
        self.declare({key: value})

    def lead(self, node: str, state: str) -> bool:
        """Raise HostFailure: nodes of ROS 1 have no lifecycle."""
        rule = f"must become {state}, but nodes of ROS 1 have no lifecycle"
        raise HostFailure(f"node {node}", rule, slug="foreign-step")

    def kind(self, type_: str) -> Raw | None:
        """Return an empty message of a type, as recordings name it."""
        found = self._known.kind(type_)
        return None if found is None else Raw(found.type, found.md5, found.definition, b"")


def _table(rows: list[list[Any]]) -> dict[str, list[str]]:
    return {str(name): [str(who) for who in nodes if who != TESTER] for name, nodes in rows}
