"""Real-time adaptive motion planning (RAMP), after Vannoy & Xiao (2008) and McLeod & Xiao (2016), by component.

Planner (planner, population, switching, guard), Trajectory Generator (trajectory_generator, with profile, corner,
route), Trajectory Evaluation, Path Modification, Control, Sensing (with prediction). messages holds what they exchange.
"""
