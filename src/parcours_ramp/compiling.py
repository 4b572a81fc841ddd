"""What `parcours compile` compiles of RAMP: its compiled loop, its components, and their covering arrays."""

from __future__ import annotations

from parcours.compiling import CompiledPart


def _loop() -> None:
    from parcours_ramp.system.study import SCHEDULES, system_study

    for schedule in SCHEDULES:
        system_study(schedule, seed=0)(0, 1)


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
    "RAMP": CompiledPart(_loop, 10.0),
    "covering arrays": CompiledPart(_covering_arrays, 2.0),
    "RAMP's components": CompiledPart(_components, 6.5),  # later than the loop, with which it shares kernels
}  # Name -> part (entry points `parcours.compiled`)
