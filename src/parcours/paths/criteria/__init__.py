"""Coverage criteria: what tests of a machine, a composition or a model must visit."""

from parcours.paths.criteria.grammar import (
    COMMUNICATION_CRITERIA,
    CRITERIA,
    DATA_CRITERIA,
    GRAPH_CRITERIA,
    SUBSUMES,
    Criterion,
    parse_criterion,
    subsumes,
)
from parcours.paths.criteria.limits import Limits
from parcours.paths.criteria.requirement import START, Goal, Requirement
from parcours.paths.criteria.requiring import Demand, Subject, demands, requirements

__all__ = [
    "COMMUNICATION_CRITERIA",
    "CRITERIA",
    "DATA_CRITERIA",
    "GRAPH_CRITERIA",
    "START",
    "SUBSUMES",
    "Criterion",
    "Demand",
    "Goal",
    "Limits",
    "Requirement",
    "Subject",
    "demands",
    "parse_criterion",
    "requirements",
    "subsumes",
]
