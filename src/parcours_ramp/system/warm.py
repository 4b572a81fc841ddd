"""Imported by the server that nodes are forked from: loads, or compiles, the code that the cases run."""

import dataclasses

from parcours_ramp.planner.latency import none
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SCHEDULES, system_study

for _schedule in SCHEDULES:
    run_components(dataclasses.replace(system_study(_schedule), latencies=none()), 0, 3.0, recording=False)
