"""The battery: a planner, put into small situations, becomes findings: what is wrong, what to do."""
