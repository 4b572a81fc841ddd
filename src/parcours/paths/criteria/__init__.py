"""Coverage criteria: what tests of a machine, a composition or a model must visit."""

from parcours.paths.criteria.grammar import CRITERIA, SUBSUMES, CoverageCriterion, parse_criterion, subsumes
from parcours.paths.criteria.requirement import START, RequirementLimits, TestRequirement
from parcours.paths.criteria.requiring import Demand, demands, requirements

__all__ = [
    "CRITERIA", "START", "SUBSUMES", "CoverageCriterion", "Demand", "RequirementLimits", "TestRequirement", "demands",
    "parse_criterion", "requirements", "subsumes",
]  # fmt: skip
