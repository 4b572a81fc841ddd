"""MPPI: model predictive path integral control."""

from parcours_navigation.planners.mppi.planner import Mppi

__all__ = ["Mppi"]
