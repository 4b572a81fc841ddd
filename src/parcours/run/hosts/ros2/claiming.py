"""A node's name on a ROS 2 domain -> the claim to it that only one tester of a network has, until it ends.

A graph is discovered bit by bit: who looks whether others are there may look too early. Abstract sockets belong to the
network, as the graph on loopback does, and vanish with their process.
"""

from __future__ import annotations

import errno
import socket

from parcours.errors import HostFailure


def claim(domain: int, node: str) -> socket.socket:
    """Return a socket that holds the name until it is closed.

    Raises:
        HostFailure: another tester holds it.
    """
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0parcours/ros2/{domain}/{node}")
    except OSError as error:
        held.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise occupied(domain) from error
    return held


def occupied(domain: int) -> HostFailure:
    """Return what is wrong with a domain on which another tester has nodes of the same names."""
    rule = "must be alone with its nodes, but nodes of another tester report there, too"
    remedy = "use another ROS_DOMAIN_ID, or a network of your own"
    return HostFailure(f"ROS domain {domain}", rule, remedy, slug="ros2-occupied")
