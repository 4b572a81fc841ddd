"""ORCA: optimal reciprocal collision avoidance."""

from parcours.planners.orca.planner import Orca

__all__ = ["Orca"]
