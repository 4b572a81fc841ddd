"""Any planner in the simulated world, on the same numbered cases as RAMP: its answers become motion, and facts."""
