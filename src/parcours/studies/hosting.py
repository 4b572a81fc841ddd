"""The name of a host -> a fabric with a node for each component of RAMP, in real time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Literal, get_args

from parcours.errors import require_known
from parcours.run.hosts.resident import Fabric, nodes_of
from parcours.run.port import Link

HostName = Literal["simulated", "processes", "ros1", "ros2"]
HOSTS: tuple[HostName, ...] = get_args(HostName)


@contextlib.contextmanager
def started(host: str, links: Sequence[Link], components: Sequence[str], resident: str,
            preload: Sequence[str]) -> Iterator[Fabric]:  # fmt: skip
    """Yield the fabric of a real-time host with its nodes started; end them afterwards.

    The tester and its nodes run before ordinary processes where the system allows it.

    Args:
        host: processes, ros1 or ros2.
        links: the channels.
        components: those that get a node.
        resident: dotted name of what the nodes run.
        preload: modules that are loaded once, before the nodes' processes are forked.

    Raises:
        BadRequest: there is no such host.
        HostFailure: it cannot be had here, or a node does not start.
    """
    from parcours.run.hosts.scheduling import real_time

    require_known(host, [name for name in HOSTS if name != "simulated"], "host", slug="unknown-host")
    fabric = _fabric(host, links, components, resident, preload)
    try:
        with real_time():
            yield fabric
    finally:
        fabric.close()


def _fabric(
    host: str, links: Sequence[Link], components: Sequence[str], resident: str, preload: Sequence[str]
) -> Fabric:
    nodes = nodes_of(links, components, resident)
    from parcours.run.hosts.processes import ProcessFabric

    return ProcessFabric(nodes, preload)
