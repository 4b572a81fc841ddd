"""What `parcours compile` compiles of RAMP: its compiled loop, its components, and their covering arrays."""

from __future__ import annotations

from parcours.compiling import CompiledPart


def _loop() -> None:
    from parcours_ramp.system.study import SCHEDULES, system_study

    for schedule in SCHEDULES:
        system_study(schedule, seed=0)(0, 1)


def _judged_loop() -> None:
    from dataclasses import replace

    from parcours_navigation.requirements.requirement import requirements_of
    from parcours_ramp.system.study import system_study

    replace(system_study("guarded", seed=0), requirements=requirements_of({"any": "always clearance > 0"}))(0, 1)


def _components() -> None:
    from parcours_ramp.components.study import component_plan, interaction_of, run_functional

    plan = component_plan(0, 1)
    for case in {interaction_of(case): case for case in plan.cases(0, None)}.values():
        run_functional(case)


def _covering_arrays() -> None:
    from parcours.data import choose
    from parcours_ramp.components.model import component_inputs

    choose(component_inputs(), "pairwise")


PARTS = {
    "RAMP": CompiledPart(_loop, 20.0),
    "RAMP with requirements": CompiledPart(_judged_loop, 6.0),
    "covering arrays": CompiledPart(_covering_arrays, 6.0),
    "RAMP's components": CompiledPart(_components, 9.0),  # later than the loop, with which it shares kernels
}  # Name -> part (entry points `parcours.compiled`)
