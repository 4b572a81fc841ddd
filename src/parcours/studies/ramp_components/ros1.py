"""RAMP's components as residents of ROS 1 nodes: their messages' bytes are those of ROS."""

from __future__ import annotations

from parcours.planners.ramp.wire import FORMS, flatten, restore
from parcours.run.hosts.ros1.packing import Ros1Codec
from parcours.studies.ramp_components.resident import ComponentResident

CODEC = Ros1Codec(FORMS, flatten, restore)
"""RAMP's payloads <-> ROS 1 messages."""


class Ros1ComponentResident(ComponentResident):
    """One of RAMP's components, for component cases."""

    def encode(self, channel: str, payload: object) -> bytes:
        """Return the payload's ROS 1 message."""
        return CODEC.encode(channel, payload)

    def decode(self, channel: str, data: bytes) -> object:
        """Return the payload. Raises BadRequest, naming channel and field, if these bytes are none."""
        return CODEC.decode(channel, data)
