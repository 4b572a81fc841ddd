"""Real-time adaptive motion planning (RAMP), after Vannoy & Xiao (2008) and McLeod & Xiao (2016), by component.

Planner (planner, population, switching, guard), Trajectory Generator (trajectory_generator, with profile, corner,
route), Trajectory Evaluation, Path Modification, Control, Sensing (with prediction). messages holds what they exchange.
"""

DECIDING = tuple(
    f"parcours_ramp.planner.{name}"
    for name in (
        "collision", "control", "control_cycle", "corner", "guard", "path_modification", "planner", "planner_state",
        "planning_cycle", "population", "prediction", "profile", "route", "sensing_cycle", "service", "switching",
        "trajectory", "trajectory_evaluation", "trajectory_generator",
    )
)  # fmt: skip
"""The modules that decide what components do; the others hold parameters and the forms of messages."""
