"""RAMP, the planner of the paper, whole: its components, its compiled loop, and the studies that test both."""
