"""Starts the nodes of a real-time host, one for each component."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from parcours.errors import require_known
from parcours.model.structure import Cefsm
from parcours.run.hosts import HOSTS
from parcours.run.hosts.node_program import Codec, Transport, nodes_of
from parcours.run.port import Link
from parcours.study.payload_fields import Shown, Specimens, require_carried
from parcours.verdict.contracts import plain


@dataclass(frozen=True, slots=True)
class Nodes:
    """How the components of a study become nodes of a real-time host."""

    model: Cefsm  # whose channels give topics and services their names
    links: tuple[Link, ...]  # the channels
    components: tuple[str, ...]  # those that get a node
    node_program: str  # dotted name of what runs in a node
    codec: Codec  # of messages, where they travel as they are
    ros1_node_program: str  # the same on ROS 1
    ros1_codec: str  # dotted name of what returns the codec there; called with `given` unless that is empty
    preload: tuple[str, ...] = ()  # modules to load before processes are forked
    given: str = ""  # the second argument of node programs, such as where a study is
    shown: Shown = plain  # payloads as messages of the model
    specimens: Specimens = tuple  # payloads that show on every host, before it starts, that messages travel whole


@dataclass(frozen=True, slots=True)
class Hosted:
    """A started transport, and the codec of its messages' bytes."""

    transport: Transport
    codec: Codec


@contextlib.contextmanager
def started(nodes: Nodes, host: str, graph: str = "") -> Iterator[Hosted]:
    """Yield a real-time host with its nodes started; end them afterwards.

    The tester and its nodes run before ordinary processes where the system allows it.

    Args:
        nodes: what to start.
        host: processes, ros1 or ros2.
        graph: of ROS 1 the address of a master that runs, of ROS 2 the number of a domain; one of its own if empty.

    Raises:
        BadRequest: there is no such host.
        HostFailure: it cannot be had here, a node does not start, or its messages are not what the model says.
    """
    from parcours.run.hosts.scheduling import real_time

    require_known(host, [name for name in HOSTS if name != "simulated"], "host", slug="unknown-host")
    with real_time():
        hosted = _start(nodes, host, graph)
        try:
            yield hosted
        finally:
            hosted.transport.close()


def _start(nodes: Nodes, host: str, graph: str) -> Hosted:
    preload, codec = list(nodes.preload), nodes.codec
    if host == "ros1":
        from importlib import import_module

        from parcours.run.hosts.interfaces import interfaces
        from parcours.run.hosts.ros1.transport import Ros1Transport

        module, _, name = nodes.ros1_codec.partition(":")
        make = getattr(import_module(module), name)
        ros1 = make(nodes.given) if nodes.given else make()
        require_carried(nodes.model, nodes.shown, nodes.specimens, ros1)
        started = nodes_of(nodes.links, nodes.components, nodes.ros1_node_program, nodes.given)
        preload = [nodes.ros1_node_program.partition(":")[0], *preload]
        types = interfaces(nodes.model, nodes.links)
        return Hosted(Ros1Transport(started, types, ros1, preload, master=graph or None), ros1)
    require_carried(nodes.model, nodes.shown, nodes.specimens, codec)
    started = nodes_of(nodes.links, nodes.components, nodes.node_program, nodes.given)
    if host == "ros2":
        from parcours.run.hosts.interfaces import interfaces
        from parcours.run.hosts.ros2.transport import Ros2Transport

        domain = int(graph) if graph else None
        return Hosted(Ros2Transport(started, interfaces(nodes.model, nodes.links), preload, domain=domain), codec)
    from parcours.run.hosts.processes import ProcessTransport

    return Hosted(ProcessTransport(started, preload), codec)
