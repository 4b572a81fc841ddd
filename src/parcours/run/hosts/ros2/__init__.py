"""Runs components as nodes of a ROS 2 graph by rclpy, which nothing else imports."""
