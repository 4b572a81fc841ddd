"""What `parcours compile` compiles of navigation: shipped planners, and the oracle of what can be solved."""

from __future__ import annotations

from functools import partial

import numpy as np

from parcours.compiling import CompiledPart


def _planner(name: str) -> None:
    from parcours_navigation.cases.family import SystemCases
    from parcours_navigation.study.study import NavigationStudy

    NavigationStudy(name, SystemCases(0))(0, 1)


def _oracle() -> None:
    from parcours_navigation.cases.family import SystemCases
    from parcours_navigation.study.distribution import oracle, survived

    oracle(SystemCases(0), np.zeros(1, np.int64))
    survived(SystemCases(0), np.zeros(1, np.int64))


def _requirements() -> None:
    from parcours_navigation.cases.family import SystemCases
    from parcours_navigation.requirements.requirement import requirements_of
    from parcours_navigation.study.study import NavigationStudy

    asked = requirements_of({"any": "always clearance > 0"})
    NavigationStudy("stand-still", SystemCases(0), requirements=asked)(0, 1)


def _route() -> None:
    from parcours_navigation.guests.scenario import Scenario
    from parcours_navigation.study.study import NavigationStudy
    from parcours_navigation.worlds.family import WorldCases
    from parcours_navigation.worlds.file import find_world

    NavigationStudy("a-star", WorldCases(0, find_world("doorway")), Scenario(time_limit=0.5))(0, 1)


def _worlds() -> None:
    from parcours_navigation.guests.scenario import Scenario
    from parcours_navigation.study.study import NavigationStudy
    from parcours_navigation.worlds.family import WorldCases
    from parcours_navigation.worlds.file import find_world

    NavigationStudy("stand-still", WorldCases(0, find_world("doorway")), Scenario(time_limit=0.1))(0, 1)


PARTS = {
    "worlds": CompiledPart(_worlds, 16.0),
    "ORCA": CompiledPart(partial(_planner, "orca"), 0.5),
    "DWA": CompiledPart(partial(_planner, "dwa"), 0.6),
    "MPPI": CompiledPart(partial(_planner, "mppi"), 1.7),
    "requirements": CompiledPart(_requirements, 3.0),
    "MPC": CompiledPart(partial(_planner, "mpc"), 4.5),
    "TEB": CompiledPart(partial(_planner, "teb"), 3.5),
    "A*": CompiledPart(_route, 1.8),
    "solvability": CompiledPart(_oracle, 2.5),
}
"""Name -> part (entry points `parcours.compiled`)."""
