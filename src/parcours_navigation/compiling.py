"""What `parcours compile` compiles of navigation: shipped planners, and the oracle of what can be solved."""

from __future__ import annotations

from functools import partial

import numpy as np

from parcours.compiling import Part


def _planner(name: str) -> None:
    from parcours_navigation.cases.family import SystemCases
    from parcours_navigation.study.study import NavigationStudy

    NavigationStudy(name, SystemCases(0))(0, 1)


def _oracle() -> None:
    from parcours_navigation.cases.family import SystemCases
    from parcours_navigation.study.distribution import oracle, survived

    oracle(SystemCases(0), np.zeros(1, np.int64))
    survived(SystemCases(0), np.zeros(1, np.int64))


PARTS = {
    "ORCA": Part(partial(_planner, "orca"), 14.0),
    "DWA": Part(partial(_planner, "dwa"), 13.0),
    "MPPI": Part(partial(_planner, "mppi"), 12.0),
    "solvability": Part(_oracle, 9.0),
}
"""Name -> part (entry points `parcours.compiled`)."""
