"""The study `navigation`: any planner in the simulated world, on the same numbered cases."""
