"""A run's track becomes numbers: metrics of one run, and the scores of published benchmarks over many."""

from parcours_navigation.measures.benchmarks import BENCHMARKS, barn, score
from parcours_navigation.measures.one_case import measures_as_published, measures_of
from parcours_navigation.measures.scores import Benchmark, Runs, ScoreColumn, sct, spl
from parcours_navigation.measures.table import AS_PUBLISHED, MEASURES, METRICS, PUBLISHED, Metric

__all__ = [
    "AS_PUBLISHED",
    "BENCHMARKS",
    "MEASURES",
    "METRICS",
    "PUBLISHED",
    "Benchmark",
    "Metric",
    "Runs",
    "ScoreColumn",
    "barn",
    "measures_as_published",
    "measures_of",
    "score",
    "sct",
    "spl",
]
