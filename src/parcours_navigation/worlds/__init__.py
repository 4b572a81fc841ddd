"""Worlds as files: the ground, the robot, the others, what is sensed, and the task; numbered cases drawn from them."""
