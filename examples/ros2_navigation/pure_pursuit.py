#!/usr/bin/env python3
"""Follows the path on /plan by pure pursuit (Coulter, 1992), and waits while an obstacle is close ahead.

Listens to /odom (nav_msgs/Odometry), /plan (nav_msgs/Path, latched) and /obstacles (visualization_msgs/MarkerArray),
and publishes /cmd_vel (geometry_msgs/TwistStamped) at 20 Hz. All are in one frame.
"""

import contextlib
import itertools
import math

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray


class PurePursuit(Node):
    """Keeps pose, path and obstacles, and steers towards a point ahead on the path."""

    def __init__(self):
        super().__init__("pure_pursuit")
        self.speed = self.declare_parameter("speed", 0.4).value
        self.lookahead = self.declare_parameter("lookahead", 0.5).value
        self.stop_distance = self.declare_parameter("stop_distance", 0.5).value
        self.arrived = self.declare_parameter("arrived", 0.1).value
        self.pose = None
        self.path, self.obstacles, self.passed = [], [], 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.commands = self.create_publisher(TwistStamped, "/cmd_vel", 1)
        self.create_subscription(Odometry, "/odom", self.on_odometry, 1)
        self.create_subscription(Path, "/plan", self.on_path, latched)
        self.create_subscription(MarkerArray, "/obstacles", self.on_obstacles, 1)
        self.create_timer(0.05, self.drive)

    def on_odometry(self, odometry):
        """Take up where the robot is."""
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        self.pose = position.x, position.y, 2.0 * math.atan2(turn.z, turn.w)

    def on_path(self, path):
        """Follow a new path from its first point on."""
        corners = [(one.pose.position.x, one.pose.position.y) for one in path.poses]
        self.path, self.passed = [], 0
        for (x0, y0), (x1, y1) in itertools.pairwise(corners):
            n = max(1, round(math.hypot(x1 - x0, y1 - y0) / 0.05))
            self.path += [(x0 + (x1 - x0) * k / n, y0 + (y1 - y0) * k / n) for k in range(n)]
        self.path += corners[-1:]

    def on_obstacles(self, markers):
        """Take up where obstacles are, and how large."""
        self.obstacles = [(one.pose.position.x, one.pose.position.y, 0.5 * one.scale.x) for one in markers.markers]

    def drive(self):
        """Publish the arc to the point ahead."""
        command = TwistStamped()
        command.header.stamp = self.get_clock().now().to_msg()
        if self.pose is not None and self.path:
            x, y, heading = self.pose
            while self.passed < len(self.path) - 1 and math.dist(self.path[self.passed], (x, y)) < self.lookahead:
                self.passed += 1
            dx, dy = self.path[self.passed][0] - x, self.path[self.passed][1] - y
            ahead = dx * math.cos(heading) + dy * math.sin(heading)
            aside = dy * math.cos(heading) - dx * math.sin(heading)
            if math.dist(self.path[-1], (x, y)) > self.arrived and not self.is_blocked(x, y, heading):
                if ahead > 0.3 * abs(aside):
                    command.twist.linear.x = self.speed
                    command.twist.angular.z = 2.0 * self.speed * aside / (dx * dx + dy * dy)
                else:
                    command.twist.angular.z = math.copysign(0.8, aside)
        self.commands.publish(command)

    def is_blocked(self, x, y, heading):
        """Return whether an obstacle is ahead and near."""
        for there_x, there_y, radius in self.obstacles:
            along = (there_x - x) * math.cos(heading) + (there_y - y) * math.sin(heading)
            aside = (there_y - y) * math.cos(heading) - (there_x - x) * math.sin(heading)
            if 0.0 < along < self.stop_distance + radius and abs(aside) < 0.25 + radius:
                return True
        return False


def main():
    """Drive until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(PurePursuit())


if __name__ == "__main__":
    main()
