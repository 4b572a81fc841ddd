"""MPPI: model predictive path integral control."""

from parcours.planners.mppi.planner import Mppi

__all__ = ["Mppi"]
