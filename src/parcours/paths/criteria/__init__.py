"""Coverage criteria: a machine, a composition or a model, and a criterion -> what tests must visit."""

from parcours.paths.criteria.grammar import (
    COMMUNICATION_CRITERIA,
    CRITERIA,
    DATA_CRITERIA,
    GRAPH_CRITERIA,
    Criterion,
    parse_criterion,
)
from parcours.paths.criteria.limits import Limits
from parcours.paths.criteria.requirement import START, Goal, Requirement
from parcours.paths.criteria.requiring import Demand, Subject, demands, requirements
from parcours.paths.criteria.subsumption import SUBSUMES, subsumes

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
