"""ORCA: optimal reciprocal collision avoidance."""

from parcours_navigation.planners.orca.planner import Orca

__all__ = ["Orca"]
