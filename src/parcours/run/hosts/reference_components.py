"""The battery's toy components as programs of nodes."""

from __future__ import annotations

from parcours.run.hosts.battery import Counting, Sink, Source
from parcours.run.hosts.node_program import Plain


def node_program(component: str) -> Plain:
    """Return the node program of a toy: Source, Sink or Counting."""
    return Plain(component, {"Source": Source, "Sink": Sink, "Counting": Counting})
