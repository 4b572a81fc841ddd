"""What runs components: the same components under the same rules, on a simulated or on the real clock."""

HOSTS = ("simulated", "processes", "ros1", "ros2")


def isolate(host: str, graph: str) -> None:
    """Move this process into a network of its own, if it is to run a ROS graph of its own; before it has threads."""
    if host in ("ros1", "ros2") and not graph:
        from parcours.run.hosts.isolation import enter_own_network

        enter_own_network()
