"""Traces against the step relation of a model: first deviation, expected set, the path that led there."""

from parcours.verdict.conformance.behaviour import Allowance
from parcours.verdict.conformance.checking import NOTHING, Checker, Fields
from parcours.verdict.conformance.findings import Conformance, Expectation, TraceDeviation
from parcours.verdict.conformance.offline import check

__all__ = ["NOTHING", "Allowance", "Checker", "Conformance", "Expectation", "Fields", "TraceDeviation", "check"]
