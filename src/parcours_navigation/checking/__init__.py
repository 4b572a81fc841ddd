"""The battery for authors of planners: puts a planner into small situations, and says what is wrong and what to do."""
