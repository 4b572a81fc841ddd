#!/usr/bin/env python3
"""Drives along the path that /plan gives, by /cmd_vel (geometry_msgs/TwistStamped) at 20 Hz; stops before obstacles.

It asks for a new path once a second until it has arrived. If the planner does not answer, it goes on along the last
path: from outside, a robot whose planner is dead looks as if all were well. /stopped (std_msgs/Bool) tells whether an
obstacle keeps it from moving. All times are those of its node's clock.
"""

import contextlib
import math

import rclpy
from geometry_msgs.msg import PoseArray, PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool


class Follower(Node):
    """Keeps pose, goal, path and obstacles, and drives."""

    def __init__(self):
        super().__init__("follower")
        self.speed = self.declare_parameter("speed", 0.25).value
        self.turn_rate = self.declare_parameter("turn_rate", 1.5).value
        self.stop_distance = self.declare_parameter("stop_distance", 0.5).value
        self.arrived = self.declare_parameter("arrived", 0.1).value
        self.patience = self.declare_parameter("patience", 2.0).value
        self.pose = self.goal = self.question = self.asked = None
        self.path, self.obstacles = [], []
        self.plan = self.create_client(GetPlan, "/plan")
        self.commands = self.create_publisher(TwistStamped, "/cmd_vel", 1)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.stops = self.create_publisher(Bool, "/stopped", kept)
        self.create_subscription(Odometry, "/odom", self.on_odometry, 1)
        self.create_subscription(PoseArray, "/obstacles", self.on_obstacles, 1)
        self.create_subscription(PoseStamped, "/goal", self.on_goal, 1)
        self.create_timer(1.0, self.ask)
        self.create_timer(0.05, self.drive)

    def on_odometry(self, odometry):
        """Take up where the robot is."""
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        self.pose = (position.x, position.y, 2.0 * math.atan2(turn.z, turn.w))

    def on_obstacles(self, obstacles):
        """Take up where obstacles are."""
        self.obstacles = [(pose.position.x, pose.position.y) for pose in obstacles.poses]

    def on_goal(self, goal):
        """Forget the old path, and ask for one to the new goal."""
        self.goal, self.path = goal, []
        self.ask()

    def ask(self):
        """Ask the planner for a path from here, one question at a time; keep the old one if it does not answer."""
        now = self.get_clock().now()
        if self.question is not None and (now - self.asked).nanoseconds > self.patience * 1e9:
            self.plan.remove_pending_request(self.question)
            self.question = None
        if self.pose is None or self.goal is None or self.question or not self.plan.service_is_ready():
            return
        request = GetPlan.Request(goal=self.goal)
        request.start.pose.position.x, request.start.pose.position.y = self.pose[:2]
        self.asked, self.question = now, self.plan.call_async(request)
        self.question.add_done_callback(self.on_path)

    def on_path(self, answer):
        """Follow the new path from its second point on."""
        self.question = None
        self.path = [(pose.pose.position.x, pose.pose.position.y) for pose in answer.result().plan.poses][1:]

    def drive(self):
        """Turn towards the next point of the path, and drive if it lies ahead and is free."""
        if self.pose is None:
            return
        command = TwistStamped()
        command.header.stamp = self.get_clock().now().to_msg()
        x, y, heading = self.pose
        while self.path and math.hypot(self.path[0][0] - x, self.path[0][1] - y) < self.arrived:
            self.path.pop(0)
            self.goal = self.goal if self.path else None
        stopped = False
        if self.path:
            bearing = math.atan2(self.path[0][1] - y, self.path[0][0] - x) - heading
            bearing = math.atan2(math.sin(bearing), math.cos(bearing))
            command.twist.angular.z = max(-self.turn_rate, min(self.turn_rate, 3.0 * bearing))
            stopped = self.is_blocked(x, y, heading)
            if abs(bearing) < 0.5 and not stopped:
                command.twist.linear.x = self.speed
        self.commands.publish(command)
        self.stops.publish(Bool(data=stopped))

    def is_blocked(self, x, y, heading):
        """Return whether an obstacle is ahead and near."""
        for there_x, there_y in self.obstacles:
            along = (there_x - x) * math.cos(heading) + (there_y - y) * math.sin(heading)
            aside = (there_y - y) * math.cos(heading) - (there_x - x) * math.sin(heading)
            if 0.0 < along < self.stop_distance and abs(aside) < 0.4:
                return True
        return False


def main():
    """Drive until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Follower())


if __name__ == "__main__":
    main()
