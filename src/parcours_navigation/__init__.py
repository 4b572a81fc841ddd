"""Robots among moving obstacles: the protocol of a planner, the world, cases, measures, planners compared."""
