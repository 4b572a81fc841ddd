"""Coverage criteria: what tests of a machine, a composition or a model must visit."""

from parcours.paths.criteria.grammar import CRITERIA, SUBSUMES, CoverageCriterion, parse_criterion, subsumes
from parcours.paths.criteria.requirement import START, CoverageRequirement, RequirementLimits
from parcours.paths.criteria.requiring import Demand, demands, requirements

__all__ = [
    "CRITERIA",
    "START",
    "SUBSUMES",
    "CoverageCriterion",
    "CoverageRequirement",
    "Demand",
    "RequirementLimits",
    "demands",
    "parse_criterion",
    "requirements",
    "subsumes",
]  # fmt: skip
