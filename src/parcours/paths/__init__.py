"""Machines and coverage criteria -> internal test paths: what to visit, few paths that do, and a measure."""

from parcours.paths.covering import cover, internal_paths
from parcours.paths.criteria import CRITERIA, Requirement, requirements
from parcours.paths.internal import InternalPath
from parcours.paths.measuring import Coverage, measure

__all__ = [
    "CRITERIA",
    "Coverage",
    "InternalPath",
    "Requirement",
    "cover",
    "internal_paths",
    "measure",
    "requirements",
]
