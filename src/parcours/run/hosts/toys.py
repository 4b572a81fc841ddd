"""The battery's toy components as residents of nodes."""

from __future__ import annotations

from parcours.run.hosts.battery import Counting, Sink, Source
from parcours.run.hosts.resident import Plain


def resident(component: str) -> Plain:
    """Return the resident of a toy: Source, Sink or Counting."""
    return Plain(component, {"Source": Source, "Sink": Sink, "Counting": Counting})
