"""Runs nodes that know nothing of Parcours: processes, the tester among them on a ROS 1 or ROS 2 graph, a session."""
