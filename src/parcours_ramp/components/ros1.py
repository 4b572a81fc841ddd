"""RAMP's components as programs of ROS 1 nodes: their messages' bytes are those of ROS."""

from __future__ import annotations

from parcours.run.hosts.ros1.packing import Ros1Codec, Ros1NodeProgram
from parcours_ramp.components.node_program import ComponentNodeProgram
from parcours_ramp.planner.wire import FORMS, flatten, restore

CODEC = Ros1Codec(FORMS, flatten, restore)  # RAMP's payloads <-> ROS 1 messages


def codec() -> Ros1Codec:
    """Return the codec."""
    return CODEC


def node_program(component: str) -> Ros1NodeProgram:
    """Return the node_program of one of RAMP's components, for component cases.

    >>> CODEC.decode("speed_limit", CODEC.encode("speed_limit", 0.5))
    0.5
    """
    return Ros1NodeProgram(ComponentNodeProgram(component), CODEC)
