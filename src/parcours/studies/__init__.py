"""Studies: each joins models, input domains, a system under test and oracles. Users write their own the same way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from parcours.errors import require_known

if TYPE_CHECKING:
    from parcours.suite import Case

STUDIES = ("ramp_components", "ramp_system", "navigation")
"""The studies that ship with Parcours."""


def check_study(name: str) -> None:
    """Raise BadRequest unless `name` is a study."""
    require_known(name, list(STUDIES), "study", slug="unknown-study")


def suite_of(name: str, *, seed: int, n_cases: int | None = None) -> Iterator[Case]:
    """Return the cases of a study, one by one.

    Args:
        name: one of STUDIES.
        seed: campaign seed.
        n_cases: how many; by default what Each Choice needs for every abstract case.

    Raises:
        BadRequest: the study is unknown.
    """
    check_study(name)
    if name in ("ramp_system", "navigation"):  # the same cases, whatever planner runs them
        from parcours.studies.ramp_system.cases import SystemCases

        return SystemCases(seed).suite(n_cases)
    from parcours.studies.ramp_components.study import component_plan

    rows = 3 if n_cases is None else -(-n_cases // len(component_plan(seed, 1)))
    return component_plan(seed, rows).cases(0, n_cases)
