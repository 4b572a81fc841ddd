"""RAMP's cases as a Google Test program for live ROS 1 nodes, and the nodes that it tests."""
