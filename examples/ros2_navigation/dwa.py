#!/usr/bin/env python3
"""Drives to /goal_pose by the dynamic window approach on laser scans (Fox, Burgard and Thrun, 1997).

Listens to /odom (nav_msgs/Odometry), /scan (sensor_msgs/LaserScan) and /goal_pose (geometry_msgs/PoseStamped), and
publishes /cmd_vel (geometry_msgs/Twist) at 10 Hz. Goal and odometry are in one frame.
"""

import contextlib
import math

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


class Dwa(Node):
    """Keeps pose, goal and the last scan, and chooses an arc ten times a second."""

    def __init__(self):
        super().__init__("dwa")
        self.speed = self.declare_parameter("speed", 0.5).value
        self.turn_rate = self.declare_parameter("turn_rate", 1.2).value
        self.acceleration = self.declare_parameter("acceleration", 1.0).value
        self.radius = self.declare_parameter("radius", 0.22).value
        self.margin = self.declare_parameter("margin", 0.08).value
        self.horizon = self.declare_parameter("horizon", 1.6).value
        self.arrived = self.declare_parameter("arrived", 0.15).value
        self.period = 0.1
        self.pose = self.goal = None
        self.v = self.w = 0.0
        self.points = np.zeros((0, 2))
        self.commands = self.create_publisher(Twist, "/cmd_vel", 1)
        self.create_subscription(Odometry, "/odom", self.on_odometry, 1)
        self.create_subscription(LaserScan, "/scan", self.on_scan, qos_profile_sensor_data)
        self.create_subscription(PoseStamped, "/goal_pose", self.on_goal, 1)
        self.create_timer(self.period, self.drive)

    def on_odometry(self, odometry):
        """Take up where the robot is, and how fast it drives."""
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        self.pose = position.x, position.y, 2.0 * math.atan2(turn.z, turn.w)
        self.v, self.w = odometry.twist.twist.linear.x, odometry.twist.twist.angular.z

    def on_scan(self, scan):
        """Take up what is around, as points in the robot's frame."""
        ranges = np.asarray(scan.ranges)
        angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
        seen = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges < 2.0)
        ranges, angles = ranges[seen], angles[seen]
        self.points = np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))

    def on_goal(self, goal):
        """Go there from now on."""
        self.goal = goal.pose.position.x, goal.pose.position.y

    def drive(self):
        """Publish the best arc of the window."""
        command = Twist()
        if self.pose is not None and self.goal is not None:
            x, y, heading = self.pose
            dx, dy = self.goal[0] - x, self.goal[1] - y
            if math.hypot(dx, dy) > self.arrived:
                ahead = dx * math.cos(heading) + dy * math.sin(heading)
                aside = dy * math.cos(heading) - dx * math.sin(heading)
                command.linear.x, command.angular.z = self.choose(ahead, aside)
        self.commands.publish(command)

    def free_bearing(self, goal_x, goal_y):
        """Return the bearing next to the goal's along which the robot fits through for a while."""
        bearing, far = math.atan2(goal_y, goal_x), min(math.hypot(goal_x, goal_y), 1.3)
        for turn in sorted(np.linspace(-1.6, 1.6, 33), key=abs):
            s, c = math.sin(bearing + turn), math.cos(bearing + turn)
            along = self.points[:, 0] * c + self.points[:, 1] * s
            aside = np.abs(self.points[:, 1] * c - self.points[:, 0] * s)
            if not np.any((along > 0.0) & (along < far) & (aside < self.radius + 2.0 * self.margin)):
                return bearing + turn
        return bearing

    def choose(self, goal_x, goal_y):
        """Return speed and yaw rate of the best arc to a goal in the robot's frame; stop and turn if there is none."""
        aim = self.free_bearing(goal_x, goal_y)
        reach = self.acceleration * 2.0 * self.period
        speeds = np.linspace(max(0.0, self.v - reach), min(self.speed, self.v + reach), 5)
        v, w = (one.ravel() for one in np.meshgrid(speeds, np.linspace(-self.turn_rate, self.turn_rate, 13)))
        times = np.linspace(0.2, self.horizon, 5)
        turned = w[:, None] * times
        straight = np.abs(turned) < 1e-6
        safe = np.where(straight, 1.0, turned)
        along = v[:, None] * times * np.where(straight, 1.0, np.sin(safe) / safe)
        across = v[:, None] * times * np.where(straight, 0.0, (1.0 - np.cos(safe)) / safe)
        gap = np.full(len(v), 2.0)
        if len(self.points):
            far = np.hypot(along[:, :, None] - self.points[:, 0], across[:, :, None] - self.points[:, 1])
            gap = np.minimum(gap, far.min(axis=(1, 2)) - self.radius)
        bearing = aim - turned[:, 1]
        bearing = np.abs(np.arctan2(np.sin(bearing), np.cos(bearing)))
        cost = bearing - v + 1.5 * np.maximum(0.0, 0.25 - gap)
        cost[gap < self.margin] = np.inf
        best = int(np.argmin(cost))
        if not np.isfinite(cost[best]):
            return 0.0, math.copysign(0.6, goal_y)
        return float(v[best]), float(w[best])


def main():
    """Drive until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Dwa())


if __name__ == "__main__":
    main()
