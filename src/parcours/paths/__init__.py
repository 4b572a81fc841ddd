"""Internal test paths: what a criterion requires, few paths that meet it, and a measure."""

from parcours.paths.covering import MachineCover, cover, internal_paths, machine_covers
from parcours.paths.criteria import (
    CRITERIA,
    SUBSUMES,
    CoverageCriterion,
    CoverageRequirement,
    RequirementLimits,
    requirements,
    subsumes,
)
from parcours.paths.internal import InternalPath
from parcours.paths.measuring import Coverage, measure

__all__ = [
    "CRITERIA",
    "SUBSUMES",
    "Coverage",
    "CoverageCriterion",
    "CoverageRequirement",
    "InternalPath",
    "MachineCover",
    "RequirementLimits",
    "cover",
    "internal_paths",
    "machine_covers",
    "measure",
    "requirements",
    "subsumes",
]  # fmt: skip
