"""Planners that others wrote, asked once a period in the simulated world: their answers become motion, and facts."""
