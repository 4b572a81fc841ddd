"""All compiled parts of Parcours -> machine code on disk, several at a time, so that nobody waits for it later.

Each part runs something small in a process of its own; what it needs is compiled on the way and kept by
`parcours.kernels`.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context

import numpy as np


def _ramp() -> None:
    from parcours.studies.ramp_system.study import SCHEDULES, system_study

    for schedule in SCHEDULES:
        system_study(schedule, seed=0)(0, 1)


def _ramp_components() -> None:
    from parcours.studies.ramp_components.study import component_plan, interaction_of, run_functional

    plan = component_plan(0, 1)
    for case in {interaction_of(case): case for case in plan.cases(0, None)}.values():
        run_functional(case)


def _planner(name: str) -> None:
    from parcours.studies.navigation.study import NavigationStudy
    from parcours.studies.ramp_system.cases import SystemCases

    NavigationStudy(name, SystemCases(0))(0, 1)


def _oracle() -> None:
    from parcours.arena.witness import witness
    from parcours.studies.ramp_system.cases import SystemCases
    from parcours.studies.ramp_system.distribution import oracle, survived

    cases, first = SystemCases(0), np.zeros(1, np.int64)
    oracle(cases, first)
    survived(cases, first)
    witness(cases.obstacles(first))


def _covering_arrays() -> None:
    from parcours.data import choose
    from parcours.studies.ramp_components.model import component_inputs

    choose(component_inputs(), "pairwise")


PARTS: dict[str, Callable[[], None]] = {
    "RAMP": _ramp,
    "ORCA": partial(_planner, "orca"),
    "DWA": partial(_planner, "dwa"),
    "MPPI": partial(_planner, "mppi"),
    "covering arrays": _covering_arrays,
    "solvability": _oracle,
    "RAMP's components": _ramp_components,
}
"""What is compiled, in this order: the longest first, and what shares kernels with it last."""


def compile_all(workers: int, told: Callable[[str, int, int], None] = lambda part, done, total: None) -> None:
    """Compile every part that is not on disk yet.

    Args:
        workers: processes, at least 1.
        told: told (part, done, in all) at the beginning, with no part, and when a part is done.
    """
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running: dict[Future[None], str] = {pool.submit(part): name for name, part in PARTS.items()}
        told("", 0, len(running))
        for done, finished in enumerate(as_completed(running), 1):
            finished.result()
            told(running[finished], done, len(running))
