#!/usr/bin/env python3
"""Publishes on /obstacles those of the /detections that are finite and not seen twice.

Both are geometry_msgs/PoseArray in the frame of the map; of a pose, x and y [m] count.
"""

import contextlib
import math

import rclpy
from geometry_msgs.msg import PoseArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data


class ObstacleFilter(Node):
    """Passes on what is sound."""

    def __init__(self):
        super().__init__("obstacle_filter")
        self.least_gap = self.declare_parameter("least_gap", 0.05).value
        self.publisher = self.create_publisher(PoseArray, "/obstacles", 1)
        self.create_subscription(PoseArray, "/detections", self.on_detections, qos_profile_sensor_data)

    def on_detections(self, detections):
        """Publish the sound ones among the detections, also if there are none."""
        kept = PoseArray(header=detections.header)
        for pose in detections.poses:
            x, y = pose.position.x, pose.position.y
            if not (math.isfinite(x) and math.isfinite(y)):
                continue
            near = (math.hypot(x - other.position.x, y - other.position.y) for other in kept.poses)
            if all(gap >= self.least_gap for gap in near):
                kept.poses.append(pose)
        self.publisher.publish(kept)


def main():
    """Filter until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(ObstacleFilter())


if __name__ == "__main__":
    main()
