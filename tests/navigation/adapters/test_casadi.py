"""The example of a planner by CasADi, run with the real one."""

from __future__ import annotations

from pathlib import Path

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.study.study import NavigationStudy

FILE = Path(__file__).parents[3] / "examples" / "casadi_mpc" / "casadi_mpc.py"


def test_it_reaches_a_goal_and_its_cases_do_not_depend_on_each_other() -> None:
    study = NavigationStudy(f"{FILE}:CasadiMpc", SystemCases(seed=1))
    facts = study(0, 2)
    assert (facts["error"] == 0).all() and (facts["t_goal"] > 0).any()
    assert study(1, 1).tobytes() == facts[1:2].tobytes()
