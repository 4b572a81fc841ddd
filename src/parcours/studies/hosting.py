"""The name of a host -> its fabric, with a node for each component of RAMP, in real time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from parcours.errors import require_known
from parcours.run.hosts.resident import Codec, Fabric, nodes_of
from parcours.run.port import Link

HostName = Literal["simulated", "processes", "ros1", "ros2"]
HOSTS: tuple[HostName, ...] = get_args(HostName)
Kind = Literal["component", "system"]

_RESIDENT: dict[Kind, str] = {
    "component": "parcours.studies.ramp_components.resident:ComponentResident",
    "system": "parcours.studies.ramp_system.live:SystemResident",
}
_WARM: dict[Kind, list[str]] = {
    "component": ["parcours.studies.ramp_components.warm"],
    "system": ["parcours.studies.ramp_system.live", "parcours.studies.ramp_system.warm"],
}


@dataclass(frozen=True, slots=True)
class Hosted:
    """A started fabric, and the codec of its messages' bytes."""

    fabric: Fabric
    codec: Codec


@contextlib.contextmanager
def started(
    kind: Kind, host: str, links: Sequence[Link], components: Sequence[str], graph: str = ""
) -> Iterator[Hosted]:
    """Yield a real-time host with its nodes started; end them afterwards.

    The tester and its nodes run before ordinary processes where the system allows it.

    Args:
        kind: of the cases that are run.
        host: processes, ros1 or ros2.
        links: the channels.
        components: those that get a node.
        graph: of ROS 1 the address of a master that runs, of ROS 2 the number of a domain; one of its own if empty.

    Raises:
        BadRequest: there is no such host.
        HostFailure: it cannot be had here, or a node does not start.
    """
    from parcours.run.hosts.scheduling import real_time

    require_known(host, [name for name in HOSTS if name != "simulated"], "host", slug="unknown-host")
    with real_time():
        hosted = {"processes": _processes, "ros1": _ros1, "ros2": _ros2}[host](kind, links, components, graph)
        try:
            yield hosted
        finally:
            hosted.fabric.close()


def isolate(host: str, graph: str) -> None:
    """Move this process into a network of its own, if it is to run a ROS graph of its own; before it has threads.

    Raises:
        HostFailure: the machine forbids it.
    """
    if host in ("ros1", "ros2") and not graph:
        from parcours.run.hosts.isolation import enter_own_network

        enter_own_network()


def _processes(kind: Kind, links: Sequence[Link], components: Sequence[str], graph: str) -> Hosted:
    from parcours.run.hosts.processes import ProcessFabric
    from parcours.studies.ramp_components.resident import RampCodec

    return Hosted(ProcessFabric(nodes_of(links, components, _RESIDENT[kind]), _WARM[kind]), RampCodec())


def _ros1(kind: Kind, links: Sequence[Link], components: Sequence[str], graph: str) -> Hosted:
    from parcours.run.hosts.ros1.fabric import Ros1Fabric
    from parcours.run.hosts.ros1.interfaces import interfaces
    from parcours.studies.ramp_components.model import component_model
    from parcours.studies.ramp_components.ros1 import CODEC

    module = {"component": "parcours.studies.ramp_components.ros1", "system": "parcours.studies.ramp_system.ros1"}[kind]
    nodes, channels = nodes_of(links, components, f"{module}:resident"), interfaces(component_model(), links)
    return Hosted(Ros1Fabric(nodes, channels, CODEC, [module, *_WARM[kind]], master=graph or None), CODEC)


def _ros2(kind: Kind, links: Sequence[Link], components: Sequence[str], graph: str) -> Hosted:
    from parcours.run.hosts.ros2.fabric import Ros2Fabric
    from parcours.run.hosts.ros2.names import topics_of
    from parcours.studies.ramp_components.model import component_model
    from parcours.studies.ramp_components.resident import RampCodec

    nodes = nodes_of(links, components, _RESIDENT[kind])
    domain = int(graph) if graph else None
    return Hosted(Ros2Fabric(nodes, topics_of(component_model()), _WARM[kind], domain=domain), RampCodec())
