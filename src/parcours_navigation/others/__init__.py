"""Others: all that moves beside the robot, from discs at constant velocity to people who give way."""
