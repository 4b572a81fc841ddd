"""Suites become test scripts of other tools, and such scripts find their cases again."""

from parcours.suite.exporting.pytest_script import MOST_EMBEDDED, to_pytest
from parcours.suite.exporting.sealed import checksum, sealed_cases

__all__ = ["MOST_EMBEDDED", "checksum", "sealed_cases", "to_pytest"]
