"""RAMP's components as residents of ROS 1 nodes: their messages' bytes are those of ROS."""

from __future__ import annotations

from parcours.run.hosts.ros1.packing import Ros1Codec, Ros1Resident
from parcours_ramp.components.resident import ComponentResident
from parcours_ramp.planner.wire import FORMS, flatten, restore

CODEC = Ros1Codec(FORMS, flatten, restore)
"""RAMP's payloads <-> ROS 1 messages."""


def codec() -> Ros1Codec:
    """Return the codec."""
    return CODEC


def resident(component: str) -> Ros1Resident:
    """Return the resident of one of RAMP's components, for component cases.

    >>> CODEC.decode("speed_limit", CODEC.encode("speed_limit", 0.5))
    0.5
    """
    return Ros1Resident(ComponentResident(component), CODEC)
