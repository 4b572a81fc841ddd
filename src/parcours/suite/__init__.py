"""Abstract cases, rows of values and time budgets become executable cases with stable ids, and files."""

from parcours.suite.cases import Case
from parcours.suite.combining import Plan, combine
from parcours.suite.files import read_suite, write_suite

__all__ = ["Case", "Plan", "combine", "read_suite", "write_suite"]
