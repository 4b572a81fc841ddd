"""RAMP's components for system cases as programs of ROS 1 nodes."""

from __future__ import annotations

from parcours.run.hosts.ros1.packing import Ros1NodeProgram
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.system.live import SystemNodeProgram


def node_program(component: str) -> Ros1NodeProgram:
    """Return the node_program of one of RAMP's components, for system cases."""
    return Ros1NodeProgram(SystemNodeProgram(component), CODEC)
