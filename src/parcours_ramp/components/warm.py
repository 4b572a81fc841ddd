"""Imported by the server that nodes are forked from: loads, or compiles, the code that the cases run."""

from parcours_ramp.components.study import component_plan, interaction_cases, run_functional

_FIRST = {case.interaction.name: abstract for abstract, case in reversed(list(interaction_cases().items()))}

for _case in component_plan(0, 1).cases(0, len(interaction_cases())):
    if _case.abstract in _FIRST.values():
        run_functional(_case)
