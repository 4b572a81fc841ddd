"""Coverage criteria: what tests of a machine, a composition or a model must visit."""

from parcours.paths.criteria.grammar import CRITERIA, SUBSUMES, Criterion, parse_criterion, subsumes
from parcours.paths.criteria.requirement import START, Limits, Requirement
from parcours.paths.criteria.requiring import Demand, demands, requirements

__all__ = [
    "CRITERIA", "START", "SUBSUMES", "Criterion", "Demand", "Limits", "Requirement", "demands", "parse_criterion",
    "requirements", "subsumes",
]  # fmt: skip
