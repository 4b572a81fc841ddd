"""Nodes and their channels -> processes on a ROS 2 graph: topics and services, by rclpy, which nothing else imports."""
