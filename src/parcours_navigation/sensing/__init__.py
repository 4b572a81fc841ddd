"""What sensors of the robot measure in the world."""
