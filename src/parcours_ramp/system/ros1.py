"""RAMP's components for system cases as residents of ROS 1 nodes."""

from __future__ import annotations

from parcours.run.hosts.ros1.packing import Ros1Resident
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.system.live import SystemResident


def resident(component: str) -> Ros1Resident:
    """Return the resident of one of RAMP's components, for system cases."""
    return Ros1Resident(SystemResident(component), CODEC)
