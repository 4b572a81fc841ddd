"""What a node needs to know of the component it runs, and of the way its messages travel: structural types.

A *node program* is made inside the node's process from its dotted name. A *line* is the node's end of a transport, and
a *transport* is how the tester reaches its nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Protocol, cast

import msgspec

from parcours.errors import BadRequest, one_of
from parcours.run.hosts.frames import Command, Report
from parcours.run.port import Component, Link, Step


class Codec(Protocol):
    """Payloads <-> bytes, channel by channel."""

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the payload's bytes. Raises BadRequest if the channel carries something else."""

    def decode(self, channel: str, data: bytes) -> object:
        """Return the payload. Raises BadRequest, naming channel and rule, if these bytes are not one."""


class NodeProgram(Codec, Protocol):
    """The component of a node, for any case, and its messages' bytes."""

    def instance(self, case: bytes) -> Component:
        """Return a fresh component for the case."""

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Move an idle component as the tester asks, at `now` [ns]."""

    def view(self, component: Component) -> tuple[str, object] | None:
        """Return what the component shows of itself, as a payload of some channel; None if nothing."""


class Line(Protocol):
    """A node's end of the transport."""

    def poll(self, until: int | None) -> Command | None:
        """Return the next command; None once the monotonic clock shows `until` [ns], if that is not None.

        Messages that travel by themselves arrive joined with the command that announces them.
        """

    def report(self, report: Report) -> None:
        """Tell the tester; the messages in it leave now."""


class Transport(Protocol):
    """How the tester reaches its nodes: commands and messages there, reports and messages back."""

    @property
    def label(self) -> str:
        """The host's name in traces."""

    @property
    def nodes(self) -> Collection[str]:
        """The components that have a node."""

    def command(self, node: str, command: Command) -> None:
        """Tell a node. What comes back of one that has ended is, each time, that it has died."""

    def deliver(self, channel: str, number: int, data: bytes) -> None:
        """Let the message reach the channel's receiver, if it is a node."""

    def poll(self, until: int) -> Sequence[tuple[str, Report]]:
        """Return what nodes have said, (node, report), waiting until the monotonic clock shows `until` [ns]."""

    @property
    def is_losing_one(self) -> bool:
        """Whether a process has ended, or is about to, whose end `poll` has not said yet."""

    def signal(self, node: str, signal: int) -> None:
        """Send the node's process a signal of the operating system."""

    def close(self) -> None:
        """End all nodes, and wait until they have ended. Again: do nothing."""


@dataclass(frozen=True, slots=True)
class Node:
    """One node to start.

    Attributes:
        component: its component's name in the model.
        node_program: dotted name `module:callable`; called in the process with the component's name, it returns the
            NodeProgram.
        links: those it sends or receives on.
        given: a second argument of the callable, such as the file of a study; left out if empty.
    """

    component: str
    node_program: str
    links: tuple[Link, ...] = field(repr=False)
    given: str = ""


def nodes_of(links: Sequence[Link], components: Sequence[str], node_program: str, given: str = "") -> tuple[Node, ...]:
    """Return a node for each component, with its links."""
    return tuple(
        Node(name, node_program, tuple(link for link in links if name in (link.sender, link.receiver)), given)
        for name in components
    )


def node_program_of(node: Node) -> NodeProgram:
    """Return the node's node_program. Raises BadRequest if its dotted name leads nowhere."""
    module, _, name = node.node_program.partition(":")
    try:
        make = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        rule = f"a node_program is named module:callable, but {node.node_program!r} leads nowhere: {error}"
        raise BadRequest(f"node {node.component}", rule, slug="node-program-unknown") from error
    return cast(NodeProgram, make(node.component, node.given) if node.given else make(node.component))


class Plain:
    """A node_program of components that are made without a case, whose payloads are plain values.

    >>> plain = Plain("", {})
    >>> plain.decode("c", plain.encode("c", [1, 2.5, "x"]))
    [1, 2.5, 'x']
    """

    def __init__(self, component: str, makers: dict[str, Callable[[], Component]]) -> None:
        self._component, self._makers = component, makers

    def instance(self, case: bytes) -> Component:
        """Return a fresh component."""
        if self._component not in self._makers:
            remedy = one_of(self._component, list(self._makers))
            raise BadRequest("node", f"no component is called {self._component!r}", remedy, slug="node-program-unknown")
        return self._makers[self._component]()

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Wake the component if its time has come, else poll it."""
        due = component.next_wake()
        return component.wake(now) if due is not None and due <= now else component.handle(None, None, now)

    def view(self, component: Component) -> tuple[str, object] | None:
        """Show nothing."""
        return None

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the MessagePack of a plain value."""
        return msgspec.msgpack.encode(payload)

    def decode(self, channel: str, data: bytes) -> object:
        """Return the plain value. Raises BadRequest if the bytes are no MessagePack."""
        try:
            return msgspec.msgpack.decode(data)
        except msgspec.DecodeError as error:
            raise BadRequest(
                f"channel {channel!r}", f"a message is MessagePack, but: {error}", slug="wire-fields"
            ) from error
