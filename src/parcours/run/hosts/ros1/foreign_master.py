"""Asks a ROS 1 master for the graph of a binding, and sets, reads and copies parameters there."""

from __future__ import annotations

from typing import Any

from parcours.errors import HostFailure
from parcours.run.binding.graph import Graph
from parcours.run.binding.structure import Binding, Value
from parcours.run.hosts.ros1.ends import ANY, WITHIN, called
from parcours.run.hosts.ros1.graph import ask, ask_all, leave


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


class MasterEnd:
    """The tester's questions to a master."""

    def __init__(self, name: str, uri: str) -> None:
        self._name, self._uri = name, uri

    def state(self) -> Graph:
        """Return who publishes, subscribes to and serves what; types of topics only.

        Raises HostFailure if the master does not answer.
        """
        calls: list[tuple[str, tuple[object, ...]]] = [
            ("getSystemState", (self._name,)), ("getTopicTypes", (self._name,)),
        ]  # fmt: skip
        state, types = ask_all(self._uri, calls)
        publishers, subscribers, servers = (self._table(table) for table in state)
        return Graph(publishers, subscribers, servers, {str(topic): str(type_) for topic, type_ in types})

    def _table(self, rows: list[list[Any]]) -> dict[str, list[str]]:
        return {str(name): [str(who) for who in nodes if who != self._name] for name, nodes in rows}

    def graph(self, binding: Binding, addresses: set[str]) -> Graph:
        """Return the same with the types of services, which no master holds: those bound are asked."""
        known = self.state()
        types = dict(known.types)
        bound = {channel.address for channel in binding.channels if channel.part != "topic"} | addresses
        for service in sorted(bound & {name for name, nodes in known.servers.items() if nodes}):
            try:
                types[service] = self._type(service)
            except HostFailure:
                continue
        return Graph(known.publishers, known.subscribers, known.servers, types)

    def _type(self, service: str) -> str:
        """Return the type that a service gives itself. Raises HostFailure if it is not served."""
        connection, header = called(self._name, self._uri, {"service": service, "md5sum": ANY, "probe": "1"})
        connection.close()
        return header.get("type", ANY)

    def address_of(self, node: str) -> str:
        """Return where a node answers; empty if the master knows none of that name."""
        found = ask_all(self._uri, [("lookupNode", (self._name, node))])[0]
        return str(found or "")

    def answers(self, node: str) -> bool:
        """Return whether a node is registered and answers at its address."""
        at = self.address_of(node)
        if not at:
            return False
        try:
            ask(at, "getPid", self._name, within=WITHIN)
        except HostFailure:
            return False
        return True

    def parameter(self, key: str) -> Any:
        """Return the value of a parameter; None if it is not set."""
        return ask_all(self._uri, [("getParam", (self._name, key))])[0]

    def set_parameters(self, values: dict[str, Any]) -> None:
        """Set parameters. Raises HostFailure if the master does not answer."""
        ask_all(self._uri, [("setParam", (self._name, key, value)) for key, value in values.items()])

    def copy_parameters(self, source: str, target: str) -> None:
        """Give a node under another name the private parameters that it would have under its own."""
        if source and source != target and (values := self.parameter(source)) is not None:
            self.set_parameters({target: values})

    def forget(self, node: str) -> None:
        """Remove what a node that has ended has left registered."""
        leave(self._uri, [node])
